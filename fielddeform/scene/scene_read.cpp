#include <fielddeform/core/angle.h>
#include <fielddeform/core/detail/json_fields.h>
#include <fielddeform/core/error.h>
#include <fielddeform/core/json_reader.h>
#include <fielddeform/map/extended_lattice_io.h>
#include <fielddeform/map/lattice_io.h>
#include <fielddeform/scene/detail/volume_pass.h>
#include <fielddeform/scene/scene.h>
#include <fielddeform/skeleton/edit_io.h>
#include <fielddeform/skeleton/io.h>
#include <fmt/format.h>

#include <vector>

namespace fielddeform::scene {
namespace {

using fielddeform::detail::given;

namespace fs = std::filesystem;

constexpr std::uint64_t kMaxAxisNodes = 65536;

fs::path readPath(const JsonValue& value, const fs::path& folder) {
  const std::string text = value.string();
  if (text.empty()) value.fail("an empty path", "a file");
  if (text.find('\0') != std::string::npos) value.fail("a path with a zero byte", "a file");
  return (folder / fs::path(text)).lexically_normal();
}

void setFlag(const JsonValue& object, std::string_view key, bool& flag) {
  if (const auto value = given(object, key)) flag = value->boolean();
}

skeleton::Skeleton readInlineSkeleton(const JsonValue& object) {
  object.allowKeys({"primitives", "extras"});
  skeleton::Skeleton skeleton;
  for (const JsonValue item : object.require("primitives").array())
    skeleton.primitives.push_back(skeleton::primitiveFromJson(item));
  if (const auto extras = given(object, "extras")) {
    if (extras->kind() != JsonKind::Object) extras->fail("", "an object");
    skeleton.extras = extras->text();
  }
  try {
    skeleton::validate(skeleton);
  } catch (const std::invalid_argument& problem) {
    object.fail(problem.what(), "a valid skeleton");
  }
  return skeleton;
}

RestSource readRest(const JsonValue& value, const fs::path& folder) {
  if (value.kind() == JsonKind::String) return readPath(value, folder);
  if (value.kind() != JsonKind::Object) value.fail("", "a file's path, a skeleton, or {\"fit\": \"axis\"}");
  if (!value.find("fit")) return readInlineSkeleton(value);
  value.allowKeys({"fit", "axis"});
  value.require("fit").word({"axis"});
  AxisRest rest;
  if (const auto axis = given(value, "axis")) rest.axis = skeleton::directionFromJson(*axis);
  return rest;
}

void readSkeletons(const JsonValue& object, const fs::path& folder, Scene& scene) {
  object.allowKeys({"rest", "posed", "grid", "pairs", "radius"});
  scene.rest = readRest(object.require("rest"), folder);
  if (const auto posed = given(object, "posed")) {
    if (posed->kind() == JsonKind::String) scene.posed = readPath(*posed, folder);
    else if (posed->kind() == JsonKind::Object) scene.posed = readInlineSkeleton(*posed);
    else posed->fail("", "a file's path or a skeleton");
  }
  if (const auto grid = given(object, "grid")) scene.volumeGrid = grid->string();
  if (const auto pairs = given(object, "pairs")) {
    for (const JsonValue pair : pairs->array()) {
      if (pair.array().size() != 2) pair.fail("", "[\"NAME AT REST\", \"NAME WHEN POSED\"]");
      std::vector<std::string> names;
      for (const JsonValue name : pair.array()) names.push_back(name.string());
      scene.pairs.push_back({names[0], names[1]});
    }
  }
  if (const auto radius = given(object, "radius")) scene.tracking.radius = radius->positive();
}

std::array<int, 3> readNodeNumbers(const JsonValue& value, std::uint64_t low, std::uint64_t high) {
  std::array<int, 3> numbers{};
  int* next = numbers.data();
  for (const JsonValue number : value.array(3)) *next++ = static_cast<int>(number.integer(low, high));
  return numbers;
}

LatticeRule readLatticeRule(const JsonValue& object) {
  object.allowKeys({"nodes", "basis", "degree", "border", "box", "padding", "outside", "moves", "sculpt"});
  LatticeRule rule;
  rule.nodes = readNodeNumbers(object.require("nodes"), 2, kMaxAxisNodes);
  if (const auto word = given(object, "basis")) rule.basis = static_cast<map::BasisKind>(word->word({"bernstein", "bspline"}));
  if (const auto n = given(object, "degree")) rule.degree = static_cast<int>(n->integer(1, 3));
  if (const auto word = given(object, "border")) rule.border = static_cast<map::Border>(word->word({"coincident", "free"}));
  if (const auto box = given(object, "box")) {
    if (box->kind() == JsonKind::String) rule.oriented = box->word({"auto", "oriented"}) == 1;
    else rule.box = map::latticeBoxFromJson(*box);
  }
  if (const auto padding = given(object, "padding")) rule.padding = padding->inRange(0, 1e6);
  if (const auto word = given(object, "outside")) rule.outside = static_cast<map::Outside>(word->word({"extend", "keep"}));
  if (const auto moves = given(object, "moves")) {
    for (const JsonValue move : moves->array()) {
      move.allowKeys({"node", "by"});
      rule.moves.push_back({readNodeNumbers(move.require("node"), 0, kMaxAxisNodes), move.require("by").vec3()});
    }
  }
  return rule;
}

Sculpt readSculpt(const JsonValue& object, const fs::path& folder) {
  object.allowKeys({"moves", "pins", "refine", "tolerance"});
  Sculpt sculpt;
  const JsonValue moves = object.require("moves");
  for (const JsonValue move : moves.array()) sculpt.moves.push_back(map::moveFromJson(move, folder));
  if (sculpt.moves.empty()) moves.fail("no moves", "at least one");
  if (const auto pins = given(object, "pins")) sculpt.pins = readPath(*pins, folder);
  if (const auto refine = given(object, "refine")) sculpt.maxNodes = static_cast<std::size_t>(refine->integer(0, 1u << 24));
  if (const auto tolerance = given(object, "tolerance")) sculpt.tolerance = tolerance->positive();
  return sculpt;
}

// A file's path, {"file": PATH, "fit": true}, a lattice itself ("axes" among its keys, or "cells", "parts"), or a rule.
LatticeStep readLatticeStep(const JsonValue& value, const fs::path& folder) {
  if (value.kind() == JsonKind::String) return {readPath(value, folder), false, {}};
  if (value.kind() != JsonKind::Object) value.fail("", "a file's path, a lattice, or a rule that makes one");
  LatticeStep step;
  if (const auto file = value.find("file")) {
    value.allowKeys({"file", "fit", "sculpt"});
    step.source = readPath(*file, folder);
    setFlag(value, "fit", step.fit);
  } else if (value.find("axes")) {
    step.source = map::latticeFromJson(value);
  } else if (map::isExtendedLattice(value)) {
    step.source = map::extendedLatticeFromJson(value);
    if (const auto sculpt = value.find("sculpt")) sculpt->fail("", "no \"sculpt\": extended lattices do not follow points");
  } else {
    step.source = readLatticeRule(value);
  }
  if (const auto sculpt = given(value, "sculpt")) step.sculpt = readSculpt(*sculpt, folder);
  return step;
}

void readDistance(const JsonValue& object, field::DistanceOptions& d) {
  if (const auto kind = given(object, "distance"))
    d.kind = static_cast<field::Distance>(kind->word({"exact", "variational", "grid"}));
  if (const auto voxel = given(object, "voxel")) d.grid.voxel = voxel->positive();
  if (const auto tolerance = given(object, "distance_tolerance"))
    d.grid.tolerance = d.variational.tolerance = tolerance->inRange(1e-6, 0.1);
  if (const auto sampling = given(object, "sampling"))
    d.grid.sampling = static_cast<field::Sampling>(sampling->word({"trilinear", "quadratic"}));
  if (const auto of = given(object, "grid_of")) d.grid.of = static_cast<field::GridOf>(of->word({"primitives", "blend"}));
  if (const auto around = given(object, "grid_around"))
    d.grid.around = static_cast<field::GridAround>(around->word({"mesh", "influence"}));
  if (const auto memory = given(object, "memory_mb")) d.grid.maxMegabytes = memory->inRange(1e-3, 1e9);
  if (const auto centres = given(object, "centres")) d.variational.centres = centres->integer(16, 100000);
  if (const auto smoothing = given(object, "smoothing")) d.variational.smoothing = smoothing->inRange(0, 1e12);
}

void readField(const JsonValue& object, MethodKind method, field::FieldOptions& field) {
  if (!takes(method, MethodOption::Tracking)) {
    object.allowKeys({"distance", "potential", "sharpness"});
    if (const auto kind = given(object, "distance")) kind->word({"exact"});
  }
  object.allowKeys({"distance", "potential", "sharpness", "voxel", "distance_tolerance", "sampling", "grid_of", "grid_around",
                    "memory_mb", "centres", "smoothing"});
  readDistance(object, field.distance);
  if (const auto potential = given(object, "potential"))
    field.potential =
        static_cast<skeleton::Potential>(potential->word({"exponential", "gaussian", "metaball", "soft-object"}));
  if (const auto sharpness = given(object, "sharpness")) field.sharpness = sharpness->positive();
}

void readFalloff(const JsonValue& value, gffd::Options& tracking) {
  if (value.kind() == JsonKind::Number) {
    tracking.falloff = gffd::Falloff::On;
    tracking.falloffBand = value.inRange(0, 1);
    if (tracking.falloffBand == 0) value.fail("", "> 0, or \"off\"");
    return;
  }
  tracking.falloff = static_cast<gffd::Falloff>(value.word({"auto", "on", "off"}));
}

void readTracking(const JsonValue& object, MethodKind method, gffd::Options& t) {
  if (!takes(method, MethodOption::Tracking)) object.allowKeys({"falloff"});
  object.allowKeys({"predictor", "evaluation", "corrector", "tolerance", "max_iterations", "falloff", "guard", "strict_value",
                    "substeps", "retry", "midpoint", "warp_pairs"});
  if (const auto word = given(object, "predictor"))
    t.predictor = static_cast<gffd::Predictor>(word->word({"auto", "mls", "axial", "warp", "gradient"}));
  if (const auto word = given(object, "evaluation"))
    t.evaluation = static_cast<gffd::Evaluation>(word->word({"auto", "exact", "grid"}));
  setFlag(object, "corrector", t.corrector);
  if (const auto tolerance = given(object, "tolerance")) t.tolerance = tolerance->positive();
  if (const auto n = given(object, "max_iterations")) t.maxIterations = static_cast<int>(n->integer(1, 100000));
  if (const auto falloff = given(object, "falloff")) readFalloff(*falloff, t);
  setFlag(object, "guard", t.guard);
  setFlag(object, "strict_value", t.strictValue);
  if (const auto n = given(object, "substeps")) t.substeps = static_cast<int>(n->integer(1, 64));
  setFlag(object, "retry", t.retry);
  if (const auto word = given(object, "midpoint"))
    t.midpointValue = static_cast<gffd::MidpointValue>(word->word({"sampled", "mean"}));
  if (const auto pairs = given(object, "warp_pairs")) {
    for (const JsonValue pair : pairs->array()) {
      std::vector<Vec3> ends;
      for (const JsonValue end : pair.array(2)) ends.push_back(end.vec3());
      t.warpPairs.emplace_back(ends[0], ends[1]);
    }
  }
}

resample::Options readResample(const JsonValue& object) {
  object.allowKeys({"by", "max_stretch", "max_deviation", "max_vertices"});
  resample::Options options;
  if (const auto by = given(object, "by"))
    options.by = static_cast<resample::Criterion>(by->word({"stretch", "deviation", "both"}));
  if (const auto stretch = given(object, "max_stretch")) options.maxStretch = stretch->inRange(1, 1e6);
  if (const auto deviation = given(object, "max_deviation")) options.maxDeviation = deviation->positive();
  if (const auto n = given(object, "max_vertices")) options.maxVertices = n->integer(1, kNoIndex - 1);
  return options;
}

Mask readMask(const JsonValue& object, const fs::path& folder) {
  object.allowKeys({"attribute", "file"});
  Mask mask;
  const auto attribute = given(object, "attribute"), file = given(object, "file");
  if (attribute.has_value() == file.has_value()) object.fail("", "either \"attribute\" or \"file\"");
  if (attribute) mask.attribute = attribute->string();
  if (attribute && mask.attribute.empty()) attribute->fail("", "a name");
  if (file) mask.file = readPath(*file, folder);
  return mask;
}

void readOutput(const JsonValue& object, const fs::path& folder, Output& output) {
  object.allowKeys({"mesh", "report", "picture", "precision", "normals", "attributes", "frames"});
  output.mesh = readPath(object.require("mesh"), folder);
  if (const auto path = given(object, "report")) output.report = readPath(*path, folder);
  if (const auto path = given(object, "picture")) output.picture = readPath(*path, folder);
  if (const auto word = given(object, "precision"))
    output.precision = static_cast<mesh::Precision>(word->word({"keep", "double"}));
  if (const auto word = given(object, "normals"))
    output.normals = static_cast<Normals>(word->word({"turn", "recompute", "keep"}));
  if (const auto list = given(object, "attributes")) {
    for (const JsonValue item : list->array()) {
      const std::size_t which = item.word({"status", "residual", "displacement", "affected"});
      (which == 0   ? output.statusAttribute
       : which == 1 ? output.residualAttribute
       : which == 2 ? output.displacementAttribute
                    : output.affectedAttribute) = true;
    }
  }
  if (const auto n = given(object, "frames")) {
    output.frames = static_cast<int>(n->integer(0, 100000));
    if (output.frames == 1) n->fail("", "0, or at least 2");
  }
}

Check readCheck(const JsonValue& object) {
  object.allowKeys({"folds", "flipped", "residual"});
  Check check;
  const auto bound = [&](std::string_view key, std::optional<std::size_t>& value) {
    const auto found = object.find(key);
    if (!found) return;
    if (found->isNull()) value.reset();
    else value = found->integer(0, std::uint64_t{1} << 53);
  };
  bound("folds", check.folds);
  bound("flipped", check.flipped);
  if (const auto residual = given(object, "residual")) check.residual = residual->nonNegative();
  return check;
}

void readWireBlend(const JsonValue& value, Scene& scene) {
  if (value.kind() == JsonKind::Number) {
    scene.wireBlend = value.inRange(0, 100);
  } else {
    value.word({"sum"});
    scene.wireBlend.reset();
  }
}

// Keys that the method has no use for are refused, not ignored. A lattice is given, or fitted to a skeleton.
void refuseKeys(const JsonValue& root, MethodKind method, bool givenLattices) {
  std::vector<const char*> useless;
  if (givenLattices) useless = {"skeleton", "edits", "symmetry"};
  else if (method != MethodKind::Lattice) useless = {"lattices"};
  const auto unless = [&](MethodOption option, const char* key) {
    if (givenLattices || !takes(method, option)) useless.push_back(key);
  };
  unless(MethodOption::Potential, "field");
  unless(MethodOption::Falloff, "tracking");
  unless(MethodOption::Nodes, "nodes");
  unless(MethodOption::WireBlend, "wire_blend");
  unless(MethodOption::WireBlend, "wire_local");
  for (const char* key : useless)
    if (const auto other = given(root, key))
      other->fail(fmt::format("\"{}\"", key), fmt::format("no such key with the method \"{}\"", toString(method)));
}

// What deforms: a skeleton and its edits, or lattices.
void readMethod(const JsonValue& root, const fs::path& folder, Scene& scene) {
  if (const auto method = given(root, "method")) {
    std::vector<std::string_view> words;
    for (const MethodInfo& info : methods()) words.push_back(info.word);
    scene.method = static_cast<MethodKind>(method->word(words));
  }
  const bool lattice = scene.method == MethodKind::Lattice && !given(root, "skeleton");
  refuseKeys(root, scene.method, lattice || given(root, "lattices"));
  if (const auto nodes = given(root, "nodes")) scene.latticeNodes = readNodeNumbers(*nodes, 2, 64);
  if (const auto blend = given(root, "wire_blend")) readWireBlend(*blend, scene);
  if (const auto local = given(root, "wire_local")) scene.wireLocal = local->inRange(0, 100);
  if (lattice) {
    const JsonValue lattices = root.require("lattices");
    for (const JsonValue step : lattices.array()) scene.lattices.push_back(readLatticeStep(step, folder));
    if (scene.lattices.empty()) lattices.fail("no lattices", "at least one");
    return;
  }
  readSkeletons(root.require("skeleton"), folder, scene);
  if (const auto edits = given(root, "edits"))
    for (const JsonValue edit : edits->array()) scene.edits.push_back(skeleton::editFromJson(edit));
}

void readParts(const JsonValue& root, const fs::path& folder, Scene& scene) {
  if (const auto seed = given(root, "seed")) scene.seed = seed->integer(0, std::uint64_t{1} << 53);
  const JsonValue inputs = root.require("inputs");
  for (const JsonValue input : inputs.array()) scene.inputs.push_back(readPath(input, folder));
  if (scene.inputs.empty()) inputs.fail("no inputs", "at least one mesh");
  readMethod(root, folder, scene);
  bool skipInvalid = false;
  setFlag(root, "skip_invalid", skipInvalid);
  if (skipInvalid) scene.read.invalid = mesh::InvalidPoints::Keep;
  bool weld = false;
  setFlag(root, "weld", weld);
  if (weld) scene.read.weld = mesh::Weld::Exact;
  if (const auto symmetry = given(root, "symmetry")) scene.symmetry = static_cast<Axis>(symmetry->word({"x", "y", "z"}));
  if (const auto field = given(root, "field")) readField(*field, scene.method, scene.tracking.field);
  if (const auto tracking = given(root, "tracking")) readTracking(*tracking, scene.method, scene.tracking);
  if (const auto resample = given(root, "resample")) scene.resample = readResample(*resample);
  if (const auto volume = given(root, "volume")) scene.volume = detail::readVolumePass(*volume, folder);
  if (const auto mask = given(root, "mask")) scene.mask = readMask(*mask, folder);
  readOutput(root.require("output"), folder, scene.output);
  if (const auto check = given(root, "check")) scene.check = readCheck(*check);
  if (const auto extras = given(root, "extras")) {
    if (extras->kind() != JsonKind::Object) extras->fail("", "an object");
    scene.extras = extras->text();
  }
}

void checkTogether(const JsonValue& root, const Scene& scene) {
  if (scene.posed && !scene.edits.empty())
    root.require("edits").fail("\"edits\" besides \"skeleton\": {\"posed\": ...}", "one of them");
}

Scene sceneOf(const JsonDocument& document) {
  document.requireFormat("fielddeform-scene", 1);
  const JsonValue root = document.root();
  root.allowKeys({"format", "version", "seed", "inputs", "skip_invalid", "weld", "method", "nodes", "wire_blend", "wire_local", "lattices", "skeleton", "edits", "symmetry",
                  "field", "tracking", "resample", "volume", "mask", "output", "check", "extras"});
  Scene scene;
  readParts(root, document.path().parent_path(), scene);
  checkTogether(root, scene);
  return scene;
}

}  // namespace

Scene parseScene(std::string text, const fs::path& path) {
  return sceneOf(JsonDocument::parse(std::move(text), path));
}

Scene readScene(const fs::path& path) { return sceneOf(JsonDocument::read(path)); }

}  // namespace fielddeform::scene
