#include <fielddeform/core/parallel.h>
#include <fielddeform/gffd/detail/binding.h>
#include <fielddeform/gffd/detail/block_tracker.h>
#include <fielddeform/gffd/detail/grid_tracker.h>
#include <fielddeform/gffd/detail/lines_field.h>
#include <fielddeform/gffd/detail/paper.h>
#include <fielddeform/gffd/detail/stage.h>
#include <fielddeform/gffd/gffd_map.h>
#include <fielddeform/map/rbf_warp.h>
#include <fielddeform/skeleton/interpolate.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace fielddeform::gffd {

using detail::Embedding;
using detail::GffdBinding;
using detail::Stage;
using detail::Tracked;
using detail::Value;

namespace {

constexpr std::size_t kGrain = 256;
constexpr int kPaperIterations = 10;       // times Options::maxIterations
constexpr std::size_t kWarpCentres = 2000;  // of skeletons: a dense solve
constexpr std::size_t kMostPairs = 100000;  // given by the user

/// Residuals of points that keep their whole level, by blocks where the field allows: they do not depend on the way there.
class LevelResiduals {
 public:
  LevelResiduals(const detail::Stage& stage, Points position, std::span<float> out) : stage_(stage), position_(position), out_(out) {}

  /// @return false if it is to be measured singly
  bool take(std::size_t k, const detail::Value& value) {
    if (!stage_.lines() || stage_.weight(value) < 1 || !position_[k].allFinite()) return false;
    block_.x[count_] = position_[k].x(), block_.y[count_] = position_[k].y(), block_.z[count_] = position_[k].z();
    wanted_[count_] = value.level * stage_.radius();
    slot_[count_] = k;
    if (++count_ == detail::kLanes) finish();
    return true;
  }
  void finish() {
    if (count_ == 0) return;
    stage_.lines()->evaluate(block_, count_, values_);
    for (std::size_t j = 0; j < count_; ++j) out_[slot_[j]] = static_cast<float>(std::abs(values_.value[j] - wanted_[j]));
    count_ = 0;
  }

 private:
  const detail::Stage& stage_;
  Points position_;
  std::span<float> out_;
  std::size_t count_ = 0;
  detail::Block block_;
  detail::LineValues values_;
  std::array<double, detail::kLanes> wanted_;
  std::array<std::size_t, detail::kLanes> slot_;
};

bool asPrinted(Predictor p) { return p == Predictor::Gradient || p == Predictor::Warp; }

// A pose on the way stands in the posed skeleton's order.
skeleton::SkeletonPair stepOf(const skeleton::SkeletonPair& pair, int i, skeleton::Skeleton from, skeleton::Skeleton to) {
  skeleton::SkeletonPair step{std::move(from), std::move(to), pair.pairs};
  for (auto& p : step.pairs)
    if (i > 1) p.rest = p.posed;
  return step;
}

// Where only closest points are asked for.
field::FieldOptions exactly(field::FieldOptions options) {
  options.distance = {};
  return options;
}

bool allMatched(const skeleton::SkeletonPair& pair) {
  for (const auto& p : pair.pairs)
    if (p.kind != skeleton::PairKind::Matched) return false;
  return true;
}

}  // namespace

struct GffdMap::Impl {
  ResolvedOptions resolved;
  std::shared_ptr<const Embedding> embedding;
  std::vector<std::shared_ptr<const Stage>> stages;
  std::shared_ptr<const map::RbfWarp> warp;
  bool identity = false;

  // `taken`: megabytes of the grids of maps that live on beside this one.
  Impl(ResolvedOptions r, std::shared_ptr<const Embedding> e, double taken = 0) : resolved(std::move(r)), embedding(std::move(e)) {
    const Options& options = resolved.options;
    const auto& pair = resolved.skeletons;
    // Poses on the way exist only where every primitive has its correspondence.
    const int steps = allMatched(pair) && !asPrinted(options.predictor) ? options.substeps : 1;
    std::shared_ptr<const Embedding> from = embedding;
    std::optional<detail::Around> around = following();
    Options stageOptions = options;
    stageOptions.field = options.field.after(*embedding->field);
    stageOptions.field.distance.grid.takenMegabytes += taken;
    if (embedding->moving && embedding->moving != embedding->field) stageOptions.field = stageOptions.field.after(*embedding->moving);
    skeleton::Skeleton last = pair.rest;
    for (int i = 1; i <= steps; ++i) {
      skeleton::Skeleton next = i == steps ? pair.posed
                                           : skeleton::interpolatePose(pair, static_cast<double>(i) / steps);
      const skeleton::SkeletonPair step = stepOf(pair, i, last, next);
      if (i > 1) from = detail::makeEmbedding(step, exactly(options.field));
      stages.push_back(std::make_shared<const Stage>(*from, step, stageOptions, around ? &*around : nullptr));
      stageOptions.field = stageOptions.field.after(stages.back()->posedField());
      last = std::move(next);
    }
    identity = steps == 1 && stages[0]->rigid() && stages[0]->rigid()->translation.isZero(0) &&
               stages[0]->rigid()->rotation.isApprox(Quat::Identity(), 0) && unedited();
    if (options.predictor == Predictor::Warp && !identity) makeWarp();
  }

  // The mesh's movable vertices with their values, where grids follow them.
  std::optional<detail::Around> following() const {
    if (!resolved.around || asPrinted(resolved.options.predictor)) return std::nullopt;
    const std::vector<Vec3>& all = *resolved.around;
    std::vector<Value> values(all.size());
    parallelFor(all.size(), kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        values[i] = all[i].allFinite() ? detail::bindOne(*embedding, all[i]) : Value{std::nan(""), 0};
    });
    detail::Around a;
    for (std::size_t i = 0; i < all.size(); ++i)
      if (!std::isnan(values[i].level)) a.points.push_back(all[i]), a.values.push_back(values[i]);
    return a;
  }

  // The rigid motion of an empty moving part is the identity too, but its field changed.
  bool unedited() const { return allMatched(resolved.skeletons); }

  void makeWarp() {
    // Eq (5) by itself is to carry a rigid edit exactly; the naive frames belong to Fig. 5.
    const auto frames = resolved.options.corrector ? detail::FramePoints::Naive : detail::FramePoints::Straight;
    const auto& given = resolved.options.warpPairs;
    detail::WarpPairs pairs;
    if (given.empty()) pairs = detail::warpPairs(resolved.skeletons, frames, kWarpCentres);
    for (const auto& [rest, posed] : given) pairs.rest.push_back(rest), pairs.posed.push_back(posed);
    if (pairs.rest.empty())
      throw std::invalid_argument("track is 'warp', but no primitive has corresponding points; expected at least one pair");
    if (pairs.rest.size() > kMostPairs)
      throw std::invalid_argument(fmt::format("track is 'warp' with {} corresponding points, expected at most {}",
                                              pairs.rest.size(), kMostPairs));
    warp = std::make_shared<const map::RbfWarp>(pairs.rest, pairs.posed);
  }

  Tracked track(const Vec3& rest, const Value& value) const {
    const Options& o = resolved.options;
    if (asPrinted(o.predictor)) return trackPrinted(rest, value);
    Tracked t{rest, rest, Status::Converged, 0};
    for (const auto& stage : stages) t = stage->track(t.position, value);
    return t;
  }

  Tracked trackPrinted(const Vec3& rest, const Value& value) const {
    const Options& o = resolved.options;
    const field::Field& posed = stages.back()->posedField();
    const double target = value.level * posed.referenceRadius(), tolerance = o.tolerance * posed.referenceRadius();
    const auto warped = [&](const Vec3& p) -> Vec3 { return warp->position(p); };
    if (!o.corrector) {  // eq (5) alone
      const Vec3 p = warp ? warped(rest) : rest;
      const double r = std::abs(posed.evaluate(p).pseudoDistance - target);
      return {p, p, r < tolerance ? Status::Converged : Status::Stalled, r};
    }
    // Eq (6): the direction is that of the vertex and its warped position, the same all the way.
    Vec3 along = warp ? Vec3(warped(rest) - rest) : Vec3::Zero();
    if (const double l = along.norm(); l > 0) along /= l;
    const auto direction = [&](const Vec3& p) -> Vec3 { return warp ? along : detail::gradientDirection(posed, p); };
    return detail::trackAsPrinted(posed, direction, rest, target, tolerance, kPaperIterations * o.maxIterations);
  }
};

namespace {

const GffdBinding& own(const map::Binding& binding, const Embedding& embedding) {
  const auto* b = dynamic_cast<const GffdBinding*>(&binding);
  if (!b || b->embedding.get() != &embedding)
    throw std::invalid_argument("the binding was made by another map, expected one of this map or a re-pose of it");
  return *b;
}

template <class T>
void checkSize(const char* name, std::span<T> span, std::size_t n, bool optional = true) {
  if (span.size() != n && !(optional && span.empty()))
    throw std::invalid_argument(fmt::format("{} has {} elements, expected {}", name, span.size(), n));
}

}  // namespace

GffdMap::GffdMap(ResolvedOptions resolved) {
  resolved.options.validate();
  if (resolved.options.predictor == Predictor::Auto || resolved.options.falloff == Falloff::Auto)
    throw std::invalid_argument("options still hold 'auto', expected the result of gffd::resolve");
  if (resolved.options.evaluation == Evaluation::Auto) resolved.options.evaluation = Evaluation::Exact;
  if (!resolved.embedding) resolved.embedding = detail::makeEmbedding(resolved.skeletons, resolved.options.field);
  auto embedding = resolved.embedding;
  impl_ = std::make_shared<const Impl>(std::move(resolved), std::move(embedding));
}
GffdMap::GffdMap(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}
GffdMap::~GffdMap() = default;
GffdMap::GffdMap(const GffdMap&) = default;
GffdMap& GffdMap::operator=(const GffdMap&) = default;

const ResolvedOptions& GffdMap::resolved() const noexcept { return impl_->resolved; }
bool GffdMap::isIdentity() const noexcept { return impl_->identity; }

std::shared_ptr<const map::Binding> GffdMap::bind(Points rest) const {
  auto binding = detail::bindPoints(impl_->embedding, rest);
  if (usesGrid()) binding->cells();
  return binding;
}

std::shared_ptr<const map::Binding> GffdMap::bindMidpoints(const map::Binding& binding, Points rest,
                                                           std::span<const std::array<Index, 2>> ends) const {
  const GffdBinding& b = own(binding, *impl_->embedding);
  std::vector<Vec3> middle(ends.size());
  for (std::size_t i = 0; i < ends.size(); ++i) middle[i] = 0.5 * (rest[ends[i][0]] + rest[ends[i][1]]);
  auto out = detail::bindPoints(impl_->embedding, middle);
  if (impl_->resolved.options.midpointValue == MidpointValue::Mean) {
    for (std::size_t i = 0; i < ends.size(); ++i) {
      const double mean = 0.5 * (b.level[ends[i][0]] + b.level[ends[i][1]]);
      if (std::isfinite(mean)) out->level[i] = mean;
    }
  }
  return out;
}

bool GffdMap::midpointsInherit() const { return impl_->resolved.options.midpointValue == MidpointValue::Mean; }

void GffdMap::apply(const map::Binding& binding, map::MapOutput out, Progress& progress) const {
  applyCounted(binding, out, progress);
}

EvaluationCounts GffdMap::applyCounted(const map::Binding& binding, map::MapOutput out, Progress& progress) const {
  const GffdBinding& b = own(binding, *impl_->embedding);
  const std::size_t n = b.size();
  checkSize("position", out.position, n);
  checkSize("safe", out.safe, n);
  checkSize("status", out.status, n);
  checkSize("residual", out.residual, n);
  const Impl& impl = *impl_;
  const Stage& stage = *impl.stages[0];
  const bool grid = usesGrid(), blocks = !grid && !impl.identity && impl.stages.size() == 1 && impl.embedding->cells && stage.axial();
  EvaluationCounts counts;
  if (grid) counts = detail::trackByGrid(stage, b, out, progress);
  else if (!impl.identity) counts.exact = countMovable(b);
  if (blocks) detail::trackByBlocks(stage, b, out, progress);
  const bool tracked = grid || blocks;
  if (tracked && b.cells().order.size() == n) return counts;
  parallelFor(n, kGrain, progress, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Tracked t{b.rest[i], b.rest[i], Status::Fixed, 0};
      if (!b.rest[i].allFinite()) t.status = Status::Invalid;
      else if (tracked && b.movable(i)) continue;
      else if (b.movable(i) && !impl.identity) t = impl.track(b.rest[i], b.value(i));
      if (!out.position.empty()) out.position[i] = t.position;
      if (!out.safe.empty()) out.safe[i] = t.safe;
      if (!out.status.empty()) out.status[i] = t.status;
      if (!out.residual.empty()) out.residual[i] = static_cast<float>(t.residual);
    }
  });
  return counts;
}

void GffdMap::jacobians(const map::Binding& binding, std::span<Mat3> out) const {
  const GffdBinding& b = own(binding, *impl_->embedding);
  checkSize("out", out, b.size(), false);
  const double h = 1e-5 * impl_->embedding->radius;
  const Impl& impl = *impl_;
  parallelFor(b.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      out[i].setIdentity();
      if (!b.rest[i].allFinite() || !b.movable(i) || impl.identity) continue;
      for (int k = 0; k < 3; ++k) {
        const Vec3 forward = b.rest[i] + h * Vec3::Unit(k), backward = b.rest[i] - h * Vec3::Unit(k);
        const Vec3 f = impl.track(forward, detail::bindOne(*impl.embedding, forward)).position;
        const Vec3 g = impl.track(backward, detail::bindOne(*impl.embedding, backward)).position;
        out[i].col(k) = (f - g) / (forward - backward).sum();
      }
    }
  });
}

void GffdMap::residuals(const map::Binding& binding, std::span<const Index> points, Points position,
                        std::span<float> out) const {
  const GffdBinding& b = own(binding, *impl_->embedding);
  checkSize("position", position, points.size(), false);
  checkSize("out", out, points.size(), false);
  const Impl& impl = *impl_;
  if (impl.identity) return std::fill(out.begin(), out.end(), 0.0f);
  parallelFor(points.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    LevelResiduals whole(*impl.stages.back(), position, out);
    for (std::size_t k = begin; k < end; ++k) {
      const Index i = points[k];
      out[k] = 0;
      if (!b.rest[i].allFinite() || !b.movable(i)) continue;
      if (whole.take(k, b.value(i))) continue;
      Vec3 start = b.rest[i];
      for (std::size_t s = 0; s + 1 < impl.stages.size(); ++s) start = impl.stages[s]->track(start, b.value(i)).position;
      out[k] = static_cast<float>(impl.stages.back()->residual(start, b.value(i), position[k]));
    }
    whole.finish();
  });
}

GffdMap GffdMap::withPose(skeleton::Skeleton posed) const {
  ResolvedOptions resolved = impl_->resolved;
  const auto& rest = resolved.skeletons.rest;
  for (auto& p : posed.primitives)
    if (const auto* r = rest.find(p.name); r && !p.radius && p.pointRadius.empty()) p.radius = r->radius;
  resolved.skeletons = skeleton::pairSkeletons(rest, std::move(posed));
  if (detail::movingPart(resolved.skeletons).restIndex != impl_->embedding->movingIndex)
    throw std::invalid_argument("the pose removes other primitives than the map's own pose, expected a new map");
  resolved.embedding = impl_->embedding;
  return GffdMap(std::make_shared<const Impl>(std::move(resolved), impl_->embedding, posedMegabytes()));
}

GffdMap GffdMap::withSubsteps(int substeps, double takenMegabytes) const {
  ResolvedOptions resolved = impl_->resolved;
  resolved.options.substeps = substeps;
  resolved.options.validate();
  return GffdMap(std::make_shared<const Impl>(std::move(resolved), impl_->embedding, posedMegabytes() + takenMegabytes));
}

GffdMap GffdMap::withPredictor(Predictor predictor, double takenMegabytes) const {
  if (predictor == Predictor::Auto) throw std::invalid_argument("predictor is 'auto', expected a resolved one");
  ResolvedOptions resolved = impl_->resolved;
  resolved.options.predictor = predictor;
  return GffdMap(std::make_shared<const Impl>(std::move(resolved), impl_->embedding, posedMegabytes() + takenMegabytes));
}

double GffdMap::posedMegabytes() const noexcept {
  double sum = 0;
  for (const auto& stage : impl_->stages) sum += stage->posedField().gridMegabytes();
  return sum;
}

std::vector<NamedDistance> GffdMap::distanceReports() const {
  std::vector<NamedDistance> out;
  const auto add = [&](const std::string& pose, const field::Field& f, const skeleton::Skeleton& s) {
    if (f.blendReport()) out.push_back({pose, {}, *f.blendReport()});
    for (std::size_t i = 0; i < f.primitiveCount(); ++i)
      if (f.distanceReport(i).kind != field::Distance::Exact) out.push_back({pose, s.primitives[i].name, f.distanceReport(i)});
  };
  const auto& pair = impl_->resolved.skeletons;
  const Embedding& e = *impl_->embedding;
  add("rest", *e.field, pair.rest);
  if (e.moving && e.moving != e.field) add("rest, moving part", *e.moving, detail::movingPart(pair).rest);
  const std::size_t n = impl_->stages.size();
  // Poses on the way stand in the posed skeleton's order.
  for (std::size_t i = 0; i < n; ++i)
    add(i + 1 == n ? "posed" : fmt::format("posed {}/{}", i + 1, n), impl_->stages[i]->posedField(), pair.posed);
  return out;
}

std::size_t GffdMap::countPierced(const map::Binding& binding) const {
  const GffdBinding& b = own(binding, *impl_->embedding);
  if (impl_->identity) return 0;
  const field::Field& posed = impl_->stages.back()->posedField();
  return deterministicReduce(
      b.size(), kGrain, std::size_t{0},
      [&](std::size_t begin, std::size_t end) {
        std::size_t count = 0;
        for (std::size_t i = begin; i < end; ++i)
          if (b.rest[i].allFinite() && !b.movable(i)) count += posed.evaluate(b.rest[i]).inside;
        return count;
      },
      [](std::size_t x, std::size_t y) { return x + y; });
}

bool GffdMap::usesGrid() const noexcept { return impl_->stages.size() == 1 && impl_->stages[0]->grid(); }

bool GffdMap::hasFalloff() const noexcept { return impl_->stages.front()->hasFalloff(); }

std::vector<double> GffdMap::falloffWeights(const map::Binding& binding) const {
  const GffdBinding& b = own(binding, *impl_->embedding);
  std::vector<double> out;
  if (!hasFalloff()) return out;
  out.resize(b.size(), 0);
  for (std::size_t i = 0; i < out.size(); ++i)
    if (b.rest[i].allFinite() && b.movable(i)) out[i] = impl_->stages.front()->weight(b.value(i));
  return out;
}

std::size_t GffdMap::countMovable(const map::Binding& binding) const {
  const GffdBinding& b = own(binding, *impl_->embedding);
  std::size_t count = 0;
  for (std::size_t i = 0; i < b.size(); ++i) count += b.movable(i);
  return count;
}

}  // namespace fielddeform::gffd
