#include <fielddeform/core/error.h>
#include <fielddeform/core/json_reader.h>
#include <fielddeform/core/json_writer.h>
#include <fielddeform/skeleton/edit_io.h>

#include <cstddef>
#include <cstdint>
#include <stdexcept>

#include "require.h"

/// Any JSON as a list of edits: refused, or applied to a skeleton with a valid result.
namespace fielddeform::skeleton {
namespace {

Skeleton subject() {
  Primitive line, points, sheet;
  line.name = "a", points.name = "b", sheet.name = "c";
  line.points = {Vec3(0, 0, 0), Vec3(0, 0, 1), Vec3(0.1, 0, 2)};
  line.radius = points.radius = sheet.radius = 1;
  points.type = PrimitiveType::Points;
  points.points = {Vec3(1, 2, 3)};
  sheet.type = PrimitiveType::Mesh;
  sheet.points = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(1, 1, 0), Vec3(0, 1, 0)};
  sheet.faces = {{0, 1, 2, 3}};
  return {{line, points, sheet}, {}};
}

void check(std::string text) {
  std::vector<Edit> edits;
  try {
    const JsonDocument document = JsonDocument::parse(std::move(text), "input");
    for (const JsonValue value : document.root().array()) {
      edits.push_back(editFromJson(value));
      JsonWriter json;
      editToJson(edits.back(), json);
      const JsonDocument again = JsonDocument::parse(json.text(), "again");
      JsonWriter twice;
      editToJson(editFromJson(again.root()), twice);
      require(twice.text() == json.text(), "an edit reads back as it was written", json.text() + twice.text());
    }
  } catch (const IoError&) {
    return;
  }
  for (const double t : {0.0, 0.3, 1.0}) try {
      validate(applyEditsAt(subject(), edits, t));
    } catch (const std::invalid_argument&) {
    }
}

}  // namespace
}  // namespace fielddeform::skeleton

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fielddeform::skeleton::check(std::string(reinterpret_cast<const char*>(data), size));
  return 0;
}
