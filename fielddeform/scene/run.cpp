// One scene on one mesh. The phases are the methods of Runner, in the order of run().
#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/mesh/lod.h>
#include <fielddeform/mesh/measures.h>
#include <fielddeform/mesh/quality.h>
#include <fielddeform/scene/detail/method.h>
#include <fielddeform/scene/detail/scene_json.h>
#include <fielddeform/scene/mask.h>
#include <fielddeform/scene/run.h>
#include <fmt/format.h>
#include <sys/resource.h>

#include <chrono>
#include <utility>

namespace fielddeform::scene {
namespace {

namespace fs = std::filesystem;
using detail::Posed;

constexpr const char *kMaskName = "fielddeform mask", *kVolumeMaskName = "fielddeform volume mask";

double peakMemoryMb() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) * 1024e-6;
}

class Runner {
 public:
  Runner(const Scene& scene, const RunOptions& options, Progress& progress)
      : scene_(scene), options_(options), progress_(progress), input_(scene.inputs.at(options.input)),
        method_(detail::makeMethod(scene)) {}

  RunResult run() {
    requireFolders();
    stage("read", [&] { read(); });
    stage(method_->preparation(), [&] { method_->prepare(mesh_); });
    stage("bind", [&] { method_->bind(mesh_); });
    if (scene_.output.preview > 0) stage("preview", [&] { takeProxy(); });
    stage("track", [&] { posed_ = method_->track(mesh_, result_.report.warnings, progress_); });
    if (scene_.output.affectedAttribute) markAffected();
    if (scene_.resample) stage("resample", [&] { resample(); });
    if (!mask_.empty()) applyMask(mask_, mesh_.positions(), posed_.position, posed_.status, posed_.residual);
    if (scene_.volume) stage("volume", [&] { preserveVolume(); });
    stage("report", [&] { measure(); });
    result_.radiusWasAutomatic = method_->radiusWasAutomatic();
    resolveScene();
    if (scene_.output.picture)
      stage("picture", [&] {
        picture_ = detail::drawBeforeAfter(mesh_, posed_.position, method_->overlay(), progress_);
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
    if (scene_.volume && scene_.volume->mask) volumeMask_ = readVolumeMask();
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

  // A simplified mesh on vertices of the mesh, with the choices made for the whole.
  void takeProxy() {
    const std::size_t wanted = scene_.output.preview, whole = mesh_.vertexCount();
    if (whole <= wanted) return;
    mesh::Lod lod = mesh::simplify(mesh_, 2 * wanted);
    lod.mesh.setPositionType(mesh_.positionType());
    for (auto* values : {&mask_, &volumeMask_}) {
      if (values->empty()) continue;
      std::vector<double> chosen;
      for (const Index v : lod.vertexOf) chosen.push_back((*values)[v]);
      *values = std::move(chosen);
    }
    mesh_ = std::move(lod.mesh);
    method_->rebind(mesh_);
    warn(fmt::format("a preview: {} of the mesh's {} vertices, without its attributes", mesh_.vertexCount(), whole));
  }

  void resample() {
    const std::size_t before = mesh_.vertexCount();
    // Masks ride along as attributes, so that inserted vertices get theirs.
    carry(kMaskName, mask_);
    carry(kVolumeMaskName, volumeMask_);
    mesh::EdgeTable edges(mesh_);
    foldsOfInput_ = mesh::countSharpEdges(mesh_, edges, mesh_.positions());
    resample::Refined refined =
        method_->refine(std::move(mesh_), std::move(edges), std::exchange(posed_, {}), *scene_.resample, result_.report.warnings, progress_);
    mesh_ = std::move(refined.rest);
    edges_ = std::move(refined.edges);
    posed_ = {std::move(refined.posed), std::move(refined.status), std::move(refined.residual)};
    result_.report.insertedVertices = mesh_.vertexCount() - before;
    if (!refined.report.message.empty()) warn(refined.report.message);
    takeBack(kMaskName, mask_);
    takeBack(kVolumeMaskName, volumeMask_);
  }

  // Rides along as an attribute, so that inserted vertices get theirs.
  void markAffected() {
    mesh::Attribute attribute;
    attribute.name = "affected";
    std::vector<float> share = method_->affected();
    if (share.empty()) return warn("the attribute \"affected\" is of lattices: not written");
    attribute.data = std::move(share);
    std::erase_if(mesh_.attributes(), [](const mesh::Attribute& a) { return a.on == mesh::Element::Vertex && a.name == "affected"; });
    mesh_.attributes().push_back(std::move(attribute));
  }

  void carry(const char* name, const std::vector<double>& values) {
    if (values.empty()) return;
    mesh::Attribute carried;
    carried.name = name;
    carried.data = values;
    mesh_.attributes().push_back(std::move(carried));
  }

  void takeBack(const char* name, std::vector<double>& values) {
    if (values.empty()) return;
    values = std::get<std::vector<double>>(mesh_.find(mesh::Element::Vertex, name)->data);
    std::erase_if(mesh_.attributes(), [&](const mesh::Attribute& a) { return a.name == name; });
  }

  std::vector<double> readVolumeMask() const {
    std::vector<double> mask = readMask(*scene_.volume->mask, mesh_);
    for (std::size_t v = 0; v < mask.size(); ++v)
      if (!(mask[v] >= 0 && mask[v] <= 1))
        throw std::invalid_argument(fmt::format("volume mask is {} at vertex {}, expected 0 to 1", mask[v], v));
    return mask;
  }

  volume::LocalResult passOver(Points position) {
    if (scene_.output.frames > 0 && !edges_) edges_.emplace(mesh_);  // else the pass makes its own, and gives them back in its middle
    if (weight_.empty()) weight_ = method_->falloffWeights(mesh_);
    return volume::preserveLocally({.rest = mesh_, .posed = position, .weight = weight_, .mask = volumeMask_,
                                    .edges = edges_ ? &*edges_ : nullptr}, scene_.volume->options, progress_);
  }

  // Statuses stay those of tracking; the pass reports by itself what it changed.
  void preserveVolume() {
    VolumePassReport& pass = result_.report.volume.pass.emplace();
    pass.options = scene_.volume->options;
    volume::LocalResult passed = passOver(posed_.position);
    const std::vector<Vec3> tracked = std::exchange(posed_.position, std::move(passed.position));
    pass.result = std::move(passed.report);
    pass.foldsBefore = edges_ ? mesh::countFolds(mesh_, *edges_, mesh_.positions(), tracked) : mesh::countFolds(mesh_, mesh_.positions(), tracked);
    std::vector<float> residual = posed_.residual;
    pass.residualBefore = maxAndP99(residual);
    method_->updateResiduals(mesh_, tracked, posed_.position, residual);
    pass.residualAfter = maxAndP99(std::move(residual));
    for (const std::string& warning : pass.result.warnings) warn(warning);
  }

  void measure() {
    Report& r = result_.report;
    const auto& rest = mesh_.positions();
    r.vertices = mesh_.vertexCount();
    r.faces = mesh_.faceCount();
    r.status = countStatuses(posed_.status);
    r.residual = maxAndP99(posed_.residual);
    mesh::EdgeTable edges = edges_ ? std::move(*edges_) : mesh::EdgeTable(mesh_);
    edges_.reset();
    const mesh::EdgeCounts counts = mesh::countEdges(edges);
    const mesh::QualityReport quality = mesh::compareQuality(mesh_, edges, rest, posed_.position);
    r.foldsBefore = foldsOfInput_.value_or(quality.sharpRest);
    r.foldsAfter = quality.folds;
    if (r.volume.pass) {
      r.volume.pass->foldsAfter = quality.folds;
      if (const std::size_t before = r.volume.pass->foldsBefore; quality.folds > before)
        warn(fmt::format("the volume pass folded {} edges more", quality.folds - before));
    }
    r.stretch = {quality.stretch.max, quality.stretch.p99};
    r.flipped = mesh::countFlipped(mesh_, std::move(edges), rest, posed_.position);
    if (const std::size_t stalled = r.status[static_cast<std::size_t>(Status::Stalled)]; stalled == r.vertices && stalled > 0)
      warn("no vertex could be brought back to its field value: all are stalled");
    measureVolume(r.volume, counts);
    method_->describe(r);
    check();
  }

  void measureVolume(VolumeReport& volume, const mesh::EdgeCounts& edges) const {
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
    method_->resolve(s);
    JsonWriter options;
    options.beginObject();
    detail::writeSceneBody(options, s, nullptr);
    options.end();
    result_.report.options = options.text();
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
    for (int k = 1; k < last; ++k) {
      progress_.throwIfCancelled();
      Posed posed = method_->poseAt(mesh_, static_cast<double>(k) / last, progress_);
      if (!mask_.empty()) applyMask(mask_, mesh_.positions(), posed.position, posed.status, posed.residual);
      if (scene_.volume) posed.position = passOver(posed.position).position;
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
  std::unique_ptr<detail::Method> method_;
  RunResult result_;
  std::optional<AtomicFile> report_;  // reserved at the start
  mesh::Mesh mesh_;                   // at rest; refined by resample()
  std::vector<double> mask_, volumeMask_;  // #V or empty
  std::vector<double> weight_;        // the falloff's, once it was asked for
  Posed posed_;
  std::optional<mesh::EdgeTable> edges_;     ///< of mesh_, once they are known
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
