#include <fielddeform/core/rigid.h>
#include <fielddeform/map/skeleton_motion.h>
#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

namespace fielddeform::map {
namespace {

using skeleton::Primitive;
using skeleton::PrimitiveType;

double radiusAt(const Primitive& p, const skeleton::Sample& sample) {
  double radius = 0;
  for (int k = 0; k < 3; ++k)
    if (sample.vertex[k] != kNoIndex) radius += sample.weight[k] * skeleton::radiusOf(p, sample.vertex[k]);
  return radius;
}

bool sameRadii(const Primitive& a, const Primitive& b) {
  for (Index v = 0; v < a.points.size(); ++v)
    if (skeleton::radiusOf(a, v) != skeleton::radiusOf(b, v)) return false;
  return true;
}

bool sameRoll(const Primitive& a, const Primitive& b) {
  for (std::size_t v = 0; v < a.points.size(); ++v)
    if ((a.roll.empty() ? 0 : a.roll[v]) != (b.roll.empty() ? 0 : b.roll[v])) return false;
  return true;
}

bool sameMotion(const Primitive& a, const Primitive& b) {
  const Quat ra = a.rotation.value_or(Quat::Identity()), rb = b.rotation.value_or(Quat::Identity());
  return a.points == b.points && ra.coeffs() == rb.coeffs() && sameRoll(a, b) && sameRadii(a, b);
}

// Unit tangent of a line at a point; zero where its neighbours coincide.
Vec3 tangentAt(const Primitive& line, std::size_t v) {
  const std::size_t n = line.points.size();
  const std::size_t before = v > 0 ? v - 1 : line.closed ? n - 1 : 0, after = v + 1 < n ? v + 1 : line.closed ? 0 : n - 1;
  const Vec3 d = line.points[after] - line.points[before];
  const double length = d.norm();
  return length > 0 ? Vec3(d / length) : Vec3::Zero();
}

std::size_t framesOf(PrimitiveType type) {
  return type == PrimitiveType::Mesh ? 0 : type == PrimitiveType::Points ? 6 : 4;
}

}  // namespace

SkeletonMotion motionOf(const skeleton::SkeletonPair& pair, std::string_view method) {
  SkeletonMotion m;
  for (const auto& p : pair.pairs) {
    if (p.kind != skeleton::PairKind::Matched) {
      const Primitive& one = p.rest != kNoIndex ? pair.rest.primitives[p.rest] : pair.posed.primitives[p.posed];
      throw std::invalid_argument(fmt::format("method '{}': primitive '{}' was {}, expected one with the same points at rest and posed "
                                              "(gffd does without)", method, one.name, skeleton::toString(p.kind)));
    }
    m.rest.primitives.push_back(pair.rest.primitives[p.rest]);
    m.posed.primitives.push_back(pair.posed.primitives[p.posed]);
  }
  if (m.rest.primitives.empty()) throw std::invalid_argument("the rest skeleton has no primitives, expected at least one");
  m.unedited = true;
  for (std::size_t i = 0; i < m.rest.primitives.size(); ++i) {
    const Primitive& p = m.posed.primitives[i];
    if (!p.radius && p.pointRadius.empty())
      throw std::invalid_argument(fmt::format("method '{}': primitive '{}' has no radius", method, p.name));
    m.unedited = m.unedited && sameMotion(m.rest.primitives[i], p);
  }
  skeleton::SampledPair& s = m.samples;
  s.set = skeleton::sampleSkeleton(m.rest);
  for (std::size_t j = 0; j < s.set.samples.size(); ++j) {
    const skeleton::Sample& sample = s.set.samples[j];
    s.rest.push_back(s.set.position(m.rest, j));
    s.posed.push_back(s.set.position(m.posed, j));
    s.scale.push_back(radiusAt(m.posed.primitives[sample.primitive], sample) / sample.radius);
  }
  skeleton::fitFrames(s, m.rest, m.posed);
  return m;
}

PointPairs pointPairs(const SkeletonMotion& motion, const PairOptions& options) {
  std::size_t all = 0;
  for (const Primitive& p : motion.rest.primitives)
    all += p.points.size() * (1 + static_cast<std::size_t>(options.rings) * framesOf(p.type));
  const std::size_t stride = std::max<std::size_t>(1, (all + options.most - 1) / std::max<std::size_t>(options.most, 1));
  PointPairs out;
  const auto forEach = [&](auto&& call) {
    std::size_t n = 0;
    for (std::size_t i = 0; i < motion.rest.primitives.size(); ++i)
      for (std::size_t v = 0; v < motion.rest.primitives[i].points.size(); ++v)
        if (n++ % stride == 0) call(i, v, motion.samples.set.vertexSample[i][v]);
  };
  forEach([&](std::size_t i, std::size_t v, Index) {
    out.rest.push_back(motion.rest.primitives[i].points[v]);
    out.posed.push_back(motion.posed.primitives[i].points[v]);
  });
  out.own = out.rest.size();
  forEach([&](std::size_t i, std::size_t v, Index sample) {
    const Primitive& p = motion.rest.primitives[i];
    std::vector<Vec3> axes;
    if (p.type == PrimitiveType::Polyline) {
      const Vec3 t = tangentAt(p, v), u = anyPerpendicular(t);
      axes = {u, t.cross(u).isZero(0) ? Vec3(Vec3::UnitY()) : Vec3(t.cross(u))};
    } else if (p.type == PrimitiveType::Points) {
      axes = {Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ()};
    }
    const double step = options.offset * skeleton::radiusOf(p, static_cast<Index>(v)) / options.rings;
    for (const Vec3& axis : axes)
      for (int k = 0; k < 2 * options.rings; ++k) {
        const Vec3 across = (k % 2 ? -1 : 1) * (k / 2 + 1) * step * axis;
        out.rest.push_back(p.points[v] + across);
        out.posed.push_back(motion.posed.primitives[i].points[v] +
                            motion.samples.scale[sample] * (motion.samples.rotation[sample] * across));
      }
  });
  return out;
}

}  // namespace fielddeform::map
