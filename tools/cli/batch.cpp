// Runs a scene on one or many meshes: what goes where, one bar, a table at the end.
#include <fielddeform/core/error.h>
#include <fmt/format.h>

#include <map>

#include "scene_options.h"
#include "values.h"

namespace fielddeform::cli {
namespace {

namespace fs = std::filesystem;

struct Job {
  fs::path input;
  scene::Output output;
};

bool namesFolder(const fs::path& path) { return path.empty() || !path.has_filename() || fs::is_directory(path); }

// The file for one input: `path` itself, or in the folder `path` under the input's name.
fs::path fileFor(const fs::path& path, bool folder, const fs::path& input, std::string_view extension) {
  if (!folder) return path;
  return path / (extension.empty() ? input.filename() : withSuffix(input.filename(), "", extension));
}

void makeFolder(const fs::path& folder) {
  std::error_code problem;
  fs::create_directories(folder, problem);
  if (!fs::is_directory(folder)) throw IoError(folder, "cannot be made: " + problem.message());
}

const std::vector<std::string> kPictures{".png"};

// Says what is wrong with the name of the mesh or picture to be written; empty if nothing is.
std::string outputProblem(const fs::path& path, bool folder, bool picture) {
  if (folder || namesFolder(path)) return {};
  if (picture) return extensionProblem(path, kPictures);
  // Without an extension it is written in the format of the input.
  if (!path.has_extension()) return {};
  return extensionProblem(path, {".ply", ".obj", ".stl", ".off", ".coff", ".noff"});
}

// Where everything of a scene with these inputs goes. Several inputs need folders; folders are made.
std::vector<Job> jobsOf(const scene::Scene& scene) {
  const bool several = scene.inputs.size() > 1;
  const auto isFolder = [&](const fs::path& path, const char* what) {
    const bool folder = namesFolder(path);
    if (several && !folder && (fs::exists(path) || path.has_extension()))
      throw std::runtime_error(fmt::format("{}: {} names a file, several inputs need a folder (end its name in /)", what,
                                           path.string()));
    if (folder || several) makeFolder(path);
    return folder || several;
  };
  const scene::Output& out = scene.output;
  const bool meshFolder = isFolder(out.mesh, "output");
  const bool reportFolder = out.report && isFolder(*out.report, "report");
  const bool pictureFolder = out.picture && isFolder(*out.picture, "picture");
  if (const std::string problem = outputProblem(out.mesh, meshFolder, false); !problem.empty())
    throw std::runtime_error("output: " + problem);
  if (out.picture)
    if (const std::string problem = outputProblem(*out.picture, pictureFolder, true); !problem.empty())
      throw std::runtime_error("picture: " + problem);
  std::vector<Job> jobs;
  std::map<fs::path, fs::path> taken;
  for (const fs::path& input : scene.inputs) {
    Job job{input, out};
    job.output.mesh = fileFor(out.mesh, meshFolder, input, "");
    if (out.report) job.output.report = fileFor(*out.report, reportFolder, input, ".json");
    if (out.picture) job.output.picture = fileFor(*out.picture, pictureFolder, input, ".png");
    const auto [other, fresh] = taken.emplace(job.output.mesh, input);
    if (!fresh)
      throw std::runtime_error(fmt::format("{} and {} would both be written to {}", other->second.string(),
                                           input.string(), job.output.mesh.string()));
    jobs.push_back(std::move(job));
  }
  return jobs;
}

std::string statusText(const scene::Report& r) {
  std::string text;
  for (std::size_t s = 0; s < kStatusCount; ++s) {
    if (r.status[s] == 0) continue;
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", r.status[s], toString(static_cast<Status>(s)));
  }
  return text;
}

std::string volumeText(const scene::VolumeReport& v) {
  if (!v.before || !v.after) return "none: " + v.reason;
  std::string text = fmt::format("{:.6g}, was {:.6g}", *v.after, *v.before);
  if (const auto change = v.relativeChange()) text += fmt::format(" ({:+.3f} %)", 100 * *change);
  return text;
}

std::string moveText(const map::MoveReport& m) {
  const std::string nodes = m.refinements > 0 ? fmt::format(", refined to {} x {} x {} nodes", m.nodes[0], m.nodes[1], m.nodes[2]) : "";
  if (m.kind == "press")
    return fmt::format("{} points inside by up to {:.3g}, then {}{} by up to {:.3g}, in {} rounds{}", m.vertices, m.deepestBefore, m.penetrating,
                       m.penetratingFaces > 0 ? fmt::format(" and {} faces", m.penetratingFaces) : "", m.deepestAfter, m.rounds, nodes);
  return fmt::format("{} points: {} met, {} unmet by up to {:.3g}, {} outside{}", m.vertices, m.solve.met, m.solve.unmet,
                     m.solve.largestMiss, m.solve.outside, nodes);
}

void printResult(const Job& job, const scene::RunResult& result, Terminal& terminal) {
  const scene::Report& r = result.report;
  const auto row = [&](std::string_view name, const std::string& value) { terminal.print(fmt::format("  {:<10}{}", name, value)); };
  terminal.print(fmt::format("{} -> {}", job.input.string(), job.output.mesh.string()));
  row("vertices", fmt::format("{}: {}", r.vertices, statusText(r)));
  if (r.insertedVertices > 0) row("inserted", fmt::format("{} vertices", r.insertedVertices));
  if (!r.predictor.empty()) {
    row("tracking", fmt::format("{}: {}", r.predictor, r.predictorReason));
    if (r.evaluation == "grid")
      row("predicted", fmt::format("{} vertices from a grid, {} exact", r.evaluated.grid, r.evaluated.exact));
    row("radius", fmt::format("{:.6g}{}", r.referenceRadius, result.radiusWasAutomatic ? " (automatic)" : ""));
    row("residual", fmt::format("{:.3g} at most, tolerance {:.3g}", r.residual.max, r.tolerance));
  }
  if (r.fit) row(r.method, fmt::format("{}; {} skeleton points missed by {:.3g} at most, {:.3g} on average", r.fit->found, r.fit->pairs, r.fit->max, r.fit->rms));
  for (const map::MoveReport& move : r.moves) row(move.kind, moveText(move));
  row("folds", fmt::format("{} ({} in the input), {} faces flipped", r.foldsAfter, r.foldsBefore, r.flipped));
  row("stretch", fmt::format("{:.3f} at most", r.stretch.max));
  row("volume", volumeText(r.volume));
  if (r.volume.pass && r.volume.pass->result.needed) {
    const volume::LocalReport& v = r.volume.pass->result;
    row("", fmt::format("restored by a pass from {:+.3f} % on {} vertices, moved by at most {:.3g}", 100 * v.change, v.moved,
                        v.largest));
  }
}

struct Row {
  std::string name, outcome;
};

void printTable(const std::vector<Row>& rows, Terminal& terminal) {
  std::size_t width = 4;
  for (const Row& row : rows) width = std::max(width, row.name.size());
  terminal.print("");
  for (const Row& row : rows) terminal.print(fmt::format("{:<{}}  {}", row.name, width, row.outcome));
}

std::string shortText(const scene::Report& r) {
  return fmt::format("{} vertices, {} folds, {} flipped, residual {:.2g}", r.vertices, r.foldsAfter, r.flipped, r.residual.max);
}

}  // namespace

int runScene(const scene::Scene& scene, const std::optional<fs::path>& saveScene, Terminal& terminal,
             const std::function<void(const scene::RunResult&)>& done) {
  const std::vector<Job> jobs = jobsOf(scene);
  if (saveScene && jobs.size() > 1)
    throw std::runtime_error("--save-scene: choices differ from mesh to mesh, give one mesh at a time");
  std::vector<Row> rows;
  std::size_t failed = 0, broken = 0;
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const Job& job = jobs[i];
    terminal.beginJob(i, jobs.size(), job.input.filename().string());
    scene::Scene one = scene;
    one.inputs = {job.input};
    one.output = job.output;
    try {
      const scene::RunResult result = scene::run(one, {.saveScene = saveScene}, terminal);
      for (const std::string& warning : result.report.warnings)
        terminal.note(fmt::format("fielddeform: {}: {}", job.input.string(), warning));
      if (done) done(result);
      if (jobs.size() == 1) printResult(job, result, terminal);
      for (const std::string& sentence : result.broken)
        terminal.error(fmt::format("{}: check failed: {}", job.input.string(), sentence));
      if (!result.broken.empty()) ++broken;
      rows.push_back({job.input.string(), shortText(result.report) + (result.broken.empty() ? "" : "  CHECK FAILED")});
    } catch (const Cancelled&) {
      throw;
    } catch (const std::exception& problem) {
      const std::string text = problem.what();
      terminal.error(text.starts_with(job.input.string()) ? text : fmt::format("{}: {}", job.input.string(), text));
      rows.push_back({job.input.string(), "FAILED"});
      ++failed;
    }
  }
  if (jobs.size() > 1) {
    printTable(rows, terminal);
    terminal.print(fmt::format("{} of {} meshes done", jobs.size() - failed, jobs.size()));
  }
  return failed > 0 ? kFailed : broken > 0 ? kCheckFailed : kDone;
}

void requireUsable(const BatchOptions& options) {
  for (const auto& [option, kind] : options.ofMethods)
    if (option->count() > 0 && !scene::takes(options.scene.method, kind))
      throw CLI::ValidationError(fmt::format("{}: has no meaning with --method {}", option->get_name(), scene::toString(options.scene.method)));
  const bool several = options.meshes.size() > 1;
  if (const std::string problem = outputProblem(options.output, several, false); !problem.empty())
    throw CLI::ValidationError("--output: " + problem);
  if (!options.picture.empty())
    if (const std::string problem = outputProblem(options.picture, several, true); !problem.empty())
      throw CLI::ValidationError("--picture: " + problem + (several ? "" : ", or a folder (ends in /)"));
  if (several && !options.saveScene.empty())
    throw CLI::ValidationError("--save-scene: choices differ from mesh to mesh, give one mesh at a time");
}

namespace {

scene::VolumePass volumePassOf(const BatchOptions& options) {
  using volume::MaskKind;
  scene::VolumePass pass = options.volumeOptions;
  const std::string& mask = options.volumeMask;
  if (mask == "none") pass.options.mask = MaskKind::None;
  else if (mask == "rest") pass.options.mask = MaskKind::Rest;
  if (mask.empty() || mask == "auto" || pass.options.mask != MaskKind::Auto) return pass;
  pass.options.mask = MaskKind::Given;
  pass.mask.emplace();
  if (fs::is_regular_file(mask)) pass.mask->file = mask;
  else pass.mask->attribute = mask;
  return pass;
}

}  // namespace

int runBatch(BatchOptions& options, Terminal& terminal) {
  scene::Scene& scene = options.scene;
  for (const std::string& mesh : options.meshes) scene.inputs.emplace_back(mesh);
  scene.output.mesh = options.output;
  if (!options.report.empty()) scene.output.report = options.report;
  if (!options.picture.empty()) scene.output.picture = options.picture;
  for (const std::string& name : options.attributes)
    (name == "status"     ? scene.output.statusAttribute
     : name == "residual" ? scene.output.residualAttribute
     : name == "affected" ? scene.output.affectedAttribute
                          : scene.output.displacementAttribute) = true;
  if (options.resample) scene.resample = options.resampleOptions;
  if (options.volume) scene.volume = volumePassOf(options);
  if (options.check) scene.check = options.checkOptions;
  if (!options.mask.empty()) {
    scene.mask.emplace();
    if (fs::is_regular_file(options.mask)) scene.mask->file = options.mask;
    else scene.mask->attribute = options.mask;
  }
  if (!options.warpPairs.empty()) {
    scene.tracking.predictor = gffd::Predictor::Warp;
    scene.tracking.warpPairs = readPairs(options.warpPairs);
  }
  std::optional<fs::path> save;
  if (!options.saveScene.empty()) save = options.saveScene;
  return runScene(scene, save, terminal, options.done);
}

}  // namespace fielddeform::cli
