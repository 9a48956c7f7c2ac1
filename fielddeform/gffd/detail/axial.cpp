#include <fielddeform/gffd/detail/axial.h>
#include <fielddeform/numeric/elementary.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

namespace fielddeform::gffd::detail {
namespace {

// No allocation for the few primitives of usual skeletons.
constexpr std::size_t kFew = 8;

Quat mix(const Quat& a, const Quat& b, double t) {
  Quat q;
  q.coeffs() = (1 - t) * a.coeffs() + (a.dot(b) < 0 ? -t : t) * b.coeffs();
  const double n = q.norm();
  if (!(n > 0)) return a;
  q.coeffs() /= n;
  return q;
}

}  // namespace

AxialPredictor::AxialPredictor(std::shared_ptr<const field::Field> field, const skeleton::SampledPair& samples)
    : field_(std::move(field)), set_(samples.set) {
  frames_.resize(samples.rest.size());
  for (std::size_t j = 0; j < frames_.size(); ++j)
    frames_[j] = {samples.rest[j], samples.posed[j] - samples.rest[j], samples.rotation[j], samples.scale[j]};
}

AxialPredictor::Frame AxialPredictor::frameAt(std::size_t primitive, const field::PrimitiveHit& hit) const {
  const auto& chain = set_.chain[primitive];
  if (!chain.empty()) {
    // A segment of a polyline is sampled in equal pieces.
    const auto& start = set_.segmentStart[primitive];
    if (hit.vertex[1] == kNoIndex || start.size() < 2) return frames_[set_.vertexSample[primitive][hit.vertex[0]]];
    const Index begin = start[hit.element], count = start[hit.element + 1] - begin;
    const double along = hit.weight[1] * count;
    const Index piece = std::min<Index>(count - 1, static_cast<Index>(std::max(along, 0.0)));
    const double t = along - piece;
    const Frame &a = frames_[chain[begin + piece]], &b = frames_[chain[(begin + piece + 1) % chain.size()]];
    return {a.rest + t * (b.rest - a.rest), a.move + t * (b.move - a.move), mix(a.rotation, b.rotation, t),
            a.scale + t * (b.scale - a.scale)};
  }
  const auto& at = set_.vertexSample[primitive];
  Frame f = frames_[at[hit.vertex[0]]];
  if (hit.vertex[1] == kNoIndex) return f;
  Eigen::Vector4d q = Eigen::Vector4d::Zero();
  const Quat first = f.rotation;
  f.rest.setZero();
  f.move.setZero();
  f.scale = 0;
  for (int k = 0; k < 3; ++k) {
    if (hit.vertex[k] == kNoIndex) continue;
    const Frame& v = frames_[at[hit.vertex[k]]];
    f.rest += hit.weight[k] * v.rest;
    f.move += hit.weight[k] * v.move;
    f.scale += hit.weight[k] * v.scale;
    q += (v.rotation.dot(first) < 0 ? -hit.weight[k] : hit.weight[k]) * v.rotation.coeffs();
  }
  if (q.norm() > 0) f.rotation.coeffs() = q / q.norm();
  return f;
}

double AxialPredictor::nearness(const Vec3& point) const {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < field_->primitiveCount(); ++i) {
    const field::PrimitiveHit hit = field_->closest(i, point);
    nearest = std::min(nearest, std::abs(hit.distance) / field_->radiusAt(i, hit));
  }
  return nearest;
}

LocalMotion AxialPredictor::at(const Vec3& point) const { return at(point, {}); }

LocalMotion AxialPredictor::at(const Vec3& point, std::span<const field::Foot> feet) const {
  const std::size_t n = field_->primitiveCount();
  std::array<field::PrimitiveHit, kFew> few;
  std::vector<field::PrimitiveHit> many(n > kFew ? n : 0);
  field::PrimitiveHit* hits = n > kFew ? many.data() : few.data();
  for (std::size_t i = 0; i < n; ++i) hits[i] = feet.empty() ? field_->closest(i, point) : field_->closestAt(i, point, feet[i]);
  return from(point, hits, 1);
}

void AxialPredictor::at(Points points, std::span<LocalMotion> out, Searches& searches) const {
  const std::size_t n = field_->primitiveCount();
  searches.hits.resize(n * points.size());
  for (std::size_t i = 0; i < n; ++i)
    field_->closestTogether(i, points, std::span(searches.hits).subspan(i * points.size(), points.size()), searches.hints);
  for (std::size_t k = 0; k < points.size(); ++k) out[k] = from(points[k], searches.hits.data() + k, points.size());
}

LocalMotion AxialPredictor::from(const Vec3& point, const field::PrimitiveHit* hits, std::size_t stride) const {
  const std::size_t n = field_->primitiveCount();
  const auto motion = [&](const Frame& f) {
    const Vec3 back = f.rest - point;
    return LocalMotion{f.rotation, f.move - (f.scale * (f.rotation * back) - back)};
  };
  if (n == 1) return motion(frameAt(0, hits[0]));
  std::array<LocalMotion, kFew> fewMotions;
  std::array<double, kFew> fewWeights;
  std::vector<LocalMotion> manyMotions(n > kFew ? n : 0);
  std::vector<double> manyWeights(n > kFew ? n : 0);
  const std::span<LocalMotion> motions(n > kFew ? manyMotions.data() : fewMotions.data(), n);
  const std::span<double> weights(n > kFew ? manyWeights.data() : fewWeights.data(), n);
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < n; ++i) {
    const field::PrimitiveHit& hit = hits[i * stride];
    weights[i] = hit.distance / field_->radiusAt(i, hit);
    nearest = std::min(nearest, weights[i]);
    motions[i] = motion(frameAt(i, hit));
  }
  for (double& w : weights) w = numeric::exp(-4 * (w - nearest));
  return blend(motions, weights);
}

}  // namespace fielddeform::gffd::detail
