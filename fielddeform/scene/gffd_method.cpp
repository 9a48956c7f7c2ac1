// A scene by skeleton: GFFD as a method of scene::run().
#include <fielddeform/gffd/deform.h>
#include <fielddeform/mesh/quality.h>
#include <fielddeform/scene/detail/method.h>
#include <fielddeform/scene/detail/skeletons.h>
#include <fmt/format.h>

namespace fielddeform::scene::detail {
namespace {

// The fold guard as a step of the resampler.
void guardRefined(const gffd::GffdMap& map, const mesh::Mesh& rest, const map::MapOutput& state) {
  const gffd::GuardReport report = gffd::guard(rest, state.safe, state.position, state.status);
  std::vector<Vec3> points(report.limited.size()), moved(points.size());
  std::vector<Index> order(points.size());
  for (Index k = 0; k < points.size(); ++k) {
    points[k] = rest.positions()[report.limited[k]];
    moved[k] = state.position[report.limited[k]];
    order[k] = k;
  }
  std::vector<float> residual(points.size());
  map.residuals(*map.bind(points), order, moved, residual);
  for (std::size_t k = 0; k < points.size(); ++k) state.residual[report.limited[k]] = residual[k];
}

Posed posedOf(gffd::Deformed&& d) { return {std::move(d.position), std::move(d.status), std::move(d.residual)}; }

class GffdMethod final : public Method {
 public:
  explicit GffdMethod(const Scene& scene) : scene_(scene) {}

  std::string_view preparation() const noexcept override { return "skeleton"; }

  void prepare(const mesh::Mesh& mesh) override { skeletons_ = prepareSkeletons(scene_, mesh); }

  void bind(const mesh::Mesh& mesh) override {
    const gffd::ResolvedOptions resolved = gffd::resolve(scene_.tracking, mesh, skeletons_.pair, &binding_);
    radiusWasAutomatic_ = skeletons_.radiusWasAutomatic || resolved.radiusWasAutomatic;
    map_.emplace(resolved);
    if (!binding_) binding_ = map_->bind(mesh.positions());
  }

  void rebind(const mesh::Mesh& mesh) override { binding_ = map_->bind(mesh.positions()); }

  Posed track(const mesh::Mesh& mesh, std::vector<std::string>& warnings, Progress& progress) override {
    gffd::Deformed deformed = gffd::deform(mesh, *map_, *binding_, progress, scene_.resample.has_value());
    safe_ = std::move(deformed.safe);
    evaluated_ = deformed.evaluation;
    map_ = std::move(deformed.map);
    if (!deformed.retry.empty()) warnings.push_back(deformed.retry);
    if (const std::size_t pierced = map_->countPierced(*binding_); pierced > 0)
      warnings.push_back(fmt::format("{} vertices outside the skeleton's influence stay where they are, and the skeleton was "
                                     "moved to them", pierced));
    if (map_->countMovable(*binding_) == 0)
      warnings.push_back(unpaired().value_or("no vertex is within the skeleton's influence: nothing was deformed; is the "
                                             "skeleton on the mesh?"));
    if (!scene_.volume) binding_.reset();  // the volume pass asks for weights and residuals
    return posedOf(std::move(deformed));
  }

  // Starts where tracking ended.
  resample::Refined refine(mesh::Mesh mesh, mesh::EdgeTable edges, Posed tracked, const resample::Options& options,
                           std::vector<std::string>& warnings, Progress& progress) override {
    resample::Refined refined = refineOnce(std::move(mesh), {std::move(tracked.position), std::move(safe_), std::move(tracked.status),
                                                  std::move(tracked.residual), std::move(edges)}, options, progress);
    if (refined.report.rounds > 0) binding_.reset();
    if (map_->resolved().predictorWasAutomatic && map_->resolved().options.predictor == gffd::Predictor::Axial)
      retryWithMls(options, refined, warnings, progress);
    return refined;
  }

  std::vector<double> falloffWeights(const mesh::Mesh& mesh) override {
    if (!map_->hasFalloff()) return {};
    return map_->falloffWeights(bindingOf(mesh));
  }

  void updateResiduals(const mesh::Mesh& mesh, Points tracked, Points moved, std::span<float> residual) override {
    constexpr std::size_t kAtOnce = 1 << 16;
    std::vector<Index> point;
    std::vector<Vec3> position;
    std::vector<float> now;
    for (Index v = 0; v < moved.size(); ++v) {
      if (moved[v] != tracked[v]) point.push_back(v), position.push_back(moved[v]);
      if (point.empty() || (point.size() < kAtOnce && std::size_t{v} + 1 < moved.size())) continue;
      now.resize(point.size());
      map_->residuals(bindingOf(mesh), point, position, now);
      for (std::size_t k = 0; k < point.size(); ++k) residual[point[k]] = now[k];
      point.clear(), position.clear();
    }
  }

  void describe(Report& r) const override {
    const gffd::ResolvedOptions& resolved = map_->resolved();
    r.method = "gffd";
    r.predictor = gffd::toString(resolved.options.predictor);
    r.predictorReason = resolved.predictorReason;
    r.evaluation = map_->usesGrid() ? "grid" : "exact";
    r.evaluated = evaluated_;
    r.distances = map_->distanceReports();
    r.gridOptions = resolved.options.field.distance.grid;
    r.referenceRadius = resolved.referenceRadius;
    r.tolerance = resolved.options.tolerance * resolved.referenceRadius;
  }

  void resolve(Scene& s) const override {
    s.edits = skeletons_.edits;
    s.tracking = map_->resolved().options;
    s.tracking.retry = false;
    s.tracking.radius.reset();
    storeSkeletons(skeletons_, map_->resolved().skeletons, s);
  }

  bool radiusWasAutomatic() const noexcept override { return radiusWasAutomatic_; }
  skeleton::SkeletonPair overlay() const override { return map_->resolved().skeletons; }

  Posed poseAt(const mesh::Mesh& mesh, double t, Progress& progress) override {
    const gffd::GffdMap map =
        map_->withPose(detail::poseAt(skeletons_, scene_, mesh, map_->resolved().skeletons, t));
    // As the result was tracked: a retry of its own could choose otherwise.
    return posedOf(gffd::deformOnce(mesh, map, bindingOf(mesh), progress));
  }

 private:
  // Of the mesh as it came out of tracking and resampling; made once.
  const map::Binding& bindingOf(const mesh::Mesh& mesh) {
    if (!binding_) binding_ = map_->bind(mesh.positions());
    return *binding_;
  }

  // Why a vertex follows nothing, if it is that no primitive at rest has a posed partner.
  std::optional<std::string> unpaired() const {
    const skeleton::SkeletonPair& pair = skeletons_.pair;
    const std::string *removed = nullptr, *added = nullptr;
    for (const auto& p : pair.pairs) {
      if (p.rest != kNoIndex && p.posed != kNoIndex) return std::nullopt;
      if (p.rest != kNoIndex && !removed) removed = &pair.rest.primitives[p.rest].name;
      if (p.posed != kNoIndex && !added) added = &pair.posed.primitives[p.posed].name;
    }
    if (!removed || !added) return std::nullopt;
    return fmt::format("nothing was deformed: no primitive is in both skeletons, '{0}' is removed and '{1}' added; use "
                       "--pair {0}={1} to replace one by the other", *removed, *added);
  }

  resample::Refined refineOnce(mesh::Mesh mesh, resample::Start start, resample::Options options, Progress& progress) const {
    const gffd::Options& tracking = map_->resolved().options;
    if (tracking.guard && tracking.corrector && !map_->isIdentity())
      options.meshStep = [this](const mesh::Mesh& rest, const map::MapOutput& state) { guardRefined(*map_, rest, state); };
    return resample::refine(std::move(mesh), *map_, std::move(start), options, progress);
  }

  // Between the vertices that "auto" looked at, the closest frame may jump: inserted vertices bring that to light.
  void retryWithMls(const resample::Options& options, resample::Refined& refined,
                    std::vector<std::string>& warnings, Progress& progress) {
    const auto folds = [](const resample::Refined& r) { return mesh::countFolds(r.rest, r.edges, r.rest.positions(), r.posed); };
    const std::size_t before = folds(refined);
    if (before == 0 && refined.report.reason == resample::StopReason::Done) return;
    const gffd::GffdMap axial = *map_;
    try {
      map_ = axial.withPredictor(gffd::Predictor::Mls);
    } catch (const field::GridMemoryError& problem) {
      warnings.push_back(fmt::format("inserted vertices showed {} folded edges of axial; mls was not tried: {}", before, problem.what()));
      return;
    }
    resample::Refined second = refineOnce(refined.input ? std::move(*refined.input) : refined.rest, {}, options, progress);
    const std::size_t after = folds(second);
    if (after > before || (after == before && second.report.remaining >= refined.report.remaining)) {
      map_ = axial;
      return;
    }
    refined = std::move(second);
    warnings.push_back(fmt::format("inserted vertices showed {} folded edges of axial, mls has {} and was taken", before, after));
  }

  const Scene& scene_;
  Skeletons skeletons_;
  std::shared_ptr<const map::Binding> binding_;
  std::vector<Vec3> safe_;  // as tracked, until refine()
  std::optional<gffd::GffdMap> map_;
  gffd::EvaluationCounts evaluated_;
  bool radiusWasAutomatic_ = false;
};

}  // namespace

std::unique_ptr<Method> makeGffdMethod(const Scene& scene) { return std::make_unique<GffdMethod>(scene); }

}  // namespace fielddeform::scene::detail
