#include <fielddeform/core/error.h>
#include <fielddeform/core/rigid.h>
#include <fielddeform/numeric/rotation.h>
#include <fielddeform/skeleton/interpolate.h>

namespace fielddeform::skeleton {
namespace {

Vec3 mean(const std::vector<Vec3>& points) {
  Vec3 sum = Vec3::Zero();
  for (const Vec3& x : points) sum += x - points[0];  // centred on one of them, so that far objects keep their digits
  return points[0] + sum / static_cast<double>(points.size());
}

// The rigid motion of least squares, points equally weighted, in coordinates about the rest mean.
Rigid bestMotion(const std::vector<Vec3>& rest, const std::vector<Vec3>& posed, const Vec3& restMean) {
  const Vec3 posedMean = mean(posed);
  Mat3 c = Mat3::Zero();
  for (std::size_t i = 0; i < rest.size(); ++i) c += (rest[i] - restMean) * (posed[i] - posedMean).transpose();
  return {numeric::kabschQuaternion(c), posedMean - restMean};
}

std::vector<Vec3> pointsAt(const std::vector<Vec3>& rest, const std::vector<Vec3>& posed, double t) {
  if (rest == posed) return rest;
  const Vec3 centre = mean(rest);
  const Rigid motion = bestMotion(rest, posed, centre), back = motion.inverse(), part = screwPower(motion, t);
  std::vector<Vec3> out;
  out.reserve(rest.size());
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const Vec3 x = rest[i] - centre;
    out.push_back(centre + part(x + t * (back(posed[i] - centre) - x)));
  }
  return out;
}

double mix(double a, double b, double t) { return a == b ? a : (1 - t) * a + t * b; }

std::vector<double> mix(const std::vector<double>& a, const std::vector<double>& b, std::size_t count, double fillA,
                        double fillB, double t) {
  if (a.empty() && b.empty()) return {};
  std::vector<double> out(count);
  for (std::size_t i = 0; i < count; ++i) out[i] = mix(a.empty() ? fillA : a[i], b.empty() ? fillB : b[i], t);
  return out;
}

Primitive matchedAt(const Primitive& rest, const Primitive& posed, double t) {
  Primitive p = posed;
  p.points = pointsAt(rest.points, posed.points, t);
  if (rest.radius && posed.radius) p.radius = mix(*rest.radius, *posed.radius, t);
  else if (rest.radius) p.radius = rest.radius;
  // A list on one side only needs the other side's radius.
  const bool knowsRest = !rest.pointRadius.empty() || rest.radius, knowsPosed = !posed.pointRadius.empty() || posed.radius;
  if (knowsRest && knowsPosed)
    p.pointRadius = mix(rest.pointRadius, posed.pointRadius, p.points.size(), rest.radius.value_or(0), posed.radius.value_or(0), t);
  p.roll = mix(rest.roll, posed.roll, p.points.size(), 0, 0, t);
  p.weight = mix(rest.weight, posed.weight, t);
  if (rest.rotation || posed.rotation) {
    const Quat a = rest.rotation.value_or(Quat::Identity()), b = posed.rotation.value_or(Quat::Identity());
    p.rotation = (screwPower({b * a.conjugate(), Vec3::Zero()}, t).rotation * a).normalized();
  }
  return p;
}

// A removed primitive fades under its own name, or a longer one if the pose uses that.
Primitive fading(const Skeleton& pose, Primitive p, double t) {
  p.weight *= 1 - t;
  while (pose.find(p.name)) p.name.append(".removed");
  return p;
}

}  // namespace

Skeleton interpolatePose(const SkeletonPair& pair, double t) {
  requireInRange("t", t, 0, 1);
  if (t == 0) return pair.rest;
  if (t == 1) return pair.posed;
  Skeleton pose = pair.posed;
  for (const PrimitivePair& link : pair.pairs) {
    if (link.kind == PairKind::Matched)
      pose.primitives[link.posed] = matchedAt(pair.rest.primitives[link.rest], pair.posed.primitives[link.posed], t);
    if (link.kind == PairKind::Added) pose.primitives[link.posed].weight *= t;
    if (link.kind == PairKind::Removed) pose.primitives.push_back(fading(pose, pair.rest.primitives[link.rest], t));
  }
  return pose;
}

}  // namespace fielddeform::skeleton
