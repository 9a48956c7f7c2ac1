#include <fielddeform/core/angle.h>
#include <fielddeform/core/json_reader.h>
#include <fielddeform/core/json_writer.h>
#include <fielddeform/map/move_io.h>
#include <fielddeform/map/targets_file.h>
#include <fielddeform/mesh/io.h>
#include <fmt/format.h>

#include <array>

namespace fielddeform::map {
namespace {

constexpr std::array<std::string_view, 3> kProfiles{"smooth", "linear", "flat"};

Vec3 directionOf(const JsonValue& value) {
  const Vec3 v = value.vec3();
  if (!(v.stableNorm() > 0)) value.fail("", "a direction: not all of it 0");
  return v;
}

std::vector<double> numbersOf(const JsonValue& row) {
  std::vector<double> numbers;
  for (const JsonValue n : row.array()) numbers.push_back(n.number());
  return numbers;
}

Targets readInline(const JsonValue& object) {
  object.allowKeys({"op", "points", "directions", "pins"});
  Targets t;
  if (const auto points = object.find("points"))
    for (const JsonValue row : points->array()) {
      const std::vector<double> n = numbersOf(row);
      if (n.size() != 6 && n.size() != 7) row.fail(fmt::format("{} numbers", n.size()), "[x, y, z, tx, ty, tz] or with a weight");
      if (n.size() == 7 && !(n[6] > 0)) row.fail(fmt::format("the weight {}", n[6]), "a weight > 0");
      t.points.push_back({Vec3(n[0], n[1], n[2]), Vec3(n[3], n[4], n[5]), n.size() == 7 ? n[6] : 1});
    }
  if (const auto directions = object.find("directions"))
    for (const JsonValue row : directions->array()) {
      const std::vector<double> n = numbersOf(row);
      if (n.size() != 9) row.fail(fmt::format("{} numbers", n.size()), "[x, y, z, dx, dy, dz, ix, iy, iz]");
      const DirectionTarget d{Vec3(n[0], n[1], n[2]), Vec3(n[3], n[4], n[5]), Vec3(n[6], n[7], n[8]), 1};
      if (!(d.direction.stableNorm() > 0)) row.fail("a direction of length 0", "dx, dy, dz not all 0");
      t.directions.push_back(d);
    }
  if (const auto pins = object.find("pins"))
    for (const JsonValue row : pins->array()) t.pinnedPoints.push_back(row.vec3());
  if (t.empty()) object.fail("no targets", "\"points\", \"directions\" or \"file\"");
  return t;
}

Magnet readMagnet(const JsonValue& object) {
  object.allowKeys({"op", "centre", "radius", "by", "towards", "strength", "profile"});
  Magnet m;
  m.centre = object.require("centre").vec3();
  m.radius = object.require("radius").positive();
  if (const auto towards = object.find("towards")) {
    if (const auto by = object.find("by")) by->fail("\"by\" besides \"towards\"", "one of them");
    m.towards = towards->vec3();
    if (const auto strength = object.find("strength")) m.strength = strength->number();
  } else {
    if (const auto strength = object.find("strength")) strength->fail("\"strength\" without \"towards\"", "both, or \"by\"");
    m.by = object.require("by").vec3();
  }
  if (const auto profile = object.find("profile")) m.profile = static_cast<Profile>(profile->word(kProfiles));
  return m;
}

SuctionCup readCup(const JsonValue& object) {
  object.allowKeys({"op", "centre", "axis", "radius", "depth", "by", "turn_deg"});
  SuctionCup c;
  c.centre = object.require("centre").vec3();
  c.axis = directionOf(object.require("axis"));
  c.radius = object.require("radius").positive();
  if (const auto depth = object.find("depth")) c.depth = depth->positive();
  if (const auto by = object.find("by")) c.by = by->vec3();
  if (const auto turn = object.find("turn_deg")) c.turn = radiansFromDegrees(turn->number());
  return c;
}

class Writer {
 public:
  Writer(JsonWriter& json, const std::function<std::string(const std::filesystem::path&)>& pathText)
      : json_(json), pathText_(pathText) {}

  void operator()(const TargetsFile& t) { json_.member("op", "targets").member("file", pathText_(t.path)); }
  void operator()(const Targets& t) {
    json_.member("op", "targets").key("points").beginArray();
    for (const PointTarget& p : t.points) {
      row({p.rest, p.image});
      if (p.weight != 1) json_.value(p.weight);
      json_.end();
    }
    json_.end().key("directions").beginArray();
    for (const DirectionTarget& d : t.directions) {
      row({d.rest, d.direction, d.image});
      json_.end();
    }
    json_.end().key("pins").beginArray();
    for (const Vec3& p : t.pinnedPoints) json_.value(p);
    json_.end();
  }
  void operator()(const Magnet& m) {
    json_.member("op", "magnet").member("centre", m.centre).member("radius", m.radius);
    if (m.towards) json_.member("towards", *m.towards).member("strength", m.strength);
    else json_.member("by", m.by);
    json_.member("profile", kProfiles[static_cast<std::size_t>(m.profile)]);
  }
  void operator()(const SuctionCup& c) {
    json_.member("op", "suction").member("centre", c.centre).member("axis", c.axis).member("radius", c.radius);
    if (c.depth) json_.member("depth", *c.depth);
    json_.member("by", c.by).member("turn_deg", degreesFromRadians(c.turn));
  }
  void operator()(const PressPlane& p) { json_.member("op", "press").member("point", p.point).member("normal", p.normal); }
  void operator()(const PressFile& p) { json_.member("op", "press").member("tool", pathText_(p.path)); }

 private:
  void row(std::initializer_list<Vec3> parts) {
    json_.beginArray(JsonLayout::Inline);
    for (const Vec3& v : parts)
      for (int k = 0; k < 3; ++k) json_.value(v[k]);
  }
  JsonWriter& json_;
  const std::function<std::string(const std::filesystem::path&)>& pathText_;
};

struct Loader {
  Points vertices;
  Move operator()(const TargetsFile& t) const {
    Targets targets;
    targets.points = readTargets(t.path, vertices);
    return targets;
  }
  Move operator()(const PressPlane& p) const { return Press{PressTool::plane(p.point, p.normal)}; }
  Move operator()(const PressFile& p) const { return Press{PressTool::solid(mesh::readMesh(p.path, {.weld = mesh::Weld::Exact}))}; }
  Move operator()(const auto& itself) const { return itself; }
};

}  // namespace

MoveSpec moveFromJson(const JsonValue& value, const std::filesystem::path& folder) {
  const auto path = [&](const JsonValue& v) { return folder / v.string(); };
  switch (value.require("op").word({"targets", "magnet", "suction", "press"})) {
    case 0:
      if (const auto file = value.find("file")) {
        value.allowKeys({"op", "file"});
        return TargetsFile{path(*file)};
      }
      return readInline(value);
    case 1: return readMagnet(value);
    case 2: return readCup(value);
    default: break;
  }
  if (const auto tool = value.find("tool")) {
    value.allowKeys({"op", "tool"});
    return PressFile{path(*tool)};
  }
  value.allowKeys({"op", "point", "normal"});
  return PressPlane{value.require("point").vec3(), directionOf(value.require("normal"))};
}

void moveToJson(const MoveSpec& move, JsonWriter& json, const std::function<std::string(const std::filesystem::path&)>& pathText) {
  json.beginObject(JsonLayout::Inline);
  std::visit(Writer(json, pathText), move);
  json.end();
}

Move loadMove(const MoveSpec& move, Points vertices) { return std::visit(Loader{vertices}, move); }

}  // namespace fielddeform::map
