// fielddeform casteljau: a mesh carried along a Bezier curve with handles.
#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/json_writer.h>
#include <fielddeform/map/casteljau_io.h>
#include <fielddeform/mesh/io.h>
#include <fielddeform/mesh/normals.h>
#include <fielddeform/mesh/quality.h>
#include <fmt/format.h>

#include <algorithm>

#include "command.h"
#include "values.h"

namespace fielddeform::cli {
namespace {

struct CasteljauOptions {
  std::string mesh, curve, output, save, report;
  int straight = 0;
  std::optional<map::FrameAxis> frame;
  std::optional<map::Outside> outside;
  bool levels = false;
  std::optional<mesh::NormalUpdate> normals = mesh::NormalUpdate::Turn;
  mesh::WriteOptions write;
};

/// The curve with its frame laid around the mesh.
map::CasteljauFile curveOf(const CasteljauOptions& o, Points points) {
  map::CasteljauFile file;
  if (!o.curve.empty()) file = map::readCasteljau(o.curve);
  if (o.frame) file.frame = *o.frame;
  if (o.outside) file.outside = *o.outside;
  if (const auto* axis = std::get_if<map::FrameAxis>(&file.frame)) file.frame = map::fitFrame(points, *axis);
  if (o.curve.empty()) file.curve = map::straightCurve(std::get<map::LatticeBox>(file.frame), o.straight);
  return file;
}

void writePosed(const CasteljauOptions& o, const mesh::Mesh& rest, std::vector<Vec3> posed, const std::filesystem::path& path, Terminal& terminal) {
  mesh::Mesh out = rest;
  if (o.normals) mesh::updateNormals(out, rest.positions(), posed, *o.normals);
  out.setPositions(std::move(posed));
  for (const std::string& dropped : mesh::writeMesh(out, path, o.write, &terminal).dropped)
    terminal.note(fmt::format("fielddeform: {}: dropped {}", path.string(), dropped));
}

/// All images of all levels: OUT_level1_0 ..., before the last, which is OUT itself.
void writeLevels(const CasteljauOptions& o, const map::CasteljauMap& map, const map::Binding& binding, const mesh::Mesh& rest, Terminal& terminal) {
  int degree = map::kMaxCasteljauDegree;
  for (const auto& piece : map.posed().pieces) degree = std::min(degree, piece.degree());
  const std::filesystem::path path = o.output;
  std::vector<Vec3> x(rest.vertexCount());
  for (int j = 1; j < degree; ++j)
    for (int i = 0; i <= degree - j; ++i) {
      map.level(binding, j, i, x);
      const auto to = withSuffix(path, fmt::format("_level{}_{}", j, i), path.extension().string());
      writePosed(o, rest, x, to, terminal);
      terminal.print(fmt::format("{}: level {}, segment {}", to.string(), j, i));
    }
}

std::string reportText(const CasteljauOptions& o, const map::CasteljauFile& file, const StatusCounts& counts, std::size_t folds) {
  const map::JointGaps gaps = map::jointGaps(file.curve);
  JsonWriter json;
  json.beginObject().member("mesh", o.mesh).key("status").beginObject(JsonLayout::Inline);
  for (std::size_t s = 0; s < kStatusCount; ++s) json.member(toString(static_cast<Status>(s)), counts[s]);
  json.end().member("folds", folds).key("joints").beginObject(JsonLayout::Inline).member("position", gaps.position);
  json.member("handle", gaps.handle).member("slope", gaps.slope).member("handle_slope", gaps.handleSlope).end();
  return json.end().text();
}

int run(const CasteljauOptions& o, Terminal& terminal) {
  const mesh::Mesh rest = mesh::readMesh(o.mesh, {}, nullptr, &terminal);
  const map::CasteljauFile file = curveOf(o, rest.positions());
  const map::CasteljauMap map(file.curve, std::get<map::LatticeBox>(file.frame), file.outside);
  terminal.beginStage("deform");
  const auto binding = map.bind(rest.positions());
  std::vector<Vec3> posed(rest.vertexCount());
  std::vector<Status> status(rest.vertexCount());
  map.apply(*binding, {.position = posed, .safe = {}, .status = status, .residual = {}}, terminal);
  const StatusCounts counts = countStatuses(status);
  const std::size_t folds = mesh::countFolds(rest, rest.positions(), posed);
  if (!o.save.empty()) map::writeCasteljau(file, o.save);
  if (!o.report.empty()) writeTextFile(o.report, reportText(o, file, counts, folds));
  if (o.levels) writeLevels(o, map, *binding, rest, terminal);
  writePosed(o, rest, std::move(posed), o.output, terminal);
  terminal.print(fmt::format("{}: {} vertices moved, {} fixed, {} folds", o.output, counts[static_cast<std::size_t>(Status::Converged)],
                             counts[static_cast<std::size_t>(Status::Fixed)], folds));
  return kDone;
}

}  // namespace

void addCasteljau(CLI::App& app, Session& session) {
  const auto o = optionsOf<CasteljauOptions>();
  auto* command = app.add_subcommand("casteljau", "Carry meshes along a curve with handles (generalised de Casteljau)");
  command->add_option("MESH", o->mesh, "Mesh (PLY, OBJ, STL, OFF)")->required()->type_name("");
  command->add_option("-o,--output", o->output, "Mesh to write")->required()->type_name("FILE");
  auto* curve = command->add_option("--curve", o->curve, "Curve with handles (JSON)")->type_name("FILE");
  command->add_option("--straight", o->straight, "A curve of degree N instead that leaves the mesh as it is: to save and edit")
      ->type_name("N")->check(within(1, map::kMaxCasteljauDegree))->excludes(curve);
  addWord(*command, "--frame", {"auto", "x", "y", "z", "oriented"}, [o](std::size_t i) { o->frame = static_cast<map::FrameAxis>(i); },
          "Axis of the mesh's box that becomes the curve, whatever the file says (default: the file's, auto: the longest)");
  addWord(*command, "--outside", {"extend", "keep"}, [o](std::size_t i) { o->outside = static_cast<map::Outside>(i); },
          "Points beyond the curve's ends: carried along its tangents, or left alone (default: the file's, extend)");
  command->add_flag("--levels", o->levels, "Also write the images of every level of the algorithm: OUT_level1_0, OUT_level1_1, ...");
  addWord(*command, "--normals", {"turn", "recompute", "keep"},
          [o](std::size_t i) { o->normals = i == 2 ? std::nullopt : std::optional(static_cast<mesh::NormalUpdate>(i)); },
          "Normals in the input: turned with the surface (default), recomputed, or kept");
  addWord(*command, "--precision", {"keep", "double"}, [o](std::size_t i) { o->write.precision = static_cast<mesh::Precision>(i); },
          "Type of coordinates in the output: the input's (default), or double");
  command->add_option("--save-curve", o->save, "Write the curve with its frame (JSON)")->type_name("FILE");
  command->add_option("--report", o->report, "Write a report (JSON)")->type_name("FILE");
  addThreads(*command, session);
  command->footer("Example:\n  fielddeform casteljau bar.ply --straight 2 --save-curve curve.json -o same.ply");
  command->callback([&session, o] {
    if (o->curve.empty() && o->straight == 0) throw CLI::ValidationError("expected --curve or --straight");
    session.run = [o](Terminal& terminal) { return run(*o, terminal); };
  });
}

}  // namespace fielddeform::cli
