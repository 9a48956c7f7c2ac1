#include "scene_options.h"

#include <fmt/format.h>

#include <cmath>

#include "values.h"

namespace fielddeform::cli {
namespace {

void setFalloff(gffd::Options& tracking, const std::string& text) {
  if (text == "auto") {
    tracking.falloff = gffd::Falloff::Auto;
  } else if (text == "off") {
    tracking.falloff = gffd::Falloff::Off;
  } else {
    const double band = parseNumbers("--falloff", text, 1)[0];
    if (!(band > 0 && band <= 1)) throw CLI::ConversionError(fmt::format("--falloff: {}, expected 0 < B <= 1", text));
    tracking.falloff = gffd::Falloff::On;
    tracking.falloffBand = band;
  }
}

void setWireBlend(scene::Scene& scene, const std::string& text) {
  scene.wireBlend.reset();
  if (text == "sum") return;
  scene.wireBlend = parseNumbers("--wire-blend", text, 1)[0];
  if (!(*scene.wireBlend >= 0 && *scene.wireBlend <= 100))
    throw CLI::ConversionError(fmt::format("--wire-blend: {}, expected sum or a number from 0 to 100", text));
}

void setNodes(scene::Scene& scene, const std::string& text) {
  const std::vector<double> n = parseNumbers("--nodes", text, 3);
  scene.latticeNodes.emplace();
  for (std::size_t k = 0; k < 3; ++k) {
    if (!(n[k] >= 2 && n[k] <= 64 && n[k] == std::floor(n[k])))
      throw CLI::ConversionError(fmt::format("--nodes: {}, expected three whole numbers from 2 to 64", text));
    (*scene.latticeNodes)[k] = static_cast<int>(n[k]);
  }
}

void addMethod(CLI::App& command, BatchOptions& options) {
  const char* group = "Method";
  scene::Scene& scene = options.scene;
  std::vector<std::string> words;
  for (const scene::MethodInfo& info : scene::methods()) words.emplace_back(info.word);
  addWord(command, "--method", words, [&scene](std::size_t i) { scene.method = static_cast<scene::MethodKind>(i); },
          "How the skeleton's motion deforms space (default: gffd)")->group(group);
  options.ofMethods.emplace_back(
      command.add_option_function<std::string>("--nodes", [&scene](const std::string& text) { setNodes(scene, text); },
                                               "lattice: nodes along x, y, z (default: 4 to 12, by the box)")
          ->type_name("NX,NY,NZ")->group(group),
      scene::MethodOption::Nodes);
  options.ofMethods.emplace_back(
      command.add_option_function<std::string>("--wire-blend", [&scene](const std::string& text) { setWireBlend(scene, text); },
                                               "wires: the power by which the greater displacement wins, or the sum (default: 1)")
          ->type_name("sum|M")->group(group),
      scene::MethodOption::WireBlend);
  options.ofMethods.emplace_back(
      command.add_option("--wire-local", scene.wireLocal, "wires: the power by which the nearest wire has its way (default: 0)")
          ->type_name("K")->check(within(0, 100))->group(group),
      scene::MethodOption::WireBlend);
}

// Which of the options that were added are of some methods only.
void markOptions(CLI::App& command, BatchOptions& options) {
  using scene::MethodOption;
  const auto mark = [&](MethodOption option, std::initializer_list<const char*> names) {
    for (const char* name : names) options.ofMethods.emplace_back(command.get_option(name), option);
  };
  mark(MethodOption::Tracking, {"--track", "--warp-pairs", "--evaluation", "--no-corrector", "--tolerance", "--strict-value",
                                "--no-guard", "--substeps", "--no-retry", "--resample-like", "--allow-residual", "--distance",
                                "--voxel", "--distance-tolerance", "--sampling", "--grid-of", "--grid-around", "--distance-memory", "--centres", "--smoothing"});
  mark(MethodOption::Falloff, {"--falloff"});
  mark(MethodOption::Potential, {"--potential", "--sharpness"});
}

void addTracking(CLI::App& command, BatchOptions& options) {
  gffd::Options& tracking = options.scene.tracking;
  const char* group = "Tracking";
  addNumber(command, "--radius", tracking.radius,
            "Influence radius of primitives that name none, model units (default: from the mesh)")
      ->check(positive())->group(group);
  addWord(command, "--track", {"auto", "mls", "axial", "warp", "gradient"},
          [&tracking](std::size_t i) { tracking.predictor = static_cast<gffd::Predictor>(i); },
          "How vertices follow (default: auto, which is mls or axial; warp and gradient are the paper's)")->group(group);
  command.add_option("--warp-pairs", options.warpPairs,
                     "As --track warp, by these points: a line each, X Y Z and X Y Z of where it goes")
      ->type_name("FILE")->group(group);
  addWord(command, "--evaluation", {"auto", "exact", "grid"},
          [&tracking](std::size_t i) { tracking.evaluation = static_cast<gffd::Evaluation>(i); },
          "Predict every vertex by itself, or from a grid (default: auto, a grid where there are many vertices)")->group(group);
  command.add_flag_callback("--no-corrector", [&tracking] { tracking.corrector = false; },
                            "Do not bring vertices back to their field value")->group(group);
  command.add_option("--tolerance", tracking.tolerance, "Residual of a converged vertex, in radii (default: 1e-4)")
      ->type_name("NUMBER")->check(positive())->group(group);
  addWord(command, "--potential", {"exponential", "gaussian", "metaball", "soft-object"},
          [&tracking](std::size_t i) { tracking.field.potential = static_cast<skeleton::Potential>(i); },
          "Potential of primitives that name none (default: exponential)")->group(group);
  command.add_option("--sharpness", tracking.field.sharpness, "Falloff lengths in a radius (default: 4)")
      ->type_name("NUMBER")->check(within(1e-3, 500))->group(group);
  command.add_option_function<std::string>(
      "--falloff", [&tracking](const std::string& text) { setFalloff(tracking, text); },
      "Share of the radius in which the displacement dies out (default: auto, 0.5 where the influence ends on the mesh)")
      ->type_name("auto|off|B")->group(group);
  command.add_flag_callback("--strict-value", [&tracking] { tracking.strictValue = true; },
                            "Keep every field value whatever becomes of the surface: no guard, no falloff")->group(group);
  command.add_flag_callback("--no-guard", [&tracking] { tracking.guard = false; },
                            "Do not hold corrections back where they fold the surface")->group(group);
  command.add_option("--substeps", tracking.substeps, "Poses tracked one after the other (default: 1)")
      ->type_name("N")->check(within(1, 64))->group(group);
  command.add_flag_callback("--no-retry", [&tracking] { tracking.retry = false; },
                            "Do not try more substeps when the surface folded")->group(group);
}

void addResampling(CLI::App& command, BatchOptions& options, Method method) {
  const char* group = "Resampling";
  resample::Options& r = options.resampleOptions;
  const auto on = [&options] { options.resample = true; };
  command.add_flag_callback("--resample", on, "Insert vertices where edges stretch or bend too much")->group(group);
  addWord(command, "--resample-by", {"stretch", "deviation", "both"},
          [&r, on](std::size_t i) { r.by = static_cast<resample::Criterion>(i); on(); },
          "What splits an edge (default: both)")->group(group);
  command.add_option_function<double>("--max-stretch", [&r, on](const double& x) { r.maxStretch = x; on(); },
                                      "Split edges that grow by this factor (default: 1.8)")
      ->type_name("FACTOR")->check(within(1.0, 1e6))->group(group);
  command.add_option_function<double>("--max-deviation", [&r, on](const double& x) { r.maxDeviation = x; on(); },
                                      "Split edges whose middle is off by this share of the size (default: 1e-3)")
      ->type_name("SHARE")->check(within(1e-12, 1.0))->group(group);
  command.add_option_function<std::uint32_t>("--max-vertices", [&r, on](const std::uint32_t& n) { r.maxVertices = n; on(); },
                                             "Stop inserting at this many vertices")
      ->type_name("N")->check(within(0, 4294967295.0))->group(group);
  if (method != Method::Skeleton) return;
  addWord(command, "--resample-like", {"paper"},
          [&r, &options, on](std::size_t) {
            r.by = resample::Criterion::Stretch;
            options.scene.tracking.midpointValue = gffd::MidpointValue::Mean;
            on();
          },
          "As in Qin et al. 2003: by stretch alone, with the mean of the ends' field values")->group(group);
}

void setVolumeLattice(volume::LocalOptions& options, const std::string& text) {
  options.nodes.reset();
  if (text == "auto") return;
  const std::vector<double> n = parseNumbers("--volume-lattice", text, 3);
  options.nodes.emplace();
  for (std::size_t k = 0; k < 3; ++k) {
    if (!(n[k] >= 4 && n[k] <= 64 && n[k] == std::floor(n[k])))
      throw CLI::ConversionError(fmt::format("--volume-lattice: {}, expected auto or three whole numbers from 4 to 64", text));
    (*options.nodes)[k] = static_cast<int>(n[k]);
  }
}

void addVolume(CLI::App& command, BatchOptions& options) {
  const char* group = "Volume";
  volume::LocalOptions& v = options.volumeOptions.options;
  const auto on = [&options] { options.volume = true; };
  command.add_flag_callback("--preserve-volume", on, "Give the object the volume back that the deformation took or added")
      ->group(group);
  command.add_option_function<std::string>(
      "--volume-mask", [&options, on](const std::string& text) { options.volumeMask = text; on(); },
      "Which part gives it: what moved (default: auto), all (none), what did not (rest), or a number from 0 to 1 a vertex")
      ->type_name("auto|none|rest|FILE")->group(group);
  command.add_option_function<std::string>(
      "--volume-lattice", [&v, on](const std::string& text) { setVolumeLattice(v, text); on(); },
      "Nodes of the pass's lattice along x, y, z (default: auto, from the thickness of the part)")
      ->type_name("auto|NX,NY,NZ")->group(group);
  addWord(command, "--volume-energy", {"surface", "springs"},
          [&v, on](std::size_t i) { v.energy = static_cast<volume::LocalEnergy>(i); on(); },
          "What the pass keeps small besides the displacement: the lattice's bending (default: surface) or stretched springs")
      ->group(group);
  addWord(command, "--volume-solver", {"exact", "augmented-lagrangian"},
          [&v, on](std::size_t i) { v.solver = static_cast<volume::LocalSolver>(i); on(); },
          "How it is solved (default: exact; augmented-lagrangian is the paper's, over levels of detail)")->group(group);
}

void addEditing(CLI::App& command, BatchOptions& options, Method method) {
  const char* group = "Editing";
  command.add_option("--mask", options.mask,
                     "Scale each vertex's displacement: a vertex attribute, or a file of one number a vertex")
      ->type_name("NAME|FILE")->group(group);
  if (method == Method::Skeleton)
    addWord(command, "--symmetry", {"x", "y", "z"},
            [&options](std::size_t i) { options.scene.symmetry = static_cast<scene::Axis>(i); },
            "Do the same on the other side of the mesh's middle")->group(group);
  command.add_flag_callback("--skip-invalid",
                            [&options] { options.scene.read.invalid = mesh::InvalidPoints::Keep; },
                            "Leave vertices with coordinates that are not finite as they are, instead of refusing the file")
      ->group(group);
  command.add_flag_callback("--weld", [&options] { options.scene.read.weld = mesh::Weld::Exact; },
                            "STL: join the facets' equal corners, so that the surface holds together; the file's facets come back")
      ->group(group);
}

void addOutput(CLI::App& command, BatchOptions& options, Method method) {
  const char* group = "Output";
  scene::Output& output = options.scene.output;
  command.add_option("--report", options.report, "Write a JSON report (of several meshes: a folder)")
      ->type_name("FILE")->group(group);
  command.add_option("--picture", options.picture, "Draw before and after (PNG; of several meshes: a folder)")
      ->type_name("FILE")->group(group);
  addWord(command, "--precision", {"keep", "double"},
          [&output](std::size_t i) { output.precision = static_cast<mesh::Precision>(i); },
          "Type of the written coordinates (default: keep, as in the input)")->group(group);
  addWord(command, "--normals", {"turn", "recompute", "keep"},
          [&output](std::size_t i) { output.normals = static_cast<scene::Normals>(i); },
          "What becomes of normals in the input (default: turn, with the surface)")->group(group);
  command.add_option("--attributes", options.attributes, method == Method::Lattice ? "Vertex attributes to add: status, residual, displacement, affected"
                                              : "Vertex attributes to add: status, residual, displacement")
      ->type_name("LIST")->delimiter(',')->check(method == Method::Lattice ? oneOf({"status", "residual", "displacement", "affected"})
                                        : oneOf({"status", "residual", "displacement"}))
      ->allow_extra_args(false)->group(group);
  command.add_option("--preview", output.preview, "Deform a proxy of about N vertices of the mesh instead of the mesh")
      ->type_name("N")->check(within(4, 4e9))->group(group);
  command.add_option("--frames", output.frames, "Write a sequence of N meshes from the input to the result")
      ->type_name("N")->check(within(2, 100000))->group(group);
  command.add_option("--save-scene", options.saveScene, "Write the scene with every choice made, for fielddeform run")
      ->type_name("FILE")->group(group);
}

void addCheck(CLI::App& command, BatchOptions& options, Method method) {
  const char* group = "Check";
  scene::Check& check = options.checkOptions;
  const auto on = [&options] { options.check = true; };
  command.add_flag_callback("--check", on, "Exit with 3 if the result has folded edges or flipped faces")->group(group);
  command.add_option_function<std::size_t>("--allow-folds", [&check, on](const std::size_t& n) { check.folds = n; on(); },
                                           "As --check, with up to N folded edges")
      ->type_name("N")->check(within(0, 1e15))->group(group);
  command.add_option_function<std::size_t>("--allow-flipped", [&check, on](const std::size_t& n) { check.flipped = n; on(); },
                                           "As --check, with up to N flipped faces")
      ->type_name("N")->check(within(0, 1e15))->group(group);
  if (method != Method::Skeleton) return;
  command.add_option_function<double>("--allow-residual", [&check, on](const double& x) { check.residual = x; on(); },
                                      "As --check, also of the greatest residual, in radii")
      ->type_name("NUMBER")->check(within(0.0, 1e6))->group(group);
}

void addFiles(CLI::App& command, BatchOptions& options, bool severalMeshes) {
  if (severalMeshes)
    command.add_option("MESH", options.meshes, "Meshes to deform (PLY, OBJ, STL, OFF)")->required()->type_name("");
  else
    command.add_option("MESH", options.meshes, "Mesh to deform (PLY, OBJ, STL, OFF)")->required()->expected(1)->type_name("");
  command.add_option("-o,--output", options.output,
                     severalMeshes ? "File to write, or a folder (ends in /, made if missing; needed for several meshes)"
                                   : "File to write, or a folder (ends in /, made if missing)")
      ->required()->type_name("FILE|DIR/");
}

}  // namespace

void addDistance(CLI::App& command, field::DistanceOptions& options) {
  const char* group = "Distance";
  addWord(command, "--distance", {"exact", "variational", "grid"},
          [&options](std::size_t i) { options.kind = static_cast<field::Distance>(i); },
          "How the distance to a primitive is found (default: exact)")->group(group);
  command.add_option_function<double>("--voxel", [&options](const double& h) { options.grid.voxel = h; },
                                      "grid: edge of a voxel, model units (default: from the tolerance)")
      ->type_name("NUMBER")->check(within(1e-300, 1e300))->group(group);
  command.add_option_function<double>(
      "--distance-tolerance",
      [&options](const double& t) { options.grid.tolerance = options.variational.tolerance = t; },
      "In radii: greatest error of the grid where the distance is smooth (default: 1e-3); residual at more than 2000 centres "
      "(default: 1e-6)")->type_name("NUMBER")->check(within(1e-6, 0.1))->group(group);
  addWord(command, "--sampling", {"trilinear", "quadratic"},
          [&options](std::size_t i) { options.grid.sampling = static_cast<field::Sampling>(i); },
          "grid: between the voxels (default: trilinear)")->group(group);
  addWord(command, "--grid-of", {"primitives", "blend"},
          [&options](std::size_t i) { options.grid.of = static_cast<field::GridOf>(i); },
          "grid: one of each primitive's distance, or one of the whole field (default: primitives)")->group(group);
  command.add_option("--distance-memory", options.grid.maxMegabytes,
                     "grid: refuse to take more than this (default: 2048)")->type_name("MB")->check(within(1e-3, 1e9))->group(group);
  command.add_option("--centres", options.variational.centres,
                     "variational: at most so many a primitive; above 2000 with compact support (default: 1000)")
      ->type_name("N")->check(within(16, 100000))->group(group);
  command.add_option("--smoothing", options.variational.smoothing, "variational: 0 interpolates (default: 0)")
      ->type_name("NUMBER")->check(within(0, 1e12))->group(group);
}

void addBatchOptions(CLI::App& command, Session& session, BatchOptions& options, bool severalMeshes, Method method) {
  addFiles(command, options, severalMeshes);
  addEditing(command, options, method);
  if (method == Method::Skeleton) {
    addMethod(command, options);
    addTracking(command, options);
    field::DistanceOptions& distance = options.scene.tracking.field.distance;
    addDistance(command, distance);
    addWord(command, "--grid-around", {"mesh", "influence"},
            [&distance](std::size_t i) { distance.grid.around = static_cast<field::GridAround>(i); },
            "grid: voxels near the mesh only, or wherever the skeleton reaches (default: mesh)")->group("Distance");
  }
  addResampling(command, options, method);
  addVolume(command, options);
  addOutput(command, options, method);
  addCheck(command, options, method);
  if (method == Method::Skeleton) markOptions(command, options);
  addThreads(command, session);
}

}  // namespace fielddeform::cli
