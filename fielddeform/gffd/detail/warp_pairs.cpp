#include <fielddeform/core/rigid.h>
#include <fielddeform/gffd/detail/paper.h>

#include <fielddeform/numeric/rotation.h>

#include <algorithm>
#include <limits>

namespace fielddeform::gffd::detail {
namespace {

using skeleton::Primitive;
using skeleton::Skeleton;

constexpr double kStraightOffset = 0.05;  // radii
// Fitted to the prototype's figures of Fig. 5, whose frame points are not written down (docs/tracking.md).
constexpr double kNaiveOffset = 0.2;  // radii
constexpr double kNaiveRoom = 0.41;   // of the distance to the nearest other primitive: points must not interleave
constexpr double kNaiveRoot = 0.15;   // of a line's vertices

bool onOneLine(const std::vector<Vec3>& points, Vec3& direction) {
  direction = Vec3::Zero();
  for (const Vec3& p : points)
    if (const Vec3 d = p - points[0]; d.squaredNorm() > direction.squaredNorm()) direction = d;
  const double length = direction.norm();
  return length > 0 && std::all_of(points.begin(), points.end(), [&](const Vec3& p) {
    return (p - points[0]).cross(direction).norm() <= 1e-6 * length * length;
  });
}

// Four points around every vertex of a straight skeleton, by the frames of the predictors.
void addStraightFrames(const Skeleton& rest, const Skeleton& posed, const Vec3& direction, WarpPairs& out) {
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
      const Vec3 offset = kStraightOffset * samples.set.samples[j].radius * axis;
      out.rest.push_back(samples.rest[j] + offset);
      out.posed.push_back(samples.posed[j] + samples.rotation[j] * offset);
    }
}

// Unit tangents; where neighbours coincide, that of the vertex before.
std::vector<Vec3> tangents(const Primitive& line) {
  const std::size_t n = line.points.size();
  const auto towards = [&](std::size_t a, std::size_t b) -> Vec3 {
    const Vec3 d = line.points[b] - line.points[a];
    const double length = d.norm();
    return length > 0 ? Vec3(d / length) : Vec3::Zero();
  };
  std::vector<Vec3> t(n, Vec3::Zero());
  for (std::size_t j = 0; j < n; ++j) {
    const Vec3 in = j > 0 ? towards(j - 1, j) : line.closed ? towards(n - 1, 0) : Vec3::Zero();
    const Vec3 out = j + 1 < n ? towards(j, j + 1) : line.closed ? towards(n - 1, 0) : Vec3::Zero();
    const Vec3 sum = in + out;
    if (sum.squaredNorm() > 1e-20) t[j] = sum.normalized();
    else if (j > 0) t[j] = t[j - 1];
  }
  for (std::size_t j = n; j-- > 1;)
    if (t[j - 1].isZero(0)) t[j - 1] = t[j];
  return t;
}

double rollOf(const Primitive& p, std::size_t j) { return p.roll.empty() ? 0 : p.roll[j]; }

// The turn of a line's own best fit.
Quat ownTurn(const Primitive& rest, const Primitive& posed) {
  const auto n = static_cast<double>(rest.points.size());
  Vec3 p = Vec3::Zero(), q = Vec3::Zero();
  for (std::size_t j = 0; j < rest.points.size(); ++j) p += rest.points[j] / n, q += posed.points[j] / n;
  Mat3 c = Mat3::Zero();
  for (std::size_t j = 0; j < rest.points.size(); ++j) c += (rest.points[j] - p) * (posed.points[j] - q).transpose();
  return numeric::kabschQuaternion(c);
}

// Each line by itself: its own best fit, then the smallest rotation of the root's tangent, then parallel transport.
std::vector<Quat> naiveRotations(const Primitive& rest, const Primitive& posed) {
  const std::size_t n = rest.points.size();
  std::vector<Quat> r(n, Quat::Identity());
  if (rest.type == skeleton::PrimitiveType::Points) {
    const Quat turn = posed.rotation.value_or(Quat::Identity()) * rest.rotation.value_or(Quat::Identity()).conjugate();
    std::fill(r.begin(), r.end(), turn);
    return r;
  }
  const std::vector<Vec3> t0 = tangents(rest), t1 = tangents(posed);
  const auto root = static_cast<std::size_t>(kNaiveRoot * static_cast<double>(n - 1));
  const Quat own = ownTurn(rest, posed);
  r[root] = (minimalRotation(own * t0[root], t1[root]) * own).normalized();
  const auto carry = [&](std::size_t from, std::size_t to) {
    r[to] = (minimalRotation(t1[from], t1[to]) * r[from] * minimalRotation(t0[from], t0[to]).conjugate()).normalized();
  };
  for (std::size_t j = root + 1; j < n; ++j) carry(j - 1, j);
  for (std::size_t j = root; j-- > 0;) carry(j + 1, j);
  for (std::size_t j = 0; j < n; ++j)
    if (const double roll = rollOf(posed, j) - rollOf(rest, j); roll != 0)
      r[j] = (Quat(Eigen::AngleAxisd(roll, t1[j])) * r[j]).normalized();
  return r;
}

// The points of a mesh say by themselves how space turns.
bool takesFrames(const Primitive& p) { return p.type != skeleton::PrimitiveType::Mesh; }

// The middle one of the distances from a primitive's vertices to the nearest vertex of another; infinite without another.
double roomAround(const Skeleton& rest, std::size_t i, std::size_t stride) {
  std::vector<double> distances;
  for (std::size_t j = 0; j < rest.primitives[i].points.size(); j += stride) {
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t other = 0; other < rest.primitives.size(); ++other) {
      const std::vector<Vec3>& points = rest.primitives[other].points;
      for (std::size_t k = 0; other != i && k < points.size(); k += stride)
        nearest = std::min(nearest, (points[k] - rest.primitives[i].points[j]).norm());
    }
    distances.push_back(nearest);
  }
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

// Six points around every stride-th vertex of lines and points, along the axes of the world.
void addNaiveFrames(const Skeleton& rest, const Skeleton& posed, std::size_t most, WarpPairs& out) {
  const auto framed = [&](std::size_t stride) {
    std::size_t n = 0;
    for (const Primitive& p : rest.primitives)
      if (takesFrames(p)) n += 6 * ((p.points.size() + stride - 1) / stride);
    return n;
  };
  const std::size_t room = most - std::min(most, out.rest.size());
  std::size_t stride = 1;
  while (framed(stride) > room && stride < most) stride *= 2;
  if (framed(stride) > room) return;
  for (std::size_t i = 0; i < rest.primitives.size(); ++i) {
    const Primitive &p = rest.primitives[i], &q = posed.primitives[i];
    if (!takesFrames(p)) continue;
    const std::vector<Quat> turn = naiveRotations(p, q);
    const double space = kNaiveRoom * roomAround(rest, i, stride);
    for (std::size_t j = 0; j < p.points.size(); j += stride) {
      const double r = p.pointRadius.empty() ? p.radius.value_or(1) : p.pointRadius[j];
      for (int k = 0; k < 6; ++k) {
        const double length = std::min(kNaiveOffset * r, space);
        const Vec3 offset = (k % 2 ? -length : length) * Vec3::Unit(k / 2);
        out.rest.push_back(p.points[j] + offset);
        out.posed.push_back(q.points[j] + turn[j] * offset);
      }
    }
  }
}

}  // namespace

WarpPairs warpPairs(const skeleton::SkeletonPair& pair, FramePoints frames, std::size_t most) {
  Skeleton rest, posed;
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
  if (out.rest.empty()) return out;
  Vec3 direction;
  if (frames == FramePoints::Naive) addNaiveFrames(rest, posed, most, out);
  else if (onOneLine(out.rest, direction)) addStraightFrames(rest, posed, direction, out);
  return out;
}

}  // namespace fielddeform::gffd::detail
