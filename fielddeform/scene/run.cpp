// One scene on one mesh. The phases are the methods of Runner, in the order of run().
#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/gffd/deform.h>
#include <fielddeform/mesh/measures.h>
#include <fielddeform/mesh/quality.h>
#include <fielddeform/resample/refine.h>
#include <fielddeform/scene/detail/output.h>
#include <fielddeform/scene/detail/scene_json.h>
#include <fielddeform/scene/detail/skeletons.h>
#include <fielddeform/scene/mask.h>
#include <fielddeform/scene/run.h>
#include <fmt/format.h>
#include <sys/resource.h>

#include <chrono>

namespace fielddeform::scene {
namespace {

namespace fs = std::filesystem;
using detail::Posed;

constexpr const char* kMaskName = "fielddeform mask";

double peakMemoryMb() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) * 1024e-6;
}

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

class Runner {
 public:
  Runner(const Scene& scene, const RunOptions& options, Progress& progress)
      : scene_(scene), options_(options), progress_(progress), input_(scene.inputs.at(options.input)) {}

  RunResult run() {
    requireFolders();
    stage("read", [&] { read(); });
    stage("skeleton", [&] { skeletons_ = detail::prepareSkeletons(scene_, mesh_); });
    stage("bind", [&] { bind(); });
    stage("track", [&] { track(); });
    if (scene_.resample) stage("resample", [&] { resample(); });
    if (!mask_.empty()) applyMask(mask_, mesh_.positions(), posed_.position, posed_.status, posed_.residual);
    stage("report", [&] { measure(); });
    resolveScene();
    if (scene_.output.picture)
      stage("picture", [&] {
        picture_ = detail::drawBeforeAfter(mesh_, posed_.position, map_->resolved().skeletons, progress_);
      });
    stage("write", [&] { write(); });
    gatherFacts();
    if (report_) {
      report_->write(toJson(result_.report));
      report_->commit();
    }
    return std::move(result_);
  }

 private:
  template <class Work>
  void stage(std::string_view name, Work&& work) {
    progress_.throwIfCancelled();
    progress_.beginStage(name);
    const auto start = std::chrono::steady_clock::now();
    work();
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    result_.report.run.seconds.emplace_back(name, took.count());
  }

  void warn(std::string sentence) { result_.report.warnings.push_back(std::move(sentence)); }

  // What cannot be written is found out before the work, not after it.
  void requireFolders() {
    const auto require = [](const fs::path& file) {
      const fs::path folder = file.parent_path();
      if (!folder.empty() && !fs::is_directory(folder))
        throw IoError(file, "cannot be written: there is no folder " + folder.string());
    };
    require(scene_.output.mesh);
    if (scene_.output.picture) require(*scene_.output.picture);
    if (options_.saveScene) require(*options_.saveScene);
    if (scene_.output.report) report_.emplace(*scene_.output.report);
  }

  void read() {
    mesh::ReadReport report;
    mesh_ = mesh::readMesh(input_, scene_.read, &report, &progress_);
    requireUsualSize();
    if (mesh_.vertexCount() == 0) throw IoError(input_, "has no vertices, nothing to deform");
    if (report.invalidPoints > 0)
      warn(fmt::format("{} vertices with coordinates that are not finite were left as they are", report.invalidPoints));
    if (scene_.mask) mask_ = readMask(*scene_.mask, mesh_);
  }

  // Squares and cubes of lengths must stay numbers.
  void requireUsualSize() const {
    constexpr double kSmallest = 1e-90, kLargest = 1e90;
    const Box box = mesh::boundingBox(mesh_.positions());
    const double size = box.isEmpty() ? 0 : box.sizes().maxCoeff();  // no squares, which would underflow
    const double farthest = box.isEmpty() ? 0 : box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).maxCoeff();
    if (!(farthest <= kLargest) || (size > 0 && size < kSmallest))
      throw IoError(input_, fmt::format("coordinates up to {:.3g} and a size of {:.3g}, expected sizes from 1e-90 to 1e+90; scale the mesh first",
                                        farthest, size));
  }

  void bind() {
    const gffd::ResolvedOptions resolved = gffd::resolve(scene_.tracking, mesh_, skeletons_.pair, &binding_);
    result_.radiusWasAutomatic = skeletons_.radiusWasAutomatic || resolved.radiusWasAutomatic;
    map_.emplace(resolved);
    if (!binding_) binding_ = map_->bind(mesh_.positions());
  }

  void track() {
    gffd::Deformed deformed = gffd::deform(mesh_, *map_, *binding_, progress_);
    map_ = std::move(deformed.map);
    posed_ = {std::move(deformed.position), std::move(deformed.status), std::move(deformed.residual)};
    if (!deformed.retry.empty()) warn(deformed.retry);
    if (const std::size_t pierced = map_->countPierced(*binding_); pierced > 0)
      warn(fmt::format("{} vertices outside the skeleton's influence stay where they are, and the skeleton was moved "
                       "to them", pierced));
    if (map_->countMovable(*binding_) == 0)
      warn(unpaired().value_or("no vertex is within the skeleton's influence: nothing was deformed; is the skeleton on the "
                               "mesh?"));
    binding_.reset();
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

  void resample() {
    const std::size_t before = mesh_.vertexCount();
    // The mask rides along as an attribute, so that inserted vertices get theirs.
    if (!mask_.empty()) {
      mesh::Attribute carried;
      carried.name = kMaskName;
      carried.data = mask_;
      mesh_.attributes().push_back(std::move(carried));
    }
    posed_ = {};
    foldsOfInput_ = mesh::countSharpEdges(mesh_, mesh_.positions());
    resample::Refined refined = refine();
    if (map_->resolved().predictorWasAutomatic && map_->resolved().options.predictor == gffd::Predictor::Axial)
      retryWithMls(refined);
    mesh_ = std::move(refined.rest);
    posed_ = {std::move(refined.posed), std::move(refined.status), std::move(refined.residual)};
    result_.report.insertedVertices = mesh_.vertexCount() - before;
    if (!refined.report.message.empty()) warn(refined.report.message);
    if (mask_.empty()) return;
    mask_ = std::get<std::vector<double>>(mesh_.find(mesh::Element::Vertex, kMaskName)->data);
    std::erase_if(mesh_.attributes(), [](const mesh::Attribute& a) { return a.name == kMaskName; });
  }

  resample::Refined refine() {
    resample::Options options = *scene_.resample;
    const gffd::Options& tracking = map_->resolved().options;
    if (tracking.guard && tracking.corrector && !map_->isIdentity())
      options.meshStep = [this](const mesh::Mesh& rest, const map::MapOutput& state) { guardRefined(*map_, rest, state); };
    return resample::refine(mesh_, *map_, options, progress_);
  }

  // Between the vertices that "auto" looked at, the closest frame may jump: inserted vertices bring that to light.
  void retryWithMls(resample::Refined& refined) {
    const auto folds = [](const resample::Refined& r) { return mesh::countFolds(r.rest, r.rest.positions(), r.posed); };
    const std::size_t before = folds(refined);
    if (before == 0 && refined.report.reason == resample::StopReason::Done) return;
    const gffd::GffdMap axial = *map_;
    map_ = axial.withPredictor(gffd::Predictor::Mls);
    resample::Refined second = refine();
    const std::size_t after = folds(second);
    if (after > before || (after == before && second.report.remaining >= refined.report.remaining)) {
      map_ = axial;
      return;
    }
    refined = std::move(second);
    warn(fmt::format("inserted vertices showed {} folded edges of axial, mls has {} and was taken", before, after));
  }

  void measure() {
    Report& r = result_.report;
    const auto& rest = mesh_.positions();
    r.vertices = mesh_.vertexCount();
    r.faces = mesh_.faceCount();
    r.status = countStatuses(posed_.status);
    r.residual = maxAndP99(posed_.residual);
    const mesh::QualityReport quality = mesh::compareQuality(mesh_, rest, posed_.position);
    r.foldsBefore = foldsOfInput_.value_or(quality.sharpRest);
    r.foldsAfter = quality.folds;
    r.stretch = {quality.stretch.max, quality.stretch.p99};
    r.flipped = mesh::countFlipped(mesh_, rest, posed_.position);
    if (const std::size_t stalled = r.status[static_cast<std::size_t>(Status::Stalled)]; stalled == r.vertices && stalled > 0)
      warn("no vertex could be brought back to its field value: all are stalled");
    measureVolume(r.volume);
    const gffd::ResolvedOptions& resolved = map_->resolved();
    r.predictor = gffd::toString(resolved.options.predictor);
    r.predictorReason = resolved.predictorReason;
    r.referenceRadius = resolved.referenceRadius;
    r.tolerance = resolved.options.tolerance * resolved.referenceRadius;
    check();
  }

  void measureVolume(VolumeReport& volume) const {
    const mesh::EdgeCounts edges = mesh::countEdges(mesh::EdgeTable(mesh_));
    const mesh::MaybeVolume before = mesh::volume(mesh_, mesh_.positions(), edges);
    const mesh::MaybeVolume after = mesh::volume(mesh_, posed_.position, edges);
    volume.before = before.value;
    volume.after = after.value;
    volume.reason = before.value ? after.reason : before.reason;
    const bool rounded = scene_.output.precision == mesh::Precision::Keep;
    volume.asWritten = rounded ? mesh::volumeAsWritten(mesh_, posed_.position, edges).value : after.value;
  }

  void check() {
    if (!scene_.check) return;
    const Report& r = result_.report;
    const Check& bound = *scene_.check;
    if (bound.folds && r.foldsAfter > *bound.folds)
      result_.broken.push_back(fmt::format("{} folded edges, allowed {}", r.foldsAfter, *bound.folds));
    if (bound.flipped && r.flipped > *bound.flipped)
      result_.broken.push_back(fmt::format("{} flipped faces, allowed {}", r.flipped, *bound.flipped));
    const double residual = r.referenceRadius > 0 ? r.residual.max / r.referenceRadius : 0;
    if (bound.residual && !(residual <= *bound.residual))
      result_.broken.push_back(fmt::format("residual {:.3g} radii, allowed {:.3g}", residual, *bound.residual));
  }

  void resolveScene() {
    Scene& s = result_.resolved;
    s = scene_;
    s.inputs = {input_};
    s.edits = skeletons_.edits;
    s.tracking = map_->resolved().options;
    s.tracking.retry = false;
    s.tracking.radius.reset();
    JsonWriter options;
    options.beginObject();
    detail::writeSceneBody(options, s, nullptr);
    options.end();
    result_.report.options = options.text();
    detail::storeSkeletons(skeletons_, map_->resolved().skeletons, s);
  }

  void write() {
    const Output& output = scene_.output;
    std::vector<std::string> lost;
    if (output.frames > 0) lost = writeFrames();
    else lost = detail::writeOutput(mesh_, std::move(posed_), output, output.mesh, progress_);
    for (const std::string& what : lost) warn(fmt::format("the output's format cannot hold {}", what));
    if (options_.saveScene) writeScene(result_.resolved, *options_.saveScene);
    if (output.picture) render::writePng(picture_, *output.picture);
  }

  // Frame 0 is the input, the last one the result; those between are tracked poses of their own.
  std::vector<std::string> writeFrames() {
    const Output& output = scene_.output;
    const int last = output.frames - 1;
    const auto file = [&](int k) { return detail::framePath(output.mesh, k, output.frames); };
    mesh::writeMesh(mesh_, file(0), {.precision = output.precision, .format = {}}, &progress_);
    const auto binding = map_->bind(mesh_.positions());
    for (int k = 1; k < last; ++k) {
      progress_.throwIfCancelled();
      const double t = static_cast<double>(k) / last;
      const gffd::GffdMap map =
          map_->withPose(detail::poseAt(skeletons_, scene_, mesh_, map_->resolved().skeletons, t));
      // As the result was tracked: a retry of its own could choose otherwise.
      gffd::Deformed d = gffd::deformOnce(mesh_, map, *binding, progress_);
      Posed posed{std::move(d.position), std::move(d.status), std::move(d.residual)};
      if (!mask_.empty()) applyMask(mask_, mesh_.positions(), posed.position, posed.status, posed.residual);
      mesh::Mesh frame = mesh_;
      detail::writeOutput(frame, std::move(posed), output, file(k), progress_);
    }
    return detail::writeOutput(mesh_, std::move(posed_), output, file(last), progress_);
  }

  void gatherFacts() {
    RunFacts& run = result_.report.run;
    run.threads = threadCount();
    run.peakMemoryMb = peakMemoryMb();
    run.paths.emplace_back("input", input_.string());
    run.paths.emplace_back("output", scene_.output.mesh.string());
    if (scene_.output.picture) run.paths.emplace_back("picture", scene_.output.picture->string());
    if (options_.saveScene) run.paths.emplace_back("scene", options_.saveScene->string());
  }

  const Scene& scene_;
  const RunOptions& options_;
  Progress& progress_;
  fs::path input_;
  RunResult result_;
  std::optional<AtomicFile> report_;  // reserved at the start
  mesh::Mesh mesh_;                   // at rest; refined by resample()
  std::vector<double> mask_;          // #V or empty
  detail::Skeletons skeletons_;
  std::shared_ptr<const map::Binding> binding_;
  std::optional<gffd::GffdMap> map_;
  Posed posed_;
  std::optional<std::size_t> foldsOfInput_;  ///< counted before resampling divides its edges
  render::Image picture_;
};

}  // namespace

RunResult run(const Scene& scene, const RunOptions& options, Progress& progress) {
  if (options.input >= scene.inputs.size())
    throw std::invalid_argument(fmt::format("input is {}, the scene has {}", options.input, scene.inputs.size()));
  return Runner(scene, options, progress).run();
}

}  // namespace fielddeform::scene
