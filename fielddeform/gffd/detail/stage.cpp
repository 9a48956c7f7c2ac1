#include <fielddeform/core/parallel.h>
#include <fielddeform/core/rigid.h>
#include <fielddeform/gffd/detail/stage.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::gffd::detail {
namespace {

constexpr double kLongestStep = 0.5;   // radii
constexpr double kRigidTolerance = 1e-12;

bool sameField(const skeleton::Primitive& a, const skeleton::Primitive& b) {
  return a.radius == b.radius && a.pointRadius == b.pointRadius && a.weight == b.weight && a.potential == b.potential &&
         a.closed == b.closed && a.roll == b.roll;
}

}  // namespace

Stage::Stage(const Embedding& embedding, const skeleton::SkeletonPair& pair, const Options& options, Around* around)
    : options_(options) {
  // The predictors need closest points only; the posed field's grids follow their predictions.
  field::FieldOptions bare = options.field;
  if (around) bare.distance = {};
  posed_ = std::make_shared<field::Field>(pair.posed, bare);
  radius_ = posed_->referenceRadius();
  tolerance_ = options.tolerance * radius_;
  const MovingPart part = movingPart(pair);
  if (part.rest.primitives.empty()) {
    rigid_ = Rigid{};
    samplePosed(pair.posed, around);
    return;
  }
  const skeleton::SampledPair samples = sampleMotion(part, pair.posed, *posed_);
  mls_.emplace(samples);
  axial_.emplace(embedding.moving, samples);
  findRigid(samples, part, pair);
  levelBoundsNearness_ = options.field.potential == skeleton::Potential::Exponential;
  for (const auto& p : part.rest.primitives)
    levelBoundsNearness_ = levelBoundsNearness_ && p.weight >= 1 &&
                           p.potential.value_or(options.field.potential) == skeleton::Potential::Exponential;
  samplePosed(pair.posed, around);
  if (options.evaluation == Evaluation::Grid && !rigid_) makeGrid(embedding, pair, samples, part.rest);
}

void Stage::samplePosed(const skeleton::Skeleton& posed, Around* around) {
  if (!around) return;
  std::vector<Vec3>& points = around->points;
  parallelFor(points.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) points[i] = predict(points[i], around->values[i], weight(around->values[i]));
  });
  posed_ = std::make_shared<field::Field>(posed, options_.field, points);
}

void Stage::makeGrid(const Embedding& embedding, const skeleton::SkeletonPair& pair, const skeleton::SampledPair& samples,
                     const skeleton::Skeleton& rest) {
  const bool interpolates = options_.predictor == Predictor::Mls || options_.predictor == Predictor::Axial;
  if (!embedding.cells || !interpolates || options_.substeps != 1) return;
  axialLines_ = AxialLines::of(rest, samples);
  const auto displacements = [this](const Block& points, std::size_t count, Block& out) {
    // At a node nothing is known of the field's value: the distance to the skeleton is always asked for.
    double unknown[kLanes];
    std::fill_n(unknown, count, -1.0);
    displacementsAt(points, count, unknown, nullptr, out);
  };
  const auto nearness = [this](const Block& points, std::size_t count, double* out) { nearnessAt(points, count, out); };
  grid_ = std::make_unique<const DisplacementGrid>(
      *embedding.cells,
      DisplacementGrid::Source{.displacements = displacements, .nearness = nearness, .tolerance = tolerance_});
  lines_ = LinesField::of(pair.posed, options_.field, radius_);
}

void Stage::findRigid(const skeleton::SampledPair& samples, const MovingPart& part, const skeleton::SkeletonPair& pair) {
  // Primitives added or removed change the field; so does any edited radius, weight or potential.
  if (pair.posed.primitives.size() != part.kind.size() || pair.rest.primitives.size() != part.kind.size()) return;
  // The points themselves: samples within a mesh's triangles carry rounding.
  bool still = true;
  for (std::size_t i = 0; i < part.kind.size(); ++i) {
    const auto &from = part.rest.primitives[i], &to = pair.posed.primitives[part.posedIndex[i]];
    still = still && from.points == to.points;
    if (part.kind[i] != skeleton::PairKind::Matched || !sameField(from, to)) return;
    if (to.rotation && !(from.rotation && from.rotation->coeffs() == to.rotation->coeffs())) return;
  }
  Vec3 p = Vec3::Zero(), q = Vec3::Zero();
  Box box;
  const std::size_t n = samples.rest.size();
  for (std::size_t j = 0; j < n; ++j) {
    p += samples.rest[j] / static_cast<double>(n);
    q += samples.posed[j] / static_cast<double>(n);
    box.extend(samples.rest[j]);
  }
  if (still) {
    rigid_ = Rigid{};
    return;
  }
  const Rigid motion{samples.global, q - samples.global * p};
  const double size = std::max(box.diagonal().norm(), radius_);
  // Coordinates far from the origin carry their own rounding.
  const double rounding = 4e-16 * (box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).norm() + q.norm());
  for (std::size_t j = 0; j < n; ++j)
    if ((samples.posed[j] - motion(samples.rest[j])).norm() > kRigidTolerance * size + rounding) return;
  rigid_ = motion;
}

double Stage::weight(const Value& value) const {
  if (!hasFalloff()) return 1;
  return smoothstep(value.share / options_.falloffBand);
}

LocalMotion Stage::motionAt(const Vec3& point, double level) const {
  if (rigid_) return {rigid_->rotation, (*rigid_)(point) - point};
  if (options_.predictor == Predictor::Axial) return axial_->at(point);
  const LocalMotion mls = mls_->at(point);
  // With weights >= 1 every primitive's E is at most S, so D / R is at most the nearest |d_i| / r_i.
  if (levelBoundsNearness_ && level >= kNear) return mls;
  const double near = axial_->nearness(point);
  return near < kNear ? blend(axial_->at(point), mls, smoothstep(near / kNear)) : mls;
}

Vec3 Stage::predict(const Vec3& rest, const Value& value, double w) const {
  if (w <= 0) return rest;
  return rest + part(motionAt(rest, value.level), w);
}

Vec3 Stage::part(const LocalMotion& motion, double weight) {
  return weight < 1 ? screwPower(motion, weight).translation : motion.translation;
}

Correction Stage::correction(const Vec3& predicted, const field::FieldValue& here, const Value& value, double w) const {
  const double kept = value.level * radius_;
  return {predicted, here, w < 1 ? (1 - w) * here.pseudoDistance + w * kept : kept,
          {tolerance_, kLongestStep * radius_, options_.corrector ? options_.maxIterations : 0}};
}

Tracked Stage::track(const Vec3& rest, const Value& value) const {
  const double w = weight(value);
  const Vec3 predicted = predict(rest, value, w);
  if (!predicted.allFinite()) return {rest, rest, Status::Stalled, 0};
  if (rigid_ && w >= 1) {
    const double r = std::abs(posed_->evaluate(predicted).pseudoDistance - value.level * radius_);
    // The value goes along with a rigid motion; what a fitted or sampled distance says of it differs by its own error.
    const bool met = r <= tolerance_ || options_.field.distance.kind != field::Distance::Exact;
    return {predicted, predicted, met ? Status::Converged : Status::Stalled, r};
  }
  return settle(predicted, value, w);
}

Tracked Stage::settle(const Vec3& predicted, const Value& value, double w) const {
  Correction c = correction(predicted, posed_->evaluate(predicted), value, w);
  while (c.open()) {
    const Vec3 next = c.next();
    c.take(next, posed_->evaluate(next));
  }
  return c.result();
}

double Stage::residual(const Vec3& rest, const Value& value, const Vec3& position) const {
  const double w = weight(value);
  double wanted = value.level * radius_;
  if (w < 1) wanted = (1 - w) * posed_->evaluate(predict(rest, value, w)).pseudoDistance + w * wanted;
  return std::abs(posed_->evaluate(position).pseudoDistance - wanted);
}

}  // namespace fielddeform::gffd::detail
