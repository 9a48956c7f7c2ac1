#include <Eigen/Eigenvalues>
#include <fielddeform/core/rigid.h>
#include <fielddeform/mesh/measures.h>
#include <fielddeform/skeleton/principal_axes.h>

#include <array>
#include <cmath>
#include <stdexcept>

namespace fielddeform::skeleton {
namespace {

constexpr double kTie = 0.99;  // "within 1 %"

struct Sums {
  double mass = 0;
  Vec3 first = Vec3::Zero();
  Mat3 second = Mat3::Zero();

  void add(double m, const Vec3& x) {
    mass += m;
    first += m * x;
    second += m * x * x.transpose();
  }
};

// Integrals over a segment, by Simpson's rule: exact for these quadratics.
void addSegment(Sums& sums, const Vec3& a, const Vec3& b) {
  const double length = (b - a).norm();
  sums.add(length / 6, a);
  sums.add(length * 2 / 3, 0.5 * (a + b));
  sums.add(length / 6, b);
}

void addLines(Sums& sums, std::span<const Primitive* const> primitives, const Vec3& origin) {
  for (const Primitive* p : primitives) {
    if (p->type != PrimitiveType::Polyline) continue;
    for (std::size_t i = p->closed ? 0 : 1; i < p->points.size(); ++i)
      addSegment(sums, p->points[i == 0 ? p->points.size() - 1 : i - 1] - origin, p->points[i] - origin);
  }
}

void addMeshes(Sums& sums, std::span<const Primitive* const> primitives, const Vec3& origin) {
  for (const Primitive* p : primitives) {
    if (p->type != PrimitiveType::Mesh) continue;
    std::vector<Index> corners, offsets{0};
    for (const auto& face : p->faces) {
      corners.insert(corners.end(), face.begin(), face.end());
      offsets.push_back(static_cast<Index>(corners.size()));
    }
    const mesh::Mesh surface(p->points, std::move(corners), std::move(offsets));
    const mesh::SurfaceMoments m = mesh::surfaceMoments(surface, surface.positions());
    const Vec3 c = m.centroid - origin;
    sums.mass += m.area;
    sums.first += m.area * c;
    sums.second += m.area * (m.covariance + c * c.transpose());
  }
}

Vec3 withSign(const Vec3& v) {
  const double largest = v.cwiseAbs().maxCoeff();
  for (int k = 0; k < 3; ++k)
    if (std::abs(v[k]) >= kTie * largest) return v[k] < 0 ? Vec3(-v) : v;
  return v;
}

// The coordinate axis of the longest side among those allowed.
Vec3 longestSide(const Box& box, const std::array<bool, 3>& allowed) {
  const Vec3 side = box.isEmpty() ? Vec3::Zero() : Vec3(box.sizes());
  double longest = 0;
  for (int k = 0; k < 3; ++k)
    if (allowed[k]) longest = std::max(longest, side[k]);
  for (int k = 0; k < 3; ++k)
    if (allowed[k] && side[k] >= kTie * longest) return Vec3::Unit(k);
  return Vec3::UnitX();
}

}  // namespace

Bulk bulkOf(std::span<const Primitive* const> primitives) {
  Bulk bulk;
  for (const Primitive* p : primitives)
    for (const Vec3& x : p->points) bulk.box.extend(x);
  if (bulk.box.isEmpty()) throw std::invalid_argument("skeleton: no points");
  const Vec3 origin = bulk.box.center();
  Sums sums;
  addLines(sums, primitives, origin);
  if (!(sums.mass > 0)) addMeshes(sums, primitives, origin);
  if (!(sums.mass > 0)) {
    sums = {};
    for (const Primitive* p : primitives)
      for (const Vec3& x : p->points) sums.add(1, x - origin);
  }
  const Vec3 mean = sums.first / sums.mass;
  bulk.centre = origin + mean;
  bulk.covariance = sums.second / sums.mass - mean * mean.transpose();
  return bulk;
}

Vec3 autoAxis(const Bulk& bulk) {
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(bulk.covariance);  // ascending eigenvalues
  const Vec3 lambda = solver.eigenvalues();
  if (!(lambda[1] < kTie * lambda[2])) return longestSide(bulk.box, {true, true, true});
  return withSign(solver.eigenvectors().col(2).normalized());
}

Vec3 autoAbout(const Bulk& bulk, const Vec3& axis) {
  const Vec3 e1 = anyPerpendicular(axis), e2 = axis.cross(e1);
  const double p = e1.dot(bulk.covariance * e1), q = e1.dot(bulk.covariance * e2), r = e2.dot(bulk.covariance * e2);
  const double mean = 0.5 * (p + r), half = std::sqrt(0.25 * (p - r) * (p - r) + q * q);
  // What a thin line varies across itself is rounding, no direction.
  const bool flat = !(mean + half > 1e-12 * bulk.covariance.trace());
  if (!flat && mean - half < kTie * (mean + half)) {
    const Eigen::Vector2d v = p >= r ? Eigen::Vector2d(mean + half - r, q) : Eigen::Vector2d(q, mean + half - p);
    return withSign((v[0] * e1 + v[1] * e2).normalized());
  }
  std::array<bool, 3> allowed{};
  for (int k = 0; k < 3; ++k) allowed[k] = std::abs(axis[k]) < 0.8;  // at least one is: 3 * 0.64 > 1
  const Vec3 side = longestSide(bulk.box, allowed);
  return withSign((side - side.dot(axis) * axis).normalized());
}

}  // namespace fielddeform::skeleton
