#include <fielddeform/core/angle.h>
#include <fielddeform/core/json_reader.h>
#include <fielddeform/core/json_writer.h>
#include <fielddeform/scene/edit_json.h>
#include <fielddeform/skeleton/io.h>

namespace fielddeform::scene {
namespace {

namespace sk = skeleton;

std::optional<JsonValue> given(const JsonValue& object, std::string_view key) {
  const auto value = object.find(key);
  return value && !value->isNull() ? value : std::nullopt;
}

std::optional<Vec3> readAxis(const JsonValue& object, std::string_view key) {
  const auto value = given(object, key);
  return value ? axisFromJson(*value) : std::nullopt;
}

std::optional<Vec3> readPoint(const JsonValue& object, std::string_view key) {
  const auto value = given(object, key);
  if (!value || (value->kind() == JsonKind::String && value->string() == "auto")) return std::nullopt;
  return value->vec3();
}

sk::Spine readSpine(const JsonValue& object) {
  sk::Spine spine;
  spine.axis = readAxis(object, "axis");
  spine.pivot = readPoint(object, "pivot");
  if (const auto from = given(object, "from")) spine.from = from->inRange(0, 1);
  if (const auto to = given(object, "to")) spine.to = to->inRange(0, 1);
  if (!(spine.from < spine.to)) object.fail("\"from\" that is not below \"to\"", "0 <= from < to <= 1");
  return spine;
}

sk::Bend readBend(const JsonValue& object) {
  object.allowKeys({"op", "primitive", "axis", "pivot", "from", "to", "angle_deg", "radius", "about"});
  sk::Bend bend;
  bend.spine = readSpine(object);
  const auto angle = given(object, "angle_deg"), radius = given(object, "radius");
  if (angle.has_value() == radius.has_value()) object.fail("", "either \"angle_deg\" or \"radius\"");
  if (angle) bend.angle = radiansFromDegrees(angle->number());
  if (radius) bend.radius = radius->number();
  if (radius && *bend.radius == 0) radius->fail("", "not 0");
  bend.about = readAxis(object, "about");
  return bend;
}

sk::Scale readScale(const JsonValue& object) {
  object.allowKeys({"op", "primitive", "factor", "pivot"});
  sk::Scale scale;
  const JsonValue factor = object.require("factor");
  if (factor.kind() == JsonKind::Number) {
    scale.factor = Vec3::Constant(factor.positive());
  } else {
    int c = 0;
    for (const JsonValue f : factor.array(3)) scale.factor[c++] = f.positive();
  }
  scale.pivot = readPoint(object, "pivot");
  return scale;
}

sk::MovePoints readMove(const JsonValue& object) {
  object.allowKeys({"op", "primitive", "points", "by"});
  sk::MovePoints move;
  for (const JsonValue point : object.require("points").array())
    move.points.push_back(static_cast<Index>(point.integer(0, kNoIndex - 1)));
  const JsonValue by = object.require("by");
  const JsonRange list = by.array();
  const bool one = list.size() == 3 && (*list.begin()).kind() == JsonKind::Number;
  if (one) move.by.push_back(by.vec3());
  else if (list.size() != move.points.size()) by.fail("", "[x, y, z], or one such a point");
  else
    for (const JsonValue v : list) move.by.push_back(v.vec3());
  return move;
}

sk::Press readPress(const JsonValue& object) {
  object.allowKeys({"op", "primitive", "point", "normal", "softness"});
  sk::Press press;
  press.point = object.require("point").vec3();
  const auto normal = axisFromJson(object.require("normal"));
  if (!normal) object.require("normal").fail("", "a direction");
  press.normal = *normal;
  if (const auto softness = given(object, "softness")) press.softness = softness->nonNegative();
  return press;
}

using Operation = decltype(sk::Edit::operation);

Operation readOperation(const JsonValue& object, std::size_t word) {
  switch (word) {
    case 0: return readBend(object);
    case 1:
      object.allowKeys({"op", "primitive", "axis", "pivot", "from", "to", "angle_deg"});
      return sk::Twist{readSpine(object), radiansFromDegrees(object.require("angle_deg").number())};
    case 2:
      object.allowKeys({"op", "primitive", "axis", "pivot", "from", "to", "factor"});
      return sk::Taper{readSpine(object), object.require("factor").positive()};
    case 3:
      object.allowKeys({"op", "primitive", "axis", "pivot", "from", "to", "factor"});
      return sk::Stretch{readSpine(object), object.require("factor").positive()};
    case 4:
      object.allowKeys({"op", "primitive", "by"});
      return sk::Translate{object.require("by").vec3()};
    case 5:
      object.allowKeys({"op", "primitive", "angle_deg", "axis", "pivot"});
      return sk::Rotate{radiansFromDegrees(object.require("angle_deg").number()), readAxis(object, "axis"),
                        readPoint(object, "pivot")};
    case 6: return readScale(object);
    case 7: return readMove(object);
    case 8: return readPress(object);
    default:
      object.allowKeys({"op", "primitive", "with"});
      return sk::Replace{sk::primitiveFromJson(object.require("with"))};
  }
}

// Writes an operation's members; absent ones are left out.
class Writer {
 public:
  explicit Writer(JsonWriter& json) : json_(json) {}

  void operator()(const sk::Bend& e) {
    if (e.radius) json_.member("radius", *e.radius);
    else if (e.angle) json_.member("angle_deg", degreesFromRadians(*e.angle));
    vector("about", e.about);
    spine(e.spine);
  }
  void operator()(const sk::Twist& e) {
    json_.member("angle_deg", degreesFromRadians(e.angle));
    spine(e.spine);
  }
  void operator()(const sk::Taper& e) {
    json_.member("factor", e.factor);
    spine(e.spine);
  }
  void operator()(const sk::Stretch& e) {
    json_.member("factor", e.factor);
    spine(e.spine);
  }
  void operator()(const sk::Translate& e) { json_.member("by", e.by); }
  void operator()(const sk::Rotate& e) {
    json_.member("angle_deg", degreesFromRadians(e.angle));
    vector("axis", e.axis);
    vector("pivot", e.pivot);
  }
  void operator()(const sk::Scale& e) {
    json_.member("factor", e.factor);
    vector("pivot", e.pivot);
  }
  void operator()(const sk::MovePoints& e) {
    json_.key("points").beginArray(JsonLayout::Inline);
    for (const Index i : e.points) json_.value(i);
    json_.end();
    // One vector for all stays one; a list of one for one point means the same.
    if (e.by.size() == 1) {
      json_.member("by", e.by[0]);
      return;
    }
    json_.key("by").beginArray(JsonLayout::Inline);
    for (const Vec3& v : e.by) json_.value(v);
    json_.end();
  }
  void operator()(const sk::Press& e) {
    json_.member("point", e.point).member("normal", e.normal).member("softness", e.softness);
  }
  void operator()(const sk::Replace& e) {
    json_.key("with");
    sk::primitiveToJson(e.with, json_);
  }

 private:
  void vector(std::string_view key, const std::optional<Vec3>& v) {
    if (v) json_.member(key, *v);
  }
  void spine(const sk::Spine& s) {
    vector("axis", s.axis);
    vector("pivot", s.pivot);
    json_.member("from", s.from).member("to", s.to);
  }
  JsonWriter& json_;
};

}  // namespace

std::optional<Vec3> axisFromJson(const JsonValue& value) {
  if (value.isNull()) return std::nullopt;
  if (value.kind() == JsonKind::String) {
    const std::size_t word = value.word({"auto", "x", "y", "z"});
    if (word == 0) return std::nullopt;
    return Vec3::Unit(static_cast<int>(word) - 1);
  }
  const Vec3 axis = value.vec3();
  if (axis.isZero(0)) value.fail("a zero vector", "a direction");
  return axis;
}

skeleton::Edit editFromJson(const JsonValue& object) {
  const std::size_t word = object.require("op").word(
      {"bend", "twist", "taper", "stretch", "translate", "rotate", "scale", "move", "press", "replace"});
  skeleton::Edit edit;
  if (const auto name = given(object, "primitive")) edit.primitive = name->string();
  edit.operation = readOperation(object, word);
  return edit;
}

void editToJson(const skeleton::Edit& edit, JsonWriter& json) {
  json.beginObject(JsonLayout::Inline).member("op", skeleton::operationName(edit));
  if (!edit.primitive.empty()) json.member("primitive", edit.primitive);
  std::visit(Writer(json), edit.operation);
  json.end();
}

}  // namespace fielddeform::scene
