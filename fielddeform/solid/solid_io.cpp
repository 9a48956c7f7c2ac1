#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/detail/json_fields.h>
#include <fielddeform/core/error.h>
#include <fielddeform/core/json_reader.h>
#include <fielddeform/core/json_writer.h>
#include <fielddeform/map/lattice_io.h>
#include <fielddeform/solid/size.h>
#include <fielddeform/solid/solid_io.h>
#include <fmt/format.h>

#include <charconv>
#include <stdexcept>

namespace fielddeform::solid {
namespace {

using fielddeform::detail::checked;

constexpr std::string_view kFormatName = "fielddeform-solids";

std::array<int, 3> integers(const JsonValue& value, std::uint64_t low, std::uint64_t high) {
  std::array<int, 3> out{};
  std::size_t a = 0;
  for (const JsonValue v : value.array(3)) out[a++] = static_cast<int>(v.integer(low, high));
  return out;
}

LooseSolid solidFromJson(const JsonValue& object) {
  object.allowKeys({"name", "degree", "points", "box", "size"});
  LooseSolid out{object.require("name").string(), integers(object.require("degree"), 1, kMaxDegree), {}};
  const auto points = object.find("points"), box = object.find("box");
  if (points && box) box->fail("\"box\" besides \"points\"", "one of them");
  const Solid shape{{}, out.degree, {}};
  if (box) {
    const map::LatticeBox b = map::latticeBoxFromJson(*box);
    for (int k = 0; k <= out.degree[2]; ++k)
      for (int j = 0; j <= out.degree[1]; ++j)
        for (int i = 0; i <= out.degree[0]; ++i)
          out.points.push_back(b.origin + b.axes * Vec3(static_cast<double>(i) / out.degree[0], static_cast<double>(j) / out.degree[1], static_cast<double>(k) / out.degree[2]));
    return out;
  }
  const JsonValue list = object.require("points");
  if (list.array().size() != shape.slots()) list.fail(fmt::format("{} points", list.size()), fmt::format("{} for these degrees, u running fastest", shape.slots()));
  for (const JsonValue p : list.array()) out.points.push_back(p.vec3());
  return out;
}

SizeSpec sizeFromJson(const JsonValue& value) {
  if (value.kind() == JsonKind::Number) return {SizeSpec::Kind::Value, value.positive()};
  const std::string text = value.string();
  if (text == "keep") return {};
  if (text == "free") return {SizeSpec::Kind::Free, 1};
  double factor = 0;
  if (text.starts_with("x")) {
    const auto [end, error] = std::from_chars(text.data() + 1, text.data() + text.size(), factor);
    if (error == std::errc() && end == text.data() + text.size() && factor > 0 && factor < 1e300) return {SizeSpec::Kind::Factor, factor};
  }
  value.fail("", "\"keep\", \"free\", a factor such as \"x1.2\", or a number");
}

/// Names of faces before there is an object: only solids' names are known.
FaceRef faceOf(const JsonValue& value, const std::vector<LooseSolid>& solids) {
  const std::string text = value.string();
  const std::size_t dot = text.rfind('.');
  std::size_t s = 0;
  while (s < solids.size() && (dot == std::string::npos || solids[s].name != text.substr(0, dot))) ++s;
  if (s == solids.size()) value.fail("", "SOLID.SIDE, a side u0, u1, v0, v1, w0 or w1");
  for (int k = 0; k < 6; ++k)
    if (text.substr(dot + 1) == toString(static_cast<Side>(k))) return {s, static_cast<Side>(k)};
  value.fail("", "a side u0, u1, v0, v1, w0 or w1");
}

Joint jointFromJson(const JsonValue& object, const std::vector<LooseSolid>& solids) {
  object.allowKeys({"faces", "continuity", "ratio"});
  Joint out;
  std::size_t k = 0;
  for (const JsonValue f : object.require("faces").array(2)) (k++ == 0 ? out.a : out.b) = faceOf(f, solids);
  if (const auto c = object.find("continuity")) out.continuity = static_cast<int>(c->integer(0, kMaxDegree));
  if (const auto r = object.find("ratio")) out.ratio = r->inRange(1e-6, 1e6);
  return out;
}

PointRef pointFromJson(const JsonValue& object, const Object& of, bool controlOnly = false) {
  object.allowKeys({"solid", "index", "uvw", "by"});
  PointRef out;
  const JsonValue name = object.require("solid");
  out.solid = of.find(name.string());
  if (out.solid == of.solids.size()) name.fail("", "the name of a solid");
  const auto index = object.find("index"), uvw = object.find("uvw");
  if (index && uvw) uvw->fail("\"uvw\" besides \"index\"", "one of them");
  if (uvw && !controlOnly) out.at = uvw->vec3();
  else out.at = integers(object.require("index"), 0, kMaxDegree);
  checked(object, "a point of the solid", [&] { return combination(of, out).size(); });
  return out;
}

ConstraintSpec constraintFromJson(const JsonValue& object, const Object& of, const std::vector<LooseSolid>& solids) {
  object.allowKeys({"fix", "to", "attach", "difference", "by", "fix_side"});
  ConstraintSpec out;
  const auto fix = object.find("fix"), attach = object.find("attach"), difference = object.find("difference"), side = object.find("fix_side");
  if (fix.has_value() + attach.has_value() + difference.has_value() + side.has_value() != 1)
    object.fail("", "one of \"fix\", \"attach\", \"difference\", \"fix_side\"");
  const auto to = object.find("to"), by = object.find("by");
  if (to && !fix) to->fail("", "none: only \"fix\" has it");
  if (by && !difference) by->fail("", "none: only \"difference\" has it");
  if (to) out.value = to->vec3();
  if (by) out.value = by->vec3();
  if (fix) out.a = pointFromJson(*fix, of);
  if (side) out.kind = ConstraintSpec::Kind::FixSide, out.side = faceOf(*side, solids);
  if (attach || difference) {
    out.kind = attach ? ConstraintSpec::Kind::Attach : ConstraintSpec::Kind::Difference;
    std::size_t k = 0;
    for (const JsonValue p : (attach ? *attach : *difference).array(2)) (k++ == 0 ? out.a : out.b) = pointFromJson(p, of);
  }
  return out;
}

Objective objectiveFromJson(const JsonValue& object) {
  object.allowKeys({"least_squares", "stretch", "twist", "bend"});
  Objective out{0, 0, 0, 0};
  const auto read = [&](const char* key, double& value) {
    if (const auto v = object.find(key)) value = v->inRange(0, 1e12);
  };
  read("least_squares", out.leastSquares);
  read("stretch", out.stretch);
  read("twist", out.twist);
  read("bend", out.bend);
  checked(object, "a weight above 0", [&] {
    out.validate();
    return 0;
  });
  return out;
}

void pointToJson(const Object& object, const PointRef& ref, JsonWriter& json) {
  json.member("solid", object.solids[ref.solid].name);
  if (const auto* at = std::get_if<std::array<int, 3>>(&ref.at)) json.key("index").beginArray().value((*at)[0]).value((*at)[1]).value((*at)[2]).end();
  else json.member("uvw", std::get<Vec3>(ref.at));
}

void constraintToJson(const Object& object, const ConstraintSpec& c, JsonWriter& json) {
  json.beginObject(JsonLayout::Inline);
  switch (c.kind) {
    case ConstraintSpec::Kind::Fix:
      json.key("fix").beginObject();
      pointToJson(object, c.a, json);
      json.end();
      break;
    case ConstraintSpec::Kind::FixSide: json.member("fix_side", describe(object, c.side)); break;
    default:
      json.key(c.kind == ConstraintSpec::Kind::Attach ? "attach" : "difference").beginArray();
      for (const PointRef* p : {&c.a, &c.b}) {
        json.beginObject();
        pointToJson(object, *p, json);
        json.end();
      }
      json.end();
  }
  if (c.value) json.member(c.kind == ConstraintSpec::Kind::Fix ? "to" : "by", *c.value);
  json.end();
}

void sizeToJson(const SizeSpec& size, JsonWriter& json) {
  if (size.kind == SizeSpec::Kind::Free) json.member("size", "free");
  if (size.kind == SizeSpec::Kind::Value) json.member("size", size.number);
  if (size.kind == SizeSpec::Kind::Factor) json.member("size", fmt::format("x{}", shortestNumber(size.number)));
}

Vec3 placeOf(const Object& object, const PointRef& ref, Points points) {
  Vec3 out = Vec3::Zero();
  for (const auto& [i, w] : combination(object, ref)) out += w * points[i];
  return out;
}

}  // namespace

Problem problemOf(const SolidFile& file) {
  file.object.validate();
  Problem out;
  out.object = file.object;
  out.objective = file.objective;
  out.inner = file.inner;
  out.wanted = file.object.points;
  for (const MoveSpec& move : file.moves) {
    const auto terms = combination(file.object, move.point);
    if (terms.size() != 1 || terms[0].second != 1) throw std::invalid_argument("moves: only control points are moved");
    out.wanted[terms[0].first] += move.by;
  }
  for (const ConstraintSpec& c : file.constraints) {
    switch (c.kind) {
      case ConstraintSpec::Kind::Fix: out.rows.push_back(fixedPoint(file.object, c.a, c.value ? *c.value : placeOf(file.object, c.a, out.wanted))); break;
      case ConstraintSpec::Kind::Attach: out.rows.push_back(attached(file.object, c.a, c.b)); break;
      case ConstraintSpec::Kind::Difference:
        out.rows.push_back(fixedDifference(file.object, c.a, c.b, c.value ? *c.value : Vec3(placeOf(file.object, c.b, out.wanted) - placeOf(file.object, c.a, out.wanted))));
        break;
      case ConstraintSpec::Kind::FixSide:
        for (Row& row : fixedSide(file.object, c.side, out.wanted)) out.rows.push_back(std::move(row));
    }
  }
  const Sizes sizes(file.object);
  for (std::size_t s = 0; s < file.object.solids.size(); ++s) {
    const SizeSpec spec = s < file.sizes.size() ? file.sizes[s] : SizeSpec{};
    const double rest = sizes.value(s, file.object.points);
    if (spec.kind == SizeSpec::Kind::Free) out.sizes.emplace_back();
    else out.sizes.emplace_back(spec.kind == SizeSpec::Kind::Value ? spec.number : spec.kind == SizeSpec::Kind::Factor ? rest * spec.number : rest);
  }
  return out;
}

SolidFile parseSolids(std::string text, const std::filesystem::path& path) {
  const JsonDocument document = JsonDocument::parse(std::move(text), path);
  document.requireFormat(kFormatName, 1);
  const JsonValue root = document.root();
  root.allowKeys({"format", "version", "solids", "joints", "moves", "constraints", "objective", "inner"});
  SolidFile file;
  std::vector<LooseSolid> solids;
  std::size_t total = 0;
  const JsonValue list = root.require("solids");
  for (const JsonValue s : list.array()) {
    solids.push_back(solidFromJson(s));
    total += solids.back().points.size();
    if (total > 4 * kMaxPoints) s.fail(fmt::format("{} control points", total), fmt::format("at most {}", 4 * kMaxPoints));
    file.sizes.push_back(s.find("size") ? sizeFromJson(s.require("size")) : SizeSpec{});
  }
  std::vector<Joint> joints;
  const auto jointList = root.find("joints");
  if (jointList)
    for (const JsonValue j : jointList->array()) joints.push_back(jointFromJson(j, solids));
  file.object = checked(jointList ? *jointList : list, "solids whose joined faces coincide", [&] { return makeObject(solids, joints); });
  if (const auto moves = root.find("moves"))
    for (const JsonValue m : moves->array()) file.moves.push_back({pointFromJson(m, file.object, true), m.require("by").vec3()});
  if (const auto constraints = root.find("constraints"))
    for (const JsonValue c : constraints->array()) file.constraints.push_back(constraintFromJson(c, file.object, solids));
  if (const auto objective = root.find("objective")) file.objective = objectiveFromJson(*objective);
  if (const auto inner = root.find("inner")) file.inner = inner->word({"free", "coons"}) == 1 ? Problem::Inner::Coons : Problem::Inner::Free;
  return file;
}

SolidFile readSolids(const std::filesystem::path& path) { return parseSolids(readTextFile(path), path); }

std::string formatSolids(const SolidFile& file) {
  file.object.validate();
  const Object& object = file.object;
  JsonWriter json;
  json.beginObject().member("format", kFormatName).member("version", 1).key("solids").beginArray();
  for (std::size_t s = 0; s < object.solids.size(); ++s) {
    const Solid& solid = object.solids[s];
    json.beginObject().member("name", solid.name).key("degree").beginArray(JsonLayout::Inline);
    for (const int d : solid.degree) json.value(d);
    json.end();
    if (s < file.sizes.size()) sizeToJson(file.sizes[s], json);
    json.key("points").beginArray(JsonLayout::Lines);
    for (const Index i : solid.points) json.value(object.points[i]);
    json.end().end();
  }
  json.end().key("joints").beginArray();
  for (const Joint& j : object.joints) {
    json.beginObject(JsonLayout::Inline).key("faces").beginArray().value(describe(object, j.a)).value(describe(object, j.b)).end();
    json.member("continuity", j.continuity).member("ratio", j.ratio).end();
  }
  json.end().key("moves").beginArray();
  for (const MoveSpec& m : file.moves) {
    json.beginObject(JsonLayout::Inline);
    pointToJson(object, m.point, json);
    json.member("by", m.by).end();
  }
  json.end().key("constraints").beginArray();
  for (const ConstraintSpec& c : file.constraints) constraintToJson(object, c, json);
  json.end().key("objective").beginObject(JsonLayout::Inline);
  json.member("least_squares", file.objective.leastSquares).member("stretch", file.objective.stretch).member("twist", file.objective.twist).member("bend", file.objective.bend).end();
  json.member("inner", file.inner == Problem::Inner::Coons ? "coons" : "free");
  return json.end().text();
}

void writeSolids(const SolidFile& file, const std::filesystem::path& path) { writeTextFile(path, formatSolids(file)); }

FaceRef parseFace(const Object& object, std::string_view text) {
  const std::size_t dot = text.rfind('.');
  if (dot != std::string_view::npos) {
    const std::size_t s = object.find(text.substr(0, dot));
    for (int k = 0; k < 6 && s < object.solids.size(); ++k)
      if (text.substr(dot + 1) == toString(static_cast<Side>(k))) return {s, static_cast<Side>(k)};
  }
  throw std::invalid_argument(fmt::format("\"{}\": expected SOLID.SIDE, a side u0, u1, v0, v1, w0 or w1", text));
}

}  // namespace fielddeform::solid
