#include <fielddeform/core/rigid.h>
#include <fielddeform/numeric/rotation.h>

#include <Eigen/LU>
#include <Eigen/SVD>
#include <bit>
#include <cmath>
#include <optional>

namespace fielddeform::numeric {
namespace {

constexpr double kUndetermined = 1e-14;   // relative to the greatest singular value
constexpr double kIllConditioned = 1e-9;  // det / tr^3 of the Hessian below which Newton steps are not trusted

// Brings the greatest entry into [1, 2) by an exact power of two. False for zero and for non-finite matrices.
bool normalize(Mat3& c) {
  const double largest = c.cwiseAbs().maxCoeff();
  if (!(largest > 0) || !c.allFinite()) return false;
  const int exponent = std::ilogb(largest);
  // Two factors: one alone may overflow for denormal entries.
  c *= std::ldexp(1.0, -(exponent / 2));
  c *= std::ldexp(1.0, -(exponent - exponent / 2));
  return true;
}

// Maximises tr(exp([w]) R C) to second order until the step is negligible; the optimum of a quadratic form on the
// quaternions has no other local maxima, so a positive definite Hessian proves it. Nothing if that is not reached.
std::optional<Quat> newton(const Mat3& c, Quat q, int steps) {
  for (int i = 0; i < steps; ++i) {
    const Mat3 m = q.toRotationMatrix() * c;
    const double trace = m.trace();
    const double a = trace - m(0, 0), b = trace - m(1, 1), d = trace - m(2, 2);
    const double e = -0.5 * (m(0, 1) + m(1, 0)), f = -0.5 * (m(0, 2) + m(2, 0)), g = -0.5 * (m(1, 2) + m(2, 1));
    const double minor = a * b - e * e;
    const double c0 = b * d - g * g, c1 = f * g - e * d, c2 = e * g - b * f;  // first row of the adjugate
    const double det = a * c0 + e * c1 + f * c2;
    const double size = a + b + d;
    if (!(a > 0) || !(minor > 0) || !(det > kIllConditioned * size * size * size)) return std::nullopt;
    const Vec3 axial(m(1, 2) - m(2, 1), m(2, 0) - m(0, 2), m(0, 1) - m(1, 0));
    const double c11 = a * d - f * f, c12 = e * f - a * g;
    const Vec3 half = Vec3(c0 * axial[0] + c1 * axial[1] + c2 * axial[2], c1 * axial[0] + c11 * axial[1] + c12 * axial[2],
                           c2 * axial[0] + c12 * axial[1] + minor * axial[2]) *
                      (0.5 / det);
    // Cayley: the quaternion (1, w/2), normalised.
    q = Quat(1, half.x(), half.y(), half.z()) * q;
    q.normalize();
    if (half.squaredNorm() < 1e-12) return q;  // the error of a step is of third order: 1e-18
  }
  return std::nullopt;
}

// Eigenvector of Horn's 4x4 matrix to the largest root of its characteristic polynomial (Theobald 2005): a start for
// Newton, good to about 1e-7 where the rotation is determined.
Quat hornStart(const Mat3& s) {
  const double d0 = s(1, 2) - s(2, 1), d1 = s(2, 0) - s(0, 2), d2 = s(0, 1) - s(1, 0);
  const double p0 = s(0, 1) + s(1, 0), p1 = s(2, 0) + s(0, 2), p2 = s(1, 2) + s(2, 1);
  Eigen::Matrix4d n;
  n << s.trace(), d0, d1, d2,                                //
      d0, s(0, 0) - s(1, 1) - s(2, 2), p0, p1,               //
      d1, p0, s(1, 1) - s(0, 0) - s(2, 2), p2,               //
      d2, p1, p2, s(2, 2) - s(0, 0) - s(1, 1);
  const double k2 = -2 * s.squaredNorm(), k1 = -8 * s.determinant(), k0 = n.determinant();
  double root = std::sqrt(-1.5 * k2);  // s1 + s2 + s3 <= sqrt(3) |C|
  for (int i = 0; i < 30; ++i) {
    const double square = root * root;
    const double value = (square + k2) * square + k1 * root + k0, slope = (4 * square + 2 * k2) * root + k1;
    const double step = slope > 0 ? value / slope : 0;
    root -= step;
    if (!(step > 1e-10 * root)) break;
  }
  n.diagonal().array() -= root;
  // The adjugate of a rank-3 symmetric matrix is a multiple of v v^T: its longest row is v.
  Eigen::Vector4d best = Eigen::Vector4d::Zero();
  for (int row = 0; row < 4; ++row) {
    Eigen::Vector4d v;
    for (int col = 0; col < 4; ++col) {
      Mat3 sub;
      for (int i = 0, r = 0; i < 4; ++i) {
        if (i == row) continue;
        for (int j = 0, t = 0; j < 4; ++j)
          if (j != col) sub(r, t++) = n(i, j);
        ++r;
      }
      v[col] = ((row + col) % 2 ? -1.0 : 1.0) * sub.determinant();
    }
    if (v.squaredNorm() > best.squaredNorm()) best = v;
  }
  if (!(best.squaredNorm() > 0)) return Quat::Identity();
  best.normalize();
  return {best[0], best[1], best[2], best[3]};
}

Quat bySvd(const Mat3& c) {
  const Eigen::JacobiSVD<Mat3> svd(c, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Vec3 s = svd.singularValues();
  Mat3 v = svd.matrixV();
  const double sign = (v * svd.matrixU().transpose()).determinant() < 0 ? -1 : 1;
  if (!(s[1] + sign * s[2] > kUndetermined * s[0])) return minimalRotation(svd.matrixU().col(0), v.col(0));
  v.col(2) *= sign;
  return Quat(Mat3(v * svd.matrixU().transpose())).normalized();
}

Quat solve(const Mat3& c) {
  if (const auto q = newton(c, hornStart(c), 4)) return *q;
  return bySvd(c);
}

}  // namespace

Quat kabschQuaternion(const Mat3& c) {
  Mat3 scaled = c;
  return normalize(scaled) ? solve(scaled) : Quat::Identity();
}

Mat3 kabsch(const Mat3& c) { return kabschQuaternion(c).toRotationMatrix(); }

Quat polarRefine(const Mat3& c, const Quat& start) {
  Mat3 scaled = c;
  if (!normalize(scaled)) return Quat::Identity();
  if (const auto q = newton(scaled, start, 5)) return *q;
  return solve(scaled);
}

}  // namespace fielddeform::numeric
