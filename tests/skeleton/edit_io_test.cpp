#include <fielddeform/core/angle.h>
#include <fielddeform/core/error.h>
#include <fielddeform/core/json_reader.h>
#include <fielddeform/core/json_writer.h>
#include <fielddeform/skeleton/edit_io.h>
#include <gtest/gtest.h>

namespace fielddeform::skeleton {
namespace {

Edit read(const std::string& text) { return editFromJson(JsonDocument::parse(text, "e").root()); }

std::string written(const Edit& edit) {
  JsonWriter json;
  editToJson(edit, json);
  return json.text();
}

std::string messageOf(const std::string& text) {
  try {
    read(text);
  } catch (const IoError& e) {
    return e.what();
  }
  return "accepted";
}

TEST(EditJson, ReadsTheDocumentedExample) {
  const Edit e = read(R"({"op": "bend", "primitive": "spine", "angle_deg": 90, "about": "auto", "from": 0, "to": 1})");
  EXPECT_EQ(e.primitive, "spine");
  const Bend& b = std::get<Bend>(e.operation);
  EXPECT_EQ(*b.angle, kPi / 2);
  EXPECT_FALSE(b.about || b.spine.axis || b.spine.pivot);
  EXPECT_EQ(*std::get<Twist>(read(R"({"op": "twist", "angle_deg": 1, "axis": "y"})").operation).spine.axis, Vec3::UnitY());
}

TEST(EditJson, EveryOperationReadsBackAsItself) {
  const char* const edits[] = {
      R"({"op": "bend", "primitive": "a", "angle_deg": 33.3, "axis": [0,0.1,1], "pivot": [1,2,3], "about": "x", "from": 0.1, "to": 0.9})",
      R"({"op": "bend", "radius": -2.5})",
      R"({"op": "twist", "angle_deg": -720, "pivot": "auto"})",
      R"({"op": "taper", "factor": 0.3})",
      R"({"op": "stretch", "factor": 2, "from": 0.5})",
      R"({"op": "translate", "by": [1,2,3]})",
      R"({"op": "rotate", "angle_deg": 12, "axis": "z"})",
      R"({"op": "scale", "factor": 2})",
      R"({"op": "scale", "factor": [1,2,3], "pivot": [0,0,0]})",
      R"({"op": "move", "primitive": "a", "points": [3,4], "by": [0,0,1]})",
      R"({"op": "move", "primitive": "a", "points": [3,4,7], "by": [[0,0,1],[1,0,0],[1,1,1]]})",
      R"({"op": "press", "point": [0,0,1], "normal": "z", "softness": 0.5})",
      R"({"op": "replace", "primitive": "a", "with": {"name": "b", "type": "points", "points": [[1,2,3]], "radius": 4}})"};
  std::size_t operations = 0;
  for (const char* text : edits) {
    const Edit e = read(text);
    const std::string once = written(e);
    EXPECT_EQ(written(read(once)), once);
    operations |= std::size_t{1} << e.operation.index();
  }
  EXPECT_EQ(operations, 0x3FFu) << "all ten";
}

TEST(EditJson, MistakesGetPlaceAndSuggestion) {
  const auto expect = [](const std::string& text, const std::string& part) {
    EXPECT_NE(messageOf(text).find(part), std::string::npos) << messageOf(text);
  };
  expect(R"({"op": "bnd"})", "e:1: /op: \"bnd\", expected");
  expect(R"({"op": "bnd"})", "did you mean \"bend\"?");
  expect(R"({"op": "bend", "angel_deg": 3})", "did you mean \"angle_deg\"?");
  expect(R"({"op": "bend"})", "no key \"angle_deg\"");
  expect(R"({"op": "bend", "angle_deg": 3, "radius": 1})", "one of them");
  expect(R"({"op": "bend", "radius": 0})", "/radius");
  expect(R"({"op": "twist", "angle_deg": 3, "factor": 1})", "/factor: unknown key");
  expect(R"({"op": "twist", "angle_deg": 3, "axis": "w"})", "\"auto\", \"x\"");
  expect(R"({"op": "twist", "angle_deg": 3, "axis": [0,0,0]})", "/axis");
  expect(R"({"op": "twist", "angle_deg": 3, "from": 0.5, "to": 0.5})", "/to: 0.5, expected from (0.5) < to (0.5)");
  expect(R"({"op": "twist", "angle_deg": 3, "from": 1})", "/from");
  expect(R"({"op": "taper", "factor": 0})", "/factor: 0, expected a number > 0");
  expect(R"({"op": "scale", "factor": [1,-1,1]})", "/factor/1");
  expect(R"({"op": "move", "points": [1], "by": [0,0,1]})", "move without a primitive");
  expect(R"({"op": "move", "primitive": "a", "points": [1,-2], "by": [0,0,1]})", "/points/1");
  expect(R"({"op": "move", "primitive": "a", "points": [1,2], "by": [[0,0,1]]})", "/by: 1 elements, expected 2");
  expect(R"({"op": "press", "point": [0,0,0], "normal": "auto"})", "/normal");
  expect(R"({"op": "replace", "primitive": "a", "with": {"name": "b", "type": "polyline", "points": [[1,2,3]]}})", "/with/points");
  expect(R"({"primitive": "a"})", "no key \"op\"");
  expect(R"([])", "the whole file");
}

}  // namespace
}  // namespace fielddeform::skeleton
