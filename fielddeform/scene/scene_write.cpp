#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/json_writer.h>
#include <fielddeform/map/extended_lattice_io.h>
#include <fielddeform/map/lattice_io.h>
#include <fielddeform/scene/detail/scene_json.h>
#include <fielddeform/scene/detail/volume_pass.h>
#include <fielddeform/scene/scene.h>
#include <fielddeform/skeleton/edit_io.h>
#include <fielddeform/skeleton/io.h>

#include <array>

namespace fielddeform::scene {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 3> kAxes{"x", "y", "z"};
constexpr std::array<std::string_view, 3> kBorders{"coincident", "free", "knots"};
constexpr std::array<std::string_view, 3> kCriteria{"stretch", "deviation", "both"};
constexpr std::array<std::string_view, 3> kNormals{"turn", "recompute", "keep"};

// Paths as they stand in a scene in `folder`: relative where that is possible.
std::string pathText(const fs::path& path, const fs::path& folder) {
  std::error_code ignored;
  const fs::path absolute = fs::absolute(path, ignored), base = fs::absolute(folder.empty() ? "." : folder, ignored);
  const fs::path relative = absolute.lexically_normal().lexically_relative(base.lexically_normal());
  return relative.empty() ? absolute.generic_string() : relative.generic_string();
}

void writeInlineSkeleton(JsonWriter& json, const skeleton::Skeleton& skeleton) {
  json.beginObject().key("primitives").beginArray();
  for (const auto& primitive : skeleton.primitives) skeleton::primitiveToJson(primitive, json);
  json.end();
  if (!skeleton.extras.empty()) json.key("extras").raw(skeleton.extras);
  json.end();
}

void writeSkeletons(JsonWriter& json, const Scene& scene, const fs::path* folder) {
  json.key("skeleton").beginObject();
  json.key("rest");
  if (const auto* path = std::get_if<fs::path>(&scene.rest)) {
    if (folder) json.value(pathText(*path, *folder));
    else json.null();
  } else if (const auto* skeleton = std::get_if<skeleton::Skeleton>(&scene.rest)) {
    writeInlineSkeleton(json, *skeleton);
  } else {
    json.beginObject(JsonLayout::Inline).member("fit", "axis").key("axis");
    if (const auto& axis = std::get<AxisRest>(scene.rest).axis) json.value(*axis);
    else json.value("auto");
    json.end();
  }
  json.key("posed");
  if (!scene.posed) json.null();
  else if (const auto* skeleton = std::get_if<skeleton::Skeleton>(&*scene.posed)) writeInlineSkeleton(json, *skeleton);
  else if (folder) json.value(pathText(std::get<fs::path>(*scene.posed), *folder));
  else json.null();
  if (!scene.volumeGrid.empty()) json.member("grid", scene.volumeGrid);
  json.key("pairs").beginArray();
  for (const auto& pair : scene.pairs) json.beginArray(JsonLayout::Inline).value(pair.rest).value(pair.posed).end();
  json.end();
  if (scene.tracking.radius) json.member("radius", *scene.tracking.radius);
  json.end();
}

void writeSculpt(JsonWriter& json, const Sculpt& sculpt, const fs::path* folder) {
  if (sculpt.moves.empty()) return;
  const auto text = [&](const fs::path& path) { return folder ? pathText(path, *folder) : std::string(); };
  json.key("sculpt").beginObject().key("moves").beginArray();
  for (const map::MoveSpec& move : sculpt.moves) map::moveToJson(move, json, text);
  json.end();
  if (!sculpt.pins.empty()) json.member("pins", text(sculpt.pins));
  json.member("refine", sculpt.maxNodes).member("tolerance", sculpt.tolerance).end();
}

void writeLatticeRule(JsonWriter& json, const LatticeRule& rule) {
  json.key("nodes").beginArray(JsonLayout::Inline);
  for (const int n : rule.nodes) json.value(n);
  json.end().member("basis", rule.basis == map::BasisKind::BSpline ? "bspline" : "bernstein");
  json.member("degree", rule.degree).member("border", kBorders[static_cast<std::size_t>(rule.border)]).key("box");
  if (rule.box) map::latticeBoxToJson(*rule.box, json);
  else json.value(rule.oriented ? "oriented" : "auto");
  json.member("padding", rule.padding).member("outside", rule.outside == map::Outside::Keep ? "keep" : "extend");
  json.key("moves").beginArray();
  for (const LatticeRule::Move& move : rule.moves) {
    json.beginObject(JsonLayout::Inline).key("node").beginArray(JsonLayout::Inline);
    for (const int n : move.node) json.value(n);
    json.end().member("by", move.by).end();
  }
  json.end();
}

void writeLattices(JsonWriter& json, const Scene& scene, const fs::path* folder) {
  json.key("lattices").beginArray();
  for (const LatticeStep& step : scene.lattices) {
    const bool file = std::holds_alternative<fs::path>(step.source);
    json.beginObject(file && step.sculpt.moves.empty() ? JsonLayout::Inline : JsonLayout::Lines);
    if (const auto* lattice = std::get_if<map::Lattice>(&step.source)) {
      map::latticeToJson(*lattice, json);
    } else if (const auto* extended = std::get_if<map::ExtendedLattice>(&step.source)) {
      map::extendedLatticeToJson(*extended, json);
    } else if (const auto* rule = std::get_if<LatticeRule>(&step.source)) {
      writeLatticeRule(json, *rule);
    } else {
      json.key("file");
      if (folder) json.value(pathText(std::get<fs::path>(step.source), *folder));
      else json.null();
      json.member("fit", step.fit);
    }
    writeSculpt(json, step.sculpt, folder);
    json.end();
  }
  json.end();
}

void writeDistance(JsonWriter& json, const field::DistanceOptions& d) {
  json.member("distance", field::toString(d.kind));
  if (d.kind == field::Distance::Grid) {
    if (d.grid.voxel) json.member("voxel", *d.grid.voxel);
    json.member("distance_tolerance", d.grid.tolerance).member("sampling", field::toString(d.grid.sampling));
    json.member("grid_of", field::toString(d.grid.of)).member("grid_around", field::toString(d.grid.around));
    json.member("memory_mb", d.grid.maxMegabytes);
  } else if (d.kind == field::Distance::Variational) {
    json.member("centres", d.variational.centres).member("smoothing", d.variational.smoothing);
    if (d.variational.tolerance != field::VariationalOptions{}.tolerance) json.member("distance_tolerance", d.variational.tolerance);
  }
}

void writeField(JsonWriter& json, const gffd::Options& t) {
  json.key("field").beginObject(JsonLayout::Inline);
  writeDistance(json, t.field.distance);
  json.member("potential", skeleton::toString(t.field.potential)).member("sharpness", t.field.sharpness).end();
}

void writeFalloff(JsonWriter& json, const gffd::Options& t) {
  json.key("falloff");
  if (t.falloff == gffd::Falloff::On) json.value(t.falloffBand);
  else json.value(t.falloff == gffd::Falloff::Auto ? "auto" : "off");
}

void writeTracking(JsonWriter& json, const gffd::Options& t) {
  json.key("tracking").beginObject(JsonLayout::Inline).member("predictor", gffd::toString(t.predictor));
  json.member("evaluation", gffd::toString(t.evaluation));
  json.member("corrector", t.corrector).member("tolerance", t.tolerance).member("max_iterations", t.maxIterations);
  writeFalloff(json, t);
  json.member("guard", t.guard).member("strict_value", t.strictValue).member("substeps", t.substeps);
  json.member("retry", t.retry);
  json.member("midpoint", t.midpointValue == gffd::MidpointValue::Mean ? "mean" : "sampled");
  if (!t.warpPairs.empty()) {
    json.key("warp_pairs").beginArray(JsonLayout::Inline);
    for (const auto& [rest, posed] : t.warpPairs) json.beginArray().value(rest).value(posed).end();
    json.end();
  }
  json.end();
}

void writeSkeletonMethod(JsonWriter& json, const Scene& scene, const fs::path* folder) {
  writeSkeletons(json, scene, folder);
  json.key("edits").beginArray();
  for (const auto& edit : scene.edits) skeleton::editToJson(edit, json);
  json.end();
  if (scene.symmetry) json.member("symmetry", toString(*scene.symmetry));
  if (scene.latticeNodes && takes(scene.method, MethodOption::Nodes)) {
    json.key("nodes").beginArray(JsonLayout::Inline);
    for (const int n : *scene.latticeNodes) json.value(n);
    json.end();
  }
  if (takes(scene.method, MethodOption::WireBlend)) {
    if (scene.wireBlend) json.member("wire_blend", *scene.wireBlend);
    else json.member("wire_blend", "sum");
    if (scene.wireLocal != 0) json.member("wire_local", scene.wireLocal);
  }
  if (takes(scene.method, MethodOption::Potential)) writeField(json, scene.tracking);
  if (takes(scene.method, MethodOption::Tracking)) {
    writeTracking(json, scene.tracking);
  } else if (takes(scene.method, MethodOption::Falloff)) {
    json.key("tracking").beginObject(JsonLayout::Inline);
    writeFalloff(json, scene.tracking);
    json.end();
  }
}

void writeResample(JsonWriter& json, const std::optional<resample::Options>& options) {
  json.key("resample");
  if (!options) {
    json.null();
    return;
  }
  json.beginObject(JsonLayout::Inline).member("by", kCriteria[static_cast<std::size_t>(options->by)]);
  json.member("max_stretch", options->maxStretch).member("max_deviation", options->maxDeviation).key("max_vertices");
  if (options->maxVertices) json.value(*options->maxVertices);
  else json.null();
  json.end();
}

void writeOutput(JsonWriter& json, const Output& output, const fs::path* folder) {
  json.key("output").beginObject();
  if (folder) {
    json.member("mesh", pathText(output.mesh, *folder));
    if (output.report) json.member("report", pathText(*output.report, *folder));
    if (output.picture) json.member("picture", pathText(*output.picture, *folder));
  }
  json.member("precision", output.precision == mesh::Precision::Double ? "double" : "keep");
  json.member("normals", toString(output.normals));
  json.key("attributes").beginArray(JsonLayout::Inline);
  if (output.statusAttribute) json.value("status");
  if (output.residualAttribute) json.value("residual");
  if (output.displacementAttribute) json.value("displacement");
  if (output.affectedAttribute) json.value("affected");
  json.end();
  if (output.frames > 0) json.member("frames", output.frames);
  json.end();
}

void writeCheck(JsonWriter& json, const Check& check) {
  json.key("check").beginObject(JsonLayout::Inline);
  const auto bound = [&](std::string_view key, const auto& value) {
    json.key(key);
    if (value) json.value(*value);
    else json.null();
  };
  bound("folds", check.folds);
  bound("flipped", check.flipped);
  bound("residual", check.residual);
  json.end();
}

}  // namespace

namespace detail {

void writeSceneBody(JsonWriter& json, const Scene& scene, const fs::path* folder) {
  json.member("seed", scene.seed);
  if (folder) {
    json.key("inputs").beginArray();
    for (const auto& input : scene.inputs) json.value(pathText(input, *folder));
    json.end();
  }
  if (scene.read.invalid == mesh::InvalidPoints::Keep) json.member("skip_invalid", true);
  if (scene.read.weld == mesh::Weld::Exact) json.member("weld", true);
  json.member("method", methodOf(scene));
  if (scene.lattices.empty()) writeSkeletonMethod(json, scene, folder);
  else writeLattices(json, scene, folder);
  writeResample(json, scene.resample);
  json.key("volume");
  if (scene.volume)
    writeVolumePass(json, *scene.volume, folder ? [&](const fs::path& path) { return pathText(path, *folder); }
                                                : std::function<std::string(const fs::path&)>{});
  else json.null();
  if (scene.mask) {
    json.key("mask").beginObject(JsonLayout::Inline);
    if (!scene.mask->attribute.empty()) json.member("attribute", scene.mask->attribute);
    else if (folder) json.member("file", pathText(scene.mask->file, *folder));
    json.end();
  }
  writeOutput(json, scene.output, folder);
  if (scene.check) writeCheck(json, *scene.check);
  if (!scene.extras.empty()) json.key("extras").raw(scene.extras);
}

}  // namespace detail

std::string formatScene(const Scene& scene, const fs::path& folder) {
  JsonWriter json;
  json.beginObject().member("format", "fielddeform-scene").member("version", 1);
  detail::writeSceneBody(json, scene, &folder);
  json.end();
  return json.text();
}

void writeScene(const Scene& scene, const fs::path& path) {
  writeTextFile(path, formatScene(scene, path.parent_path()));
}

std::string_view toString(Axis axis) noexcept { return kAxes[static_cast<std::size_t>(axis)]; }
std::string_view toString(Normals normals) noexcept { return kNormals[static_cast<std::size_t>(normals)]; }

}  // namespace fielddeform::scene
