// fielddeform solid: free-form solids that keep their sizes.
#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/error.h>
#include <fielddeform/core/json_writer.h>
#include <fielddeform/mesh/io.h>
#include <fielddeform/mesh/normals.h>
#include <fielddeform/mesh/quality.h>
#include <fielddeform/solid/regularity.h>
#include <fielddeform/solid/size.h>
#include <fielddeform/solid/solid_io.h>
#include <fielddeform/solid/solid_map.h>
#include <fielddeform/solid/tessellate.h>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "command.h"
#include "values.h"

namespace fielddeform::cli {
namespace {

struct SolidOptions {
  std::string object, output, embed, saveObject, report;
  std::vector<std::string> volumes, moves, fixes, fixSides, targets;
  std::optional<solid::Objective> objective;
  std::optional<solid::Problem::Inner> inner;
  solid::Options solve;
  int tessellate = 16, samples = 0, frames = 0;
  double reach = 0.5;
  bool check = false;
  mesh::WriteOptions write;
};

std::optional<double> number(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return {};
  return value;
}

/// "NAME=REST" @throw CLI::ConversionError
std::pair<std::string, std::string> split(const std::string& option, const std::string& text, char at, const char* expected) {
  const std::size_t place = text.rfind(at);
  if (place == std::string::npos || place == 0) throw CLI::ConversionError(fmt::format("{}: \"{}\", expected {}", option, text, expected));
  return {text.substr(0, place), text.substr(place + 1)};
}

/// The value of a size: "1.2", "x1.2", "free", "keep".
solid::SizeSpec sizeOf(const std::string& text) {
  if (text == "free") return {solid::SizeSpec::Kind::Free, 1};
  if (text == "keep") return {};
  const bool factor = text.starts_with("x");
  if (const auto value = number(std::string_view(text).substr(factor ? 1 : 0)))
    return {factor ? solid::SizeSpec::Kind::Factor : solid::SizeSpec::Kind::Value, *value};
  throw CLI::ConversionError(fmt::format("--volume: \"{}\", expected a number, xFACTOR, keep or free", text));
}

/// A size, or a range of them "A..B" for frames.
struct Target {
  std::string name;
  solid::SizeSpec from, to;
};
Target targetOf(const std::string& text) {
  const auto [name, value] = split("--volume", text, '=', "NAME=VALUE, NAME=xFACTOR, NAME=A..B, NAME=keep or NAME=free");
  const std::size_t range = value.find("..");
  if (range == std::string::npos) return {name, {}, sizeOf(value)};
  return {name, sizeOf(value.substr(0, range)), sizeOf(value.substr(range + 2))};
}

std::size_t solidOf(const solid::SolidFile& file, const std::string& option, const std::string& name) {
  const std::size_t s = file.object.find(name);
  if (s < file.object.solids.size()) return s;
  std::string names;
  for (const auto& each : file.object.solids) names += (names.empty() ? "" : ", ") + each.name;
  throw std::invalid_argument(fmt::format("{}: no solid is named \"{}\" (there are: {})", option, name, names));
}

/// "NAME:I,J,K" @throw CLI::ConversionError
std::pair<std::string, std::array<int, 3>> indexed(const std::string& option, const std::string& text) {
  const auto [name, index] = split(option, text, ':', "NAME:I,J,K");
  const auto n = parseNumbers(option, index, 3);
  std::array<int, 3> ijk{};
  for (std::size_t a = 0; a < 3; ++a) {
    if (!(n[a] >= 0 && n[a] <= solid::kMaxDegree) || n[a] != std::floor(n[a])) throw CLI::ConversionError(fmt::format("{}: \"{}\", expected NAME:I,J,K", option, text));
    ijk[a] = static_cast<int>(n[a]);
  }
  return {name, ijk};
}

solid::PointRef controlPoint(const solid::SolidFile& file, const std::string& option, const std::string& text) {
  const auto [name, ijk] = indexed(option, text);
  solid::PointRef out{solidOf(file, option, name), ijk};
  solid::combination(file.object, out);
  return out;
}

Vec3 vectorOf(const std::string& option, const std::string& text) {
  const auto n = parseNumbers(option, text, 3);
  return {n[0], n[1], n[2]};
}

/// Options whose form is wrong are wrong usage, before any file is read.
void requireForm(const SolidOptions& o) {
  for (const std::string& text : o.moves) {
    const auto [point, by] = split("--move", text, '=', "NAME:I,J,K=DX,DY,DZ");
    indexed("--move", point);
    vectorOf("--move", by);
  }
  for (const std::string& text : o.fixes) indexed("--fix", text);
  for (const std::string& text : o.targets) {
    const auto [point, to] = split("--target", text, '=', "NAME:U,V,W=X,Y,Z");
    vectorOf("--target", split("--target", point, ':', "NAME:U,V,W=X,Y,Z").second);
    vectorOf("--target", to);
  }
}

/// The file with what the command line adds.
solid::SolidFile fileOf(const SolidOptions& o, const std::vector<Target>& targets) {
  solid::SolidFile file = solid::readSolids(o.object);
  for (const std::string& text : o.moves) {
    const auto [point, by] = split("--move", text, '=', "NAME:I,J,K=DX,DY,DZ");
    file.moves.push_back({controlPoint(file, "--move", point), vectorOf("--move", by)});
  }
  for (const std::string& text : o.fixes) {
    solid::ConstraintSpec c;
    c.a = controlPoint(file, "--fix", text);
    file.constraints.push_back(c);
  }
  for (const std::string& text : o.fixSides) {
    solid::ConstraintSpec c;
    c.kind = solid::ConstraintSpec::Kind::FixSide;
    c.side = solid::parseFace(file.object, text);
    file.constraints.push_back(c);
  }
  for (const std::string& text : o.targets) {
    const auto [point, to] = split("--target", text, '=', "NAME:U,V,W=X,Y,Z");
    const auto [name, uvw] = split("--target", point, ':', "NAME:U,V,W=X,Y,Z");
    solid::ConstraintSpec c;
    c.a = {solidOf(file, "--target", name), vectorOf("--target", uvw)};
    solid::combination(file.object, c.a);
    c.value = vectorOf("--target", to);
    file.constraints.push_back(c);
  }
  for (const Target& t : targets) file.sizes.at(solidOf(file, "--volume", t.name)) = t.to;
  if (o.objective) file.objective = *o.objective;
  if (o.inner) file.inner = *o.inner;
  return file;
}

void writeReport(const SolidOptions& o, const solid::Object& after, const solid::Report& r, const std::vector<solid::Regularity>& regular, const std::optional<std::array<std::size_t, 3>>& embedded) {
  JsonWriter json;
  json.beginObject().member("object", o.object).member("method", toString(o.solve.method)).member("outcome", toString(r.outcome));
  if (!r.message.empty()) json.member("message", r.message);
  json.member("iterations", r.iterations).member("inner_iterations", r.inner).member("objective", r.objective).member("deviation", r.deviation);
  json.member("row_residual", r.rowResidual).member("rows", r.rows).member("independent_rows", r.rank).key("redundant").beginArray();
  for (const std::string& name : r.redundant) json.value(name);
  json.end().key("solids").beginArray();
  for (std::size_t s = 0; s < r.sizes.size(); ++s) {
    json.beginObject(JsonLayout::Inline).member("name", r.sizes[s].name).member("before", r.sizes[s].rest).member("wanted", r.sizes[s].wanted).member("after", r.sizes[s].after);
    json.key("target");
    if (r.sizes[s].target) json.value(*r.sizes[s].target);
    else json.null();
    json.member("orientation", toString(regular[s].orientation)).member("least_determinant", regular[s].least).end();
  }
  json.end().key("steps").beginArray();
  for (const auto& step : r.steps)
    json.beginObject(JsonLayout::Inline).member("deviation", std::min(step.deviation, 1e300)).member("residual", std::min(step.residual, 1e300)).member("inner", step.inner).end();
  json.end().member("control_points", after.points.size());
  if (embedded) json.key("embedded").beginObject(JsonLayout::Inline).member("inside", (*embedded)[0]).member("beside", (*embedded)[1]).member("left", (*embedded)[2]).end();
  writeTextFile(o.report, json.end().text());
}

/// What is written: the boundary, samples, or the embedded mesh.
class Writer {
 public:
  Writer(const SolidOptions& o, const solid::Object& rest, Terminal& terminal) : o_(o), rest_(rest), terminal_(terminal) {
    if (o.embed.empty()) return;
    mesh_ = mesh::readMesh(o.embed, {}, nullptr, &terminal);
    map_ = std::make_unique<solid::SolidMap>(rest, rest.points, o.reach);
    terminal.beginStage("bind");
    binding_ = map_->bind(mesh_.positions());
    for (std::size_t p = 0; p < mesh_.vertexCount(); ++p) {
      const auto place = solid::SolidMap::place(*binding_, p);
      ++embedded_[place.inside ? 0 : place.found ? 1 : 2];
    }
    if (embedded_[2] > 0)
      terminal.note(fmt::format("fielddeform: {} of {} vertices of {} are out of the object's reach and stay", embedded_[2], mesh_.vertexCount(), o.embed));
  }

  void write(const solid::Object& after, const std::filesystem::path& path) const {
    if (map_) {
      std::vector<Vec3> d(after.points.size()), x(mesh_.vertexCount());
      for (std::size_t i = 0; i < d.size(); ++i) d[i] = after.points[i] - rest_.points[i];
      map_->withDisplacements(d)->apply(*binding_, {.position = x, .safe = {}, .status = {}, .residual = {}}, terminal_);
      mesh::Mesh out = mesh_;
      mesh::updateNormals(out, mesh_.positions(), x);
      if (const std::size_t folds = mesh::countFolds(mesh_, mesh_.positions(), x)) terminal_.note(fmt::format("fielddeform: {}: {} folds", path.string(), folds));
      out.setPositions(std::move(x));
      mesh::writeMesh(out, path, o_.write, &terminal_);
    } else {
      const mesh::Mesh out = o_.samples > 0 ? solid::sampleInside(after, o_.samples) : solid::tessellate(after, o_.tessellate);
      for (const std::string& dropped : mesh::writeMesh(out, path, o_.write, &terminal_).dropped) terminal_.note(fmt::format("fielddeform: {}: dropped {}", path.string(), dropped));
    }
  }
  std::optional<std::array<std::size_t, 3>> embedded() const { return map_ ? std::optional(embedded_) : std::nullopt; }

 private:
  const SolidOptions& o_;
  const solid::Object& rest_;
  Terminal& terminal_;
  mesh::Mesh mesh_;
  std::unique_ptr<solid::SolidMap> map_;
  std::shared_ptr<const map::Binding> binding_;
  std::array<std::size_t, 3> embedded_{};
};

std::vector<solid::Regularity> regularityOf(const solid::Object& object, Terminal& terminal) {
  std::vector<solid::Regularity> out;
  for (std::size_t s = 0; s < object.solids.size(); ++s) {
    out.push_back(solid::checkRegular(object, s));
    const auto& r = out.back();
    if (r.orientation == solid::Orientation::Folded)
      terminal.note(fmt::format("fielddeform: solid \"{}\" is turned inside out at u, v, w = {:.4g}, {:.4g}, {:.4g}", object.solids[s].name, r.at.x(), r.at.y(), r.at.z()));
  }
  return out;
}

void print(const SolidOptions& o, const solid::Report& report, Terminal& terminal) {
  for (const auto& s : report.sizes)
    terminal.print(fmt::format("{}: {} volume {:.9g} (before {:.9g}{})", o.output, s.name, s.after, s.rest,
                               s.target ? fmt::format(", target {:.9g}, off by {:.1e}", *s.target, std::abs(s.after / *s.target - 1)) : ", free"));
  for (const std::string& name : report.redundant) terminal.note(fmt::format("fielddeform: the constraint \"{}\" follows from others", name));
}

int finish(const SolidOptions& o, solid::SolidFile file, const solid::Object& after, const solid::Report& report, const Writer& writer, Terminal& terminal) {
  const auto regular = regularityOf(after, terminal);
  if (!o.report.empty()) writeReport(o, after, report, regular, writer.embedded());
  if (!o.saveObject.empty()) {
    // The result as a new rest.
    file.object = after;
    file.moves.clear();
    for (auto& c : file.constraints) c.value.reset();
    for (auto& s : file.sizes)
      if (s.kind != solid::SizeSpec::Kind::Free) s = {};
    solid::writeSolids(file, o.saveObject);
  }
  print(o, report, terminal);
  if (!report.message.empty()) terminal.note("fielddeform: " + report.message);
  terminal.print(fmt::format("{}: {} iterations ({}), {}", o.output, report.iterations, toString(o.solve.method), toString(report.outcome)));
  const bool folded = std::any_of(regular.begin(), regular.end(), [](const auto& r) { return r.orientation != solid::Orientation::Positive; });
  return o.check && folded ? kCheckFailed : kDone;
}

/// From one size to another in N frames, each a warm start of the next.
int runFrames(const SolidOptions& o, const solid::SolidFile& file, const std::vector<Target>& targets, Terminal& terminal) {
  const solid::Problem problem = solid::problemOf(file);
  const solid::Sizes sizes(file.object);
  const auto valueOf = [&](const solid::SizeSpec& spec, double rest) { return spec.kind == solid::SizeSpec::Kind::Value ? spec.number : rest * spec.number; };
  std::vector<std::optional<double>> from = problem.sizes;
  for (std::size_t s = 0; s < from.size(); ++s)
    if (from[s]) from[s] = sizes.value(s, file.object.points);
  for (const Target& t : targets) {
    const std::size_t s = solidOf(file, "--volume", t.name);
    if (from[s]) from[s] = valueOf(t.from, *from[s]);
  }
  solid::Session session(problem, o.solve);
  const Writer writer(o, file.object, terminal);
  const std::filesystem::path path = o.output;
  solid::Object after = file.object;
  for (int k = 0; k < o.frames; ++k) {
    terminal.throwIfCancelled();
    std::vector<std::optional<double>> now = problem.sizes;
    for (std::size_t s = 0; s < now.size(); ++s) {
      if (!now[s]) continue;
      if (!(*from[s] > 0) || !(*now[s] > 0)) throw InfeasibleError(fmt::format("solid \"{}\": a target size is not positive", file.object.solids[s].name));
      now[s] = *from[s] * std::pow(*now[s] / *from[s], static_cast<double>(k) / std::max(1, o.frames - 1));
    }
    session.setSizes(now);
    after.points = session.solve();
    if (session.report().outcome == solid::Outcome::Unmet) throw InfeasibleError(fmt::format("frame {}: {}", k, session.report().message));
    writer.write(after, withSuffix(path, fmt::format("_{:04}", k), path.extension().string()));
  }
  return finish(o, file, after, session.report(), writer, terminal);
}

int run(const SolidOptions& o, const std::vector<Target>& targets, Terminal& terminal) {
  const solid::SolidFile file = fileOf(o, targets);
  if (o.frames > 0) return runFrames(o, file, targets, terminal);
  terminal.beginStage("solve");
  const solid::Result result = solid::solve(solid::problemOf(file), o.solve, terminal);
  if (result.report.outcome == solid::Outcome::Unmet) throw InfeasibleError(result.report.message);
  solid::Object after = file.object;
  after.points = result.points;
  const Writer writer(o, file.object, terminal);
  writer.write(after, o.output);
  return finish(o, file, after, result.report, writer, terminal);
}

void addSolving(CLI::App& command, SolidOptions& o) {
  const char* group = "Solving";
  addWord(command, "--method", {"exact", "uzawa"}, [&o](std::size_t i) { o.solve.method = static_cast<solid::Method>(i); },
          "Sequential quadratic programming (default), or the paper's")->group(group);
  command.add_option_function<std::string>("--weights", [&o](const std::string& text) {
    const auto n = parseNumbers("--weights", text, 4);
    o.objective = solid::Objective{n[0], n[1], n[2], n[3]};
    try {
      o.objective->validate();
    } catch (const std::invalid_argument& problem) {
      throw CLI::ConversionError(fmt::format("--weights: {}", problem.what()));
    }
  }, "What the change costs: least squares of the control points, stretch, twist, bend (default: the file's, 0,1,0.1,0.1)")->type_name("L,S,T,B")->group(group);
  addWord(command, "--inner", {"free", "coons"}, [&o](std::size_t i) { o.inner = static_cast<solid::Problem::Inner>(i); },
          "Inner control points: follow the objective, or the boundary by the Coons formula (default: the file's, free)")->group(group);
  auto& u = o.solve.uzawa;
  addNumber(command, "--rho1", u.rho1, "uzawa: step of the volumes' multipliers, below 2 (default: 1)")->check(positive())->group(group);
  addNumber(command, "--rho2", u.rho2, "uzawa: step of the constraints' multipliers, below 2 (default: 1)")->check(positive())->group(group);
  command.add_option("--max-outer", u.maxOuter, "uzawa: outer iterations at most (default: 500)")->type_name("N")->check(within(1, 1e6))->group(group);
  command.add_option("--max-inner", u.maxInner, "uzawa: inner iterations of an outer one at most (default: 2)")->type_name("N")->check(within(1, 1e6))->group(group);
  addNumber(command, "--volume-tolerance", u.sizeTolerance, "uzawa: relative deviation of volumes at the end (default: 1e-4)")->check(positive())->group(group);
  addNumber(command, "--distance-tolerance", u.distanceTolerance, "uzawa: misses and last step at the end, share of the size (default: 1e-3)")->check(positive())->group(group);
  command.add_flag("--eliminate", u.eliminateRows, "uzawa: keep the constraints exactly at every step: fewer iterations")->group(group);
}

void addWriting(CLI::App& command, SolidOptions& o) {
  const char* group = "Output";
  command.add_option("--embed", o.embed, "A mesh that rides in the object: OUT is this mesh, deformed")->type_name("MESH")->group(group);
  addNumber(command, "--reach", o.reach, "How far beside a solid the mesh may lie, in its u, v, w (default: 0.5)")->check(within(0, 1000))->group(group);
  command.add_option("--tessellate", o.tessellate, "Segments along every edge of the boundary (default: 16)")->type_name("N")->check(within(1, 1024))->group(group);
  command.add_option("--samples", o.samples, "OUT holds (N + 1)^3 points of the inside of each solid instead, with solid, u, v, w")->type_name("N")->check(within(1, 256))->group(group);
  command.add_option("--frames", o.frames, "A sequence OUT_0000 ... from the old volumes, or A of A..B, to the new ones")->type_name("N")->check(within(1, 10000))->group(group);
  command.add_option("--save-object", o.saveObject, "Write the object as it ends (JSON)")->type_name("FILE")->group(group);
  command.add_option("--report", o.report, "Write a report (JSON)")->type_name("FILE")->group(group);
  addWord(command, "--precision", {"keep", "double"}, [&o](std::size_t i) { o.write.precision = static_cast<mesh::Precision>(i); },
          "Type of coordinates in the output: the input's (default), or double")->group(group);
  command.add_flag("--check", o.check, "Exit with 3 if a solid is turned inside out, or may be")->group(group);
}

}  // namespace

void addSolid(CLI::App& app, Session& session) {
  const auto o = optionsOf<SolidOptions>();
  auto* command = app.add_subcommand("solid", "Deform free-form solids that keep their volumes, and what is embedded in them");
  command->add_option("OBJECT", o->object, "Object of Bezier solids (JSON)")->required()->type_name("");
  command->add_option("-o,--output", o->output, "Mesh to write: the boundary")->required()->type_name("FILE");
  command->add_option("--volume", o->volumes, "What a solid is to hold: a number, a factor, or free (default: the file's, keep); may be repeated")
      ->type_name("NAME=VALUE|NAME=xF|NAME=A..B|NAME=free")->allow_extra_args(false);
  command->add_option("--move", o->moves, "Move a control point, counted from 0; may be repeated")->type_name("NAME:I,J,K=DX,DY,DZ")->allow_extra_args(false);
  command->add_option("--fix", o->fixes, "A control point stays where it was moved to; may be repeated")->type_name("NAME:I,J,K")->allow_extra_args(false);
  command->add_option("--fix-side", o->fixSides, "All control points of a side (u0, u1, v0, v1, w0, w1) stay; may be repeated")->type_name("NAME.SIDE")->allow_extra_args(false);
  command->add_option("--target", o->targets, "A point of a solid or its surface, u, v, w from 0 to 1, goes to a place; may be repeated")
      ->type_name("NAME:U,V,W=X,Y,Z")->allow_extra_args(false);
  addSolving(*command, *o);
  addWriting(*command, *o);
  addThreads(*command, session);
  command->footer("Example:\n  fielddeform solid amphora.json --volume amphora=x1.5 -o larger.ply");
  command->callback([&session, o] {
    std::vector<Target> targets;
    for (const std::string& text : o->volumes) {
      targets.push_back(targetOf(text));
      if (text.find("..") != std::string::npos && o->frames == 0) throw CLI::ValidationError("--volume A..B: expected only with --frames");
    }
    requireForm(*o);
    if (o->samples > 0 && !o->embed.empty()) throw CLI::ValidationError("--samples: not with --embed");
    if (o->frames > 0 && o->solve.method == solid::Method::Uzawa) throw CLI::ValidationError("--frames: only with --method exact");
    session.run = [o, targets](Terminal& terminal) { return run(*o, targets, terminal); };
  });
}

}  // namespace fielddeform::cli
