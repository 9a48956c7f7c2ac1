#include <fielddeform/map/detail/barr_profile.h>
#include <fielddeform/numeric/elementary.h>
#include <fielddeform/numeric/rotation.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

namespace fielddeform::map::detail {
namespace {

constexpr int kBins = 33;
// Frames are those of a polygon, half a segment's turn off at its ends: they decide only what points leave open.
constexpr double kFrameOffset = 0.25;  // radii
constexpr double kFrameWeight = 1e-3;

}  // namespace

BarrProblem barrProblem(const SkeletonMotion& motion, std::size_t most) {
  BarrProblem p;
  p.pairs = pointPairs(motion, {.offset = kFrameOffset, .most = most});
  for (std::size_t i = 0; i < p.pairs.own; ++i) p.centre += p.pairs.rest[i] / static_cast<double>(p.pairs.own);
  Mat3 spread = Mat3::Zero();
  Box box;
  for (std::size_t i = 0; i < p.pairs.rest.size(); ++i) {
    const Vec3 x = p.pairs.rest[i] - p.centre;
    if (i < p.pairs.own) spread += x * x.transpose();
    box.extend(p.pairs.rest[i]);
  }
  p.size = std::max(box.sizes().norm(), 1e-300);
  p.axes = Eigen::SelfAdjointEigenSolver<Mat3>(spread).eigenvectors();
  return p;
}

Profile profileAlong(const SkeletonMotion& motion, const Vec3& centre, const Vec3& axis) {
  const skeleton::SampledPair& m = motion.samples;
  double low = 1e300, high = -1e300;
  for (const Vec3& x : m.rest) {
    low = std::min(low, axis.dot(x - centre));
    high = std::max(high, axis.dot(x - centre));
  }
  struct Bin {
    double mass = 0, s = 0, scale = 0;
    Vec3 rest = Vec3::Zero(), posed = Vec3::Zero();
    Eigen::Vector4d turn = Eigen::Vector4d::Zero();
  };
  std::array<Bin, kBins> bins;
  for (std::size_t j = 0; j < m.rest.size(); ++j) {
    const double s = axis.dot(m.rest[j] - centre), t = high > low ? (s - low) / (high - low) : 0;
    Bin& b = bins[static_cast<std::size_t>(std::clamp(static_cast<int>(t * kBins), 0, kBins - 1))];
    b.mass += 1;
    b.s += s;
    b.scale += m.scale[j];
    b.rest += m.rest[j];
    b.posed += m.posed[j];
    b.turn += (b.turn.dot(m.rotation[j].coeffs()) < 0 ? -1 : 1) * m.rotation[j].coeffs();
  }
  Profile p;
  Quat last = Quat::Identity();
  Vec3 lastRest = Vec3::Zero(), lastPosed = Vec3::Zero();
  std::vector<Vec3> across{};  // cumulative, the twist so far taken out
  for (const Bin& b : bins) {
    if (b.mass == 0 || b.turn.norm() == 0) continue;
    const Quat q(Eigen::Vector4d(b.turn.normalized()));
    const Vec3 rest = b.rest / b.mass, posed = b.posed / b.mass;
    if (!p.s.empty()) {
      Quat step = last.conjugate() * q;
      if (step.w() < 0) step.coeffs() = -step.coeffs();
      const double sine = step.vec().norm();
      const Vec3 by = sine > 0 ? Vec3(2 * numeric::atan2(sine, step.w()) / sine * step.vec()) : Vec3::Zero();
      const double twist = axis.dot(p.turn) + 0.5 * axis.dot(by);
      p.turn += by;
      p.bendTotal += Eigen::AngleAxisd(twist, axis) * Vec3(by - axis.dot(by) * axis);
    }
    across.push_back(p.bendTotal);
    p.length.push_back(p.s.empty() ? 0 : p.length.back() + (posed - lastPosed).norm() - (rest - lastRest).norm());
    p.s.push_back(b.s / b.mass);
    p.scale.push_back(b.scale / b.mass);
    p.turnAlong.push_back(axis.dot(p.turn));
    p.turnAcross.push_back((p.turn - axis.dot(p.turn) * axis).norm());
    last = q;
    lastRest = rest;
    lastPosed = posed;
  }
  const double total = p.bendTotal.norm();
  for (const Vec3& a : across) p.bend.push_back(total > 0 ? a.dot(p.bendTotal) / total : 0);
  return p;
}

void rangeOf(const std::vector<double>& s, const std::vector<double>& value, double& begin, double& end) {
  begin = s.front();
  end = s.back();
  const double total = value.back() - value.front();
  if (s.size() < 3 || total == 0) return;
  const auto crossing = [&](double share) {
    for (std::size_t i = 1; i < s.size(); ++i) {
      const double a = (value[i - 1] - value.front()) / total, b = (value[i] - value.front()) / total;
      if (b >= share && b > a) return s[i - 1] + std::clamp((share - a) / (b - a), 0.0, 1.0) * (s[i] - s[i - 1]);
    }
    return s.back();
  };
  const double near = crossing(0.15), far = crossing(0.85);
  if (!(far > near)) return;
  begin = std::max(begin, near - 0.15 / 0.7 * (far - near));
  end = std::min(end, far + 0.15 / 0.7 * (far - near));
}

RigidFit fitRigid(const PointPairs& pairs, const std::vector<Vec3>& x, const Vec3& pivot, Eigen::VectorXd* residual) {
  const auto weight = [&](std::size_t i) { return i < pairs.own ? 1 : kFrameWeight; };
  Vec3 mx = Vec3::Zero(), mq = Vec3::Zero();
  double mass = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double w = weight(i) * weight(i);
    mass += w;
    mx += w * x[i];
    mq += w * (pairs.posed[i] - pivot);
  }
  mx /= mass;
  mq /= mass;
  Mat3 m = Mat3::Zero();
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double w = weight(i) * weight(i);
    m += w * (x[i] - mx) * (pairs.posed[i] - pivot - mq).transpose();
  }
  RigidFit fit;
  fit.turn = Quat(numeric::kabsch(m)).normalized();
  fit.shift = mq - fit.turn * mx;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Vec3 r = weight(i) * (fit.turn * x[i] + fit.shift - (pairs.posed[i] - pivot));
    fit.cost += r.squaredNorm();
    if (residual) residual->segment<3>(static_cast<Eigen::Index>(3 * i)) = r;
  }
  return fit;
}

}  // namespace fielddeform::map::detail
