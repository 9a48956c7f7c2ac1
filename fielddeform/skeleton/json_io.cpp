#include <fielddeform/core/angle.h>
#include <fielddeform/core/error.h>
#include <fielddeform/core/json_reader.h>
#include <fielddeform/core/json_writer.h>
#include <fielddeform/skeleton/io.h>
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <stdexcept>
#include <unordered_set>

namespace fielddeform::skeleton {
namespace {

constexpr std::string_view kFormatName = "fielddeform-skeleton";

std::optional<JsonValue> findValue(const JsonValue& object, std::string_view key) {
  const auto found = object.find(key);
  return found && !found->isNull() ? found : std::nullopt;
}

// Quaternions as people type them are unit length to a few digits; those of ours are left bit for bit.
Quat readRotation(const JsonValue& value) {
  std::array<double, 4> q{};
  std::size_t k = 0;
  for (const JsonValue x : value.array(4)) q[k++] = x.number();
  const Quat rotation(q[0], q[1], q[2], q[3]);
  const double norm = rotation.norm();
  if (!(std::abs(norm - 1) <= 1e-3))
    value.fail(fmt::format("a quaternion of length {}", norm), "[w, x, y, z] of length 1 (within 1e-3)");
  return std::abs(norm - 1) <= 1e-15 ? rotation : rotation.normalized();
}

void readPoints(const JsonValue& value, Primitive& p) {
  const std::size_t least = leastPoints(p.type, p.closed);
  if (value.array().size() < least)
    value.fail(fmt::format("{} points", value.size()),
               fmt::format("at least {} for a {}{}", least, p.closed ? "closed " : "", toString(p.type)));
  p.points.reserve(value.size());
  for (const JsonValue point : value.array()) p.points.push_back(point.vec3());
}

void readFaces(const JsonValue& value, Primitive& p) {
  if (value.array().size() == 0) value.fail("no faces", "at least 1");
  p.faces.reserve(value.size());
  for (const JsonValue face : value.array()) {
    if (face.array().size() < 3) face.fail(fmt::format("{} corners", face.size()), "at least 3");
    std::vector<Index>& corners = p.faces.emplace_back();
    corners.reserve(face.size());
    for (const JsonValue corner : face.array()) corners.push_back(static_cast<Index>(corner.integer(0, p.points.size() - 1)));
  }
}

void refuseKey(const JsonValue& object, std::string_view key, const char* why) {
  if (const auto value = findValue(object, key)) value->fail("", why);
}

void readShape(const JsonValue& object, Primitive& p) {
  if (const auto closed = findValue(object, "closed")) {
    p.closed = closed->boolean();
    if (p.closed && p.type == PrimitiveType::Points) closed->fail("", "false: points cannot be closed");
  }
  readPoints(object.require("points"), p);
  if (p.type == PrimitiveType::Mesh) readFaces(object.require("faces"), p);
  else refuseKey(object, "faces", "none: only a mesh has faces");
}

void readValues(const JsonValue& object, Primitive& p) {
  if (const auto radius = findValue(object, "radius")) p.radius = radius->positive();
  if (const auto radii = findValue(object, "point_radius"))
    for (const JsonValue r : radii->array(p.points.size())) p.pointRadius.push_back(r.positive());
  if (p.type == PrimitiveType::Polyline) {
    if (const auto rolls = findValue(object, "roll_deg"))
      for (const JsonValue r : rolls->array(p.points.size())) p.roll.push_back(radiansFromDegrees(r.number()));
  } else {
    refuseKey(object, "roll_deg", "none: only a polyline has roll");
  }
  if (const auto weight = findValue(object, "weight")) p.weight = weight->nonNegative();
  if (const auto potential = findValue(object, "potential"))
    p.potential = static_cast<Potential>(potential->word({"exponential", "gaussian", "metaball", "soft-object"}));
  if (p.type != PrimitiveType::Points) refuseKey(object, "rotation", "none: only points have a rotation");
  else if (const auto rotation = findValue(object, "rotation")) p.rotation = readRotation(*rotation);
}

template <class Values, class Convert>
void writeList(JsonWriter& json, std::string_view key, const Values& values, Convert&& convert) {
  json.key(key).beginArray(JsonLayout::Inline);
  for (const auto& v : values) json.value(convert(v));
  json.end();
}

std::string checkedExtras(const std::string& extras) {
  try {
    const JsonDocument document = JsonDocument::parse(extras, "extras");
    if (document.root().kind() != JsonKind::Object) throw std::invalid_argument("skeleton: extras is no JSON object");
    return std::string(document.root().text());
  } catch (const IoError& error) {
    throw std::invalid_argument(fmt::format("skeleton: extras is no JSON: {}", error.what()));
  }
}

}  // namespace

Primitive primitiveFromJson(const JsonValue& object) {
  object.allowKeys({"name", "type", "closed", "points", "faces", "radius", "point_radius", "roll_deg", "weight",
                    "potential", "rotation"});
  Primitive p;
  p.name = object.require("name").string();
  if (p.name.empty()) object.require("name").fail("", "a name");
  p.type = static_cast<PrimitiveType>(object.require("type").word({"points", "polyline", "mesh"}));
  readShape(object, p);
  readValues(object, p);
  return p;
}

void primitiveToJson(const Primitive& p, JsonWriter& json) {
  json.beginObject().member("name", p.name).member("type", toString(p.type));
  if (p.type != PrimitiveType::Points) json.member("closed", p.closed);
  json.key("points").beginArray();
  for (const Vec3& x : p.points) json.value(x);
  json.end();
  if (p.type == PrimitiveType::Mesh) {
    json.key("faces").beginArray();
    for (const std::vector<Index>& face : p.faces) {
      json.beginArray(JsonLayout::Inline);
      for (const Index i : face) json.value(i);
      json.end();
    }
    json.end();
  }
  const auto same = [](double x) { return x; };
  if (p.radius) json.member("radius", *p.radius);
  if (!p.pointRadius.empty()) writeList(json, "point_radius", p.pointRadius, same);
  if (!p.roll.empty()) writeList(json, "roll_deg", p.roll, degreesFromRadians);
  if (p.weight != 1) json.member("weight", p.weight);
  if (p.potential) json.member("potential", toString(*p.potential));
  if (p.rotation) {
    const Quat& q = *p.rotation;
    writeList(json, "rotation", std::array{q.w(), q.x(), q.y(), q.z()}, same);
  }
  json.end();
}

namespace detail {

Skeleton parseJson(std::string text, const std::filesystem::path& path) {
  const JsonDocument document = JsonDocument::parse(std::move(text), path);
  const JsonValue root = document.root();
  document.requireFormat(kFormatName, 1);
  root.allowKeys({"format", "version", "primitives", "extras"});
  const JsonValue list = root.require("primitives");
  if (list.array().size() == 0) list.fail("no primitives", "at least 1");
  Skeleton skeleton;
  std::unordered_set<std::string> names;
  for (const JsonValue item : list.array()) {
    skeleton.primitives.push_back(primitiveFromJson(item));
    if (!names.insert(skeleton.primitives.back().name).second)
      item.require("name").fail("", "another name: this one is used above");
  }
  if (const auto extras = root.find("extras")) {
    extras->members();
    skeleton.extras = extras->text();
  }
  return skeleton;
}

std::string formatJson(const Skeleton& skeleton) {
  JsonWriter json;
  json.beginObject().member("format", kFormatName).member("version", 1).key("primitives").beginArray();
  for (const Primitive& p : skeleton.primitives) primitiveToJson(p, json);
  json.end();
  if (!skeleton.extras.empty()) json.key("extras").raw(checkedExtras(skeleton.extras));
  return json.end().text();
}

}  // namespace detail
}  // namespace fielddeform::skeleton
