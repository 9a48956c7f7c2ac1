#include <Eigen/Eigenvalues>
#include <fielddeform/gffd/detail/correspondence.h>
#include <fielddeform/numeric/rotation.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::gffd::detail {
namespace {

using skeleton::PairKind;
using skeleton::Primitive;
using skeleton::PrimitiveType;
using skeleton::SampledPair;
using skeleton::Skeleton;

struct Moments {
  Vec3 centre = Vec3::Zero();
  Mat3 axes = Mat3::Identity();  // columns, descending spread
  Vec3 spread = Vec3::Zero();    // standard deviations
};

Moments momentsOf(const std::vector<Vec3>& points, const std::vector<double>& masses) {
  Moments m;
  double total = 0;
  for (std::size_t i = 0; i < points.size(); ++i) total += masses[i], m.centre += masses[i] * points[i];
  if (!(total > 0)) return m;
  m.centre /= total;
  Mat3 c = Mat3::Zero();
  for (std::size_t i = 0; i < points.size(); ++i)
    c += masses[i] / total * (points[i] - m.centre) * (points[i] - m.centre).transpose();
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(c);
  for (int k = 0; k < 3; ++k) {
    m.axes.col(k) = solver.eigenvectors().col(2 - k);
    m.spread[k] = std::sqrt(std::max(0.0, solver.eigenvalues()[2 - k]));
  }
  return m;
}

Moments momentsOf(const Primitive& primitive) {
  Skeleton alone;
  alone.primitives = {primitive};
  if (!primitive.radius) alone.primitives[0].radius = 1;
  const auto set = skeleton::sampleSkeleton(alone, 0.25, 4096);
  std::vector<Vec3> points(set.samples.size());
  std::vector<double> masses(points.size());
  for (std::size_t j = 0; j < points.size(); ++j) points[j] = set.position(alone, j), masses[j] = set.samples[j].mass;
  return momentsOf(points, masses);
}

// The affine map that takes one set of moments to another, turning as little as the principal axes allow: axes of equal
// spread (a cylinder's cross-section) are matched as a plane, not one by one.
struct MomentMap {
  Vec3 from, to;
  Mat3 linear;
  Vec3 operator()(const Vec3& x) const { return to + linear * (x - from); }
};

MomentMap alignMoments(const Moments& a, const Moments& b) {
  Mat3 c = Mat3::Zero();
  Vec3 scale = Vec3::Ones();
  for (int first = 0; first < 3;) {
    int last = first + 1;
    const auto tied = [&](const Vec3& s) { return s[last] > 0.9 * s[first]; };
    while (last < 3 && (tied(a.spread) || tied(b.spread))) ++last;
    Mat3 pa = Mat3::Zero(), pb = Mat3::Zero();
    double sa = 0, sb = 0;
    for (int k = first; k < last; ++k) {
      pa += a.axes.col(k) * a.axes.col(k).transpose();
      pb += b.axes.col(k) * b.axes.col(k).transpose();
      sa += a.spread[k];
      sb += b.spread[k];
    }
    c += pa * pb / (1 << first);
    if (sa > 1e-9 * a.spread[0] && sb > 0)
      for (int k = first; k < last; ++k) scale[k] = sb / sa;
    first = last;
  }
  const Mat3 rotation = numeric::kabsch(c);
  return {a.centre, b.centre, rotation * a.axes * scale.asDiagonal() * a.axes.transpose()};
}

Vec3 alongLine(const Primitive& line, double share) {
  const std::size_t n = line.points.size(), segments = n - (line.closed ? 0 : 1);
  double total = 0;
  for (std::size_t i = 0; i < segments; ++i) total += (line.points[(i + 1) % n] - line.points[i]).norm();
  double left = share * total;
  for (std::size_t i = 0; i < segments; ++i) {
    const Vec3 a = line.points[i], b = line.points[(i + 1) % n];
    const double l = (b - a).norm();
    if (left <= l || i + 1 == segments) return l > 0 ? Vec3(a + std::min(1.0, left / l) * (b - a)) : a;
    left -= l;
  }
  return line.points[0];
}

void replaceLine(SampledPair& s, const std::vector<Index>& chain, const Primitive& posed) {
  std::vector<double> share(chain.size(), 0);
  for (std::size_t j = 1; j < chain.size(); ++j) share[j] = share[j - 1] + (s.rest[chain[j]] - s.rest[chain[j - 1]]).norm();
  const double total = share.back();
  double there = 0, back = 0;
  for (std::size_t j = 0; j < chain.size(); ++j) {
    if (total > 0) share[j] /= total;
    there += (alongLine(posed, share[j]) - s.rest[chain[j]]).squaredNorm();
    back += (alongLine(posed, 1 - share[j]) - s.rest[chain[j]]).squaredNorm();
  }
  for (std::size_t j = 0; j < chain.size(); ++j)
    s.posed[chain[j]] = alongLine(posed, back < there ? 1 - share[j] : share[j]);
}

// The influence radius that a sample has in the pose; a replaced primitive's points are not its own, their mean serves.
double posedRadius(const Primitive& posed, const skeleton::Sample& sample, PairKind kind) {
  double radius = 0;
  if (kind == PairKind::Matched) {
    for (int k = 0; k < 3; ++k)
      if (sample.vertex[k] != kNoIndex) radius += sample.weight[k] * skeleton::radiusOf(posed, sample.vertex[k]);
    return radius;
  }
  const auto n = static_cast<Index>(posed.points.size());
  for (Index v = 0; v < n; ++v) radius += skeleton::radiusOf(posed, v) / n;
  return radius;
}

}  // namespace

MovingPart movingPart(const skeleton::SkeletonPair& pair) {
  MovingPart part;
  for (const auto& p : pair.pairs) {
    if (p.kind != PairKind::Matched && p.kind != PairKind::Replaced) continue;
    part.rest.primitives.push_back(pair.rest.primitives[p.rest]);
    part.restIndex.push_back(p.rest);
    part.posedIndex.push_back(p.posed);
    part.kind.push_back(p.kind);
  }
  return part;
}

SampledPair sampleMotion(const MovingPart& part, const Skeleton& posed, const field::Field& posedField) {
  SampledPair s;
  s.set = skeleton::sampleSkeleton(part.rest);
  Skeleton target;  // what fitFrames reads roll and rotation from
  std::vector<std::optional<MomentMap>> moments(part.kind.size());
  for (std::size_t i = 0; i < part.kind.size(); ++i) {
    const Primitive& to = posed.primitives[part.posedIndex[i]];
    target.primitives.push_back(part.kind[i] == PairKind::Matched ? to : part.rest.primitives[i]);
    if (part.kind[i] == PairKind::Replaced) moments[i] = alignMoments(momentsOf(part.rest.primitives[i]), momentsOf(to));
  }
  const std::size_t n = s.set.samples.size();
  s.rest.resize(n);
  s.posed.resize(n);
  s.scale.resize(n);
  for (std::size_t j = 0; j < n; ++j) {
    const Index i = s.set.samples[j].primitive;
    s.scale[j] = posedRadius(posed.primitives[part.posedIndex[i]], s.set.samples[j], part.kind[i]) / s.set.samples[j].radius;
    s.rest[j] = s.set.position(part.rest, j);
    s.posed[j] = part.kind[i] == PairKind::Matched ? s.set.position(target, j)
                                                   : posedField.closest(part.posedIndex[i], (*moments[i])(s.rest[j])).point;
  }
  for (std::size_t i = 0; i < part.kind.size(); ++i) {
    const Primitive &from = part.rest.primitives[i], &to = posed.primitives[part.posedIndex[i]];
    const bool lines = from.type == PrimitiveType::Polyline && to.type == PrimitiveType::Polyline;
    if (part.kind[i] == PairKind::Replaced && lines && from.closed == to.closed && !from.closed)
      replaceLine(s, s.set.chain[i], to);
  }
  skeleton::fitFrames(s, part.rest, target);
  return s;
}

}  // namespace fielddeform::gffd::detail
