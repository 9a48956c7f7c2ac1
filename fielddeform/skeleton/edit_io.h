#pragma once

#include <fielddeform/skeleton/edit.h>

namespace fielddeform {
class JsonValue;
class JsonWriter;
}  // namespace fielddeform

/// Edits in scene files: {"op": "bend", "primitive": "spine", "angle_deg": 90, "about": "auto", "from": 0, "to": 1}.
/// docs/skeleton.md has the keys of every operation. Angles are degrees there.
namespace fielddeform::skeleton {

/// @throw IoError with JSON Pointer and line: unknown operation or key, a value of another kind or out of range
Edit editFromJson(const JsonValue& value);
/// Writes what editFromJson reads back as the same edit; absent values are written as "auto".
void editToJson(const Edit& edit, JsonWriter& json);

/// A direction as files and the command line give it: "auto" (absent), "x", "y", "z", or [x, y, z] not all 0.
std::optional<Vec3> directionFromJson(const JsonValue& value);

}  // namespace fielddeform::skeleton
