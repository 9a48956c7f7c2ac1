#include <fielddeform/gffd/detail/paper.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::gffd::detail {
namespace {

constexpr int kHalvings = 60;
constexpr double kFrameOffset = 0.05;  // radii

// Clipped: without value beyond the influence, where the paper's E is zero and its inverse is the radius.
double clippedDistance(const field::Field& posed, const Vec3& point) {
  const field::FieldValue v = posed.evaluate(point);
  return v.inside ? v.pseudoDistance : posed.referenceRadius();
}

}  // namespace

WarpPairs warpPairs(const skeleton::SkeletonPair& pair) {
  skeleton::Skeleton rest, posed;
  for (const auto& p : pair.pairs) {
    if (p.kind != skeleton::PairKind::Matched) continue;
    rest.primitives.push_back(pair.rest.primitives[p.rest]);
    posed.primitives.push_back(pair.posed.primitives[p.posed]);
  }
  WarpPairs out;
  for (std::size_t i = 0; i < rest.primitives.size(); ++i) {
    out.rest.insert(out.rest.end(), rest.primitives[i].points.begin(), rest.primitives[i].points.end());
    out.posed.insert(out.posed.end(), posed.primitives[i].points.begin(), posed.primitives[i].points.end());
  }
  Vec3 direction = Vec3::Zero();
  for (const Vec3& p : out.rest)
    if (const Vec3 d = p - out.rest[0]; d.squaredNorm() > direction.squaredNorm()) direction = d;
  const double length = direction.norm();
  const bool onOneLine = std::all_of(out.rest.begin(), out.rest.end(), [&](const Vec3& p) {
    return (p - out.rest[0]).cross(direction).norm() <= 1e-6 * length * length;
  });
  if (!onOneLine || !(length > 0)) return out;
  skeleton::SampledPair samples;
  samples.set = skeleton::sampleSkeleton(rest, 1e9);
  for (std::size_t j = 0; j < samples.set.samples.size(); ++j) {
    samples.rest.push_back(samples.set.position(rest, j));
    samples.posed.push_back(samples.set.position(posed, j));
  }
  skeleton::fitFrames(samples, rest, posed);
  const Vec3 u = anyPerpendicular(direction), v = direction.normalized().cross(u);
  for (std::size_t j = 0; j < samples.rest.size(); ++j)
    for (const Vec3& axis : {u, Vec3(-u), v, Vec3(-v)}) {
      const Vec3 offset = kFrameOffset * samples.set.samples[j].radius * axis;
      out.rest.push_back(samples.rest[j] + offset);
      out.posed.push_back(samples.posed[j] + samples.rotation[j] * offset);
    }
  return out;
}

Vec3 gradientDirection(const field::Field& posed, const Vec3& point) {
  const field::FieldValue v = posed.evaluate(point);
  const double length = v.gradient.norm();
  if (!v.inside || !(length > 0)) return Vec3::Zero();
  return -v.gradient / length;
}

Tracked trackAsPrinted(const field::Field& posed, const std::function<Vec3(const Vec3&)>& direction, const Vec3& start,
                       double target, double tolerance, int maxIterations) {
  Tracked t{start, start, Status::Stalled, 0};
  double delta = clippedDistance(posed, start) - target;
  for (int i = 0; i < maxIterations && std::abs(delta) >= tolerance; ++i) {
    Vec3 step = delta * direction(t.position);
    if (step.squaredNorm() == 0 || !step.allFinite()) break;
    Vec3 next = t.position + step;
    double there = clippedDistance(posed, next) - target;
    for (int h = 0; h < kHalvings && delta * there < 0; ++h) {
      step *= 0.5;
      next = t.position + step;
      there = clippedDistance(posed, next) - target;
    }
    if (!(std::abs(delta) > std::abs(there))) break;  // "else dV = -dV": nothing changes, the paper never ends here
    t.position = next;
    delta = there;
  }
  t.residual = std::abs(delta);
  if (t.residual < tolerance) t.status = Status::Converged;
  return t;
}

}  // namespace fielddeform::gffd::detail
