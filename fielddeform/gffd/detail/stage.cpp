#include <fielddeform/core/rigid.h>
#include <fielddeform/gffd/detail/stage.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::gffd::detail {
namespace {

constexpr double kGradientFloor = 0.05;
constexpr double kLongestStep = 0.5;   // radii
constexpr int kHalvings = 8;
constexpr double kRigidTolerance = 1e-12;

bool sameField(const skeleton::Primitive& a, const skeleton::Primitive& b) {
  return a.radius == b.radius && a.pointRadius == b.pointRadius && a.weight == b.weight && a.potential == b.potential &&
         a.closed == b.closed && a.roll == b.roll;
}

}  // namespace

Stage::Stage(const Embedding& embedding, const skeleton::SkeletonPair& pair, const Options& options)
    : options_(options), posed_(std::make_shared<field::Field>(pair.posed, options.field)) {
  radius_ = posed_->referenceRadius();
  tolerance_ = options.tolerance * radius_;
  const MovingPart part = movingPart(pair);
  if (part.rest.primitives.empty()) {
    rigid_ = Rigid{};
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
  if (options.evaluation == Evaluation::Grid && !rigid_) makeGrid(embedding, pair, samples, part.rest);
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
  const LocalMotion motion = motionAt(rest, value.level);
  return rest + (w < 1 ? screwPower(motion, w).translation : motion.translation);
}

double Stage::target(const Vec3& predicted, const Value& value, double w) const {
  const double kept = value.level * radius_;
  return w < 1 ? (1 - w) * posed_->evaluate(predicted).pseudoDistance + w * kept : kept;
}

Tracked Stage::correct(const Vec3& predicted, double target) const {
  Tracked best{predicted, predicted, Status::Stalled, 0};
  field::FieldValue here = posed_->evaluate(predicted);
  double residual = here.pseudoDistance - target;
  best.residual = std::abs(residual);
  if (!std::isfinite(best.residual)) return best;
  // One step is always taken: stepping only beyond the tolerance would turn small differences into visible ones.
  for (int i = 0; options_.corrector && i < options_.maxIterations && (i == 0 || best.residual > tolerance_); ++i) {
    const double slope = std::max(here.gradient.squaredNorm(), kGradientFloor * kGradientFloor);
    Vec3 step = -residual / slope * here.gradient;
    const double length = step.norm(), longest = kLongestStep * radius_;
    if (length > longest) step *= longest / length;
    bool better = false;
    for (int h = 0; h <= kHalvings && !better; ++h, step *= 0.5) {
      const Vec3 next = best.position + step;
      const field::FieldValue there = posed_->evaluate(next);
      const double r = there.pseudoDistance - target;
      if (!(std::abs(r) < best.residual)) continue;
      better = true;
      best.position = next;
      best.residual = std::abs(r);
      residual = r;
      here = there;
    }
    if (!better) break;
  }
  if (best.residual <= tolerance_) best.status = Status::Converged;
  return best;
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
  return correct(predicted, target(predicted, value, w));
}

double Stage::residual(const Vec3& rest, const Value& value, const Vec3& position) const {
  const double w = weight(value);
  const double wanted = w < 1 ? target(predict(rest, value, w), value, w) : value.level * radius_;
  return std::abs(posed_->evaluate(position).pseudoDistance - wanted);
}

}  // namespace fielddeform::gffd::detail
