#include <fielddeform/core/angle.h>
#include <fielddeform/core/json_reader.h>
#include <fielddeform/core/json_writer.h>
#include <fielddeform/skeleton/edit_io.h>
#include <fielddeform/skeleton/io.h>
#include <fmt/format.h>

namespace fielddeform::skeleton {
namespace {

std::optional<Vec3> point(const JsonValue& object, std::string_view key) {
  const auto value = object.find(key);
  if (!value || value->isNull()) return std::nullopt;
  if (value->kind() != JsonKind::String) return value->vec3();
  value->word({"auto"});
  return std::nullopt;
}

std::optional<Vec3> direction(const JsonValue& object, std::string_view key) {
  const auto value = object.find(key);
  return value ? directionFromJson(*value) : std::nullopt;
}

Spine spine(const JsonValue& object) {
  Spine s;
  s.axis = direction(object, "axis");
  s.pivot = point(object, "pivot");
  if (const auto from = object.find("from")) s.from = from->inRange(0, 1);
  if (const auto to = object.find("to")) s.to = to->inRange(0, 1);
  if (!(s.from < s.to)) object.require(object.find("to") ? "to" : "from").fail("", fmt::format("from ({}) < to ({})", s.from, s.to));
  return s;
}

double angle(const JsonValue& object) { return radiansFromDegrees(object.require("angle_deg").number()); }

Bend readBend(const JsonValue& object) {
  object.allowKeys({"op", "primitive", "axis", "pivot", "from", "to", "angle_deg", "radius", "about"});
  Bend b;
  b.spine = spine(object);
  b.about = direction(object, "about");
  const auto radius = object.find("radius");
  if (!radius || radius->isNull()) {
    b.angle = angle(object);
    return b;
  }
  if (object.find("angle_deg")) radius->fail("a radius and an angle_deg", "one of them");
  b.radius = radius->number();
  if (*b.radius == 0) radius->fail("", "a number that is not 0");
  return b;
}

MovePoints readMove(const JsonValue& object) {
  object.allowKeys({"op", "primitive", "points", "by"});
  MovePoints m;
  for (const JsonValue i : object.require("points").array()) m.points.push_back(static_cast<Index>(i.integer(0, kNoIndex - 1)));
  const JsonValue by = object.require("by");
  const bool one = by.array().size() == 3 && (*by.array().begin()).kind() == JsonKind::Number;
  if (one) m.by.push_back(by.vec3());
  else
    for (const JsonValue v : by.array(m.points.size())) m.by.push_back(v.vec3());
  return m;
}

Scale readScale(const JsonValue& object) {
  object.allowKeys({"op", "primitive", "factor", "pivot"});
  Scale s;
  const JsonValue factor = object.require("factor");
  if (factor.kind() == JsonKind::Number) {
    s.factor = Vec3::Constant(factor.positive());
  } else {
    s.factor = factor.vec3();
    for (const JsonValue f : factor.array()) f.positive();
  }
  s.pivot = point(object, "pivot");
  return s;
}

Press readPress(const JsonValue& object) {
  object.allowKeys({"op", "primitive", "point", "normal", "softness"});
  Press p;
  p.point = object.require("point").vec3();
  const JsonValue normal = object.require("normal");
  const auto n = directionFromJson(normal);
  if (!n) normal.fail("", "a direction");
  p.normal = *n;
  if (const auto softness = object.find("softness")) p.softness = softness->nonNegative();
  return p;
}

Rotate readRotate(const JsonValue& object) {
  object.allowKeys({"op", "primitive", "angle_deg", "axis", "pivot"});
  return {angle(object), direction(object, "axis"), point(object, "pivot")};
}

class Writer {
 public:
  explicit Writer(JsonWriter& json) : json_(json) {}

  void operator()(const Bend& b) {
    spine(b.spine);
    if (b.angle) json_.member("angle_deg", degreesFromRadians(*b.angle));
    else json_.member("radius", b.radius.value_or(0));
    optional("about", b.about);
  }
  void operator()(const Twist& t) {
    spine(t.spine);
    json_.member("angle_deg", degreesFromRadians(t.angle));
  }
  void operator()(const Taper& t) {
    spine(t.spine);
    json_.member("factor", t.factor);
  }
  void operator()(const Stretch& s) {
    spine(s.spine);
    json_.member("factor", s.factor);
  }
  void operator()(const Translate& t) { json_.member("by", t.by); }
  void operator()(const Rotate& r) {
    json_.member("angle_deg", degreesFromRadians(r.angle));
    optional("axis", r.axis);
    optional("pivot", r.pivot);
  }
  void operator()(const Scale& s) {
    json_.member("factor", s.factor);
    optional("pivot", s.pivot);
  }
  void operator()(const MovePoints& m) {
    json_.key("points").beginArray(JsonLayout::Inline);
    for (const Index i : m.points) json_.value(i);
    json_.end().key("by");
    if (m.by.size() == 1) {
      json_.value(m.by[0]);
      return;
    }
    json_.beginArray(JsonLayout::Inline);
    for (const Vec3& v : m.by) json_.value(v);
    json_.end();
  }
  void operator()(const Press& p) {
    json_.member("point", p.point).member("normal", p.normal).member("softness", p.softness);
  }
  void operator()(const Replace& r) {
    json_.key("with");
    primitiveToJson(r.with, json_);
  }

 private:
  void optional(std::string_view key, const std::optional<Vec3>& v) {
    if (v) json_.member(key, *v);
    else json_.member(key, "auto");
  }
  void spine(const Spine& s) {
    optional("axis", s.axis);
    optional("pivot", s.pivot);
    json_.member("from", s.from).member("to", s.to);
  }
  JsonWriter& json_;
};

}  // namespace

std::optional<Vec3> directionFromJson(const JsonValue& value) {
  if (value.isNull()) return std::nullopt;
  if (value.kind() == JsonKind::String) {
    const std::size_t word = value.word({"auto", "x", "y", "z"});
    if (word == 0) return std::nullopt;
    return Vec3(Vec3::Unit(static_cast<Eigen::Index>(word) - 1));
  }
  const Vec3 v = value.vec3();
  if (!(v.norm() > 0) || !std::isfinite(v.norm())) value.fail("", "a direction [x, y, z] that is not 0");
  return v;
}

Edit editFromJson(const JsonValue& object) {
  Edit edit;
  const std::size_t op = object.require("op").word(
      {"bend", "twist", "taper", "stretch", "translate", "rotate", "scale", "move", "press", "replace"});
  const auto primitive = object.find("primitive");
  if (primitive && !primitive->isNull()) edit.primitive = primitive->string();
  const bool spinal = op >= 1 && op <= 3;
  if (spinal) object.allowKeys({"op", "primitive", "axis", "pivot", "from", "to", op == 1 ? "angle_deg" : "factor"});
  switch (op) {
    case 0: edit.operation = readBend(object); break;
    case 1: edit.operation = Twist{spine(object), angle(object)}; break;
    case 2: edit.operation = Taper{spine(object), object.require("factor").positive()}; break;
    case 3: edit.operation = Stretch{spine(object), object.require("factor").positive()}; break;
    case 4:
      object.allowKeys({"op", "primitive", "by"});
      edit.operation = Translate{object.require("by").vec3()};
      break;
    case 5: edit.operation = readRotate(object); break;
    case 6: edit.operation = readScale(object); break;
    case 7: edit.operation = readMove(object); break;
    case 8: edit.operation = readPress(object); break;
    default:
      object.allowKeys({"op", "primitive", "with"});
      edit.operation = Replace{primitiveFromJson(object.require("with"))};
  }
  if (edit.primitive.empty() && op >= 7 && op != 8) object.fail(fmt::format("{} without a primitive", operationName(edit)), "one");
  return edit;
}

void editToJson(const Edit& edit, JsonWriter& json) {
  json.beginObject().member("op", operationName(edit));
  if (!edit.primitive.empty()) json.member("primitive", edit.primitive);
  std::visit(Writer(json), edit.operation);
  json.end();
}

}  // namespace fielddeform::skeleton
