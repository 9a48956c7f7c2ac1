#pragma once

#include <fielddeform/skeleton/edit.h>

namespace fielddeform {
class JsonValue;
class JsonWriter;
}  // namespace fielddeform

namespace fielddeform::scene {

/// An edit as it stands in a scene's "edits": {"op": "bend", "primitive": "spine", "angle_deg": 90, ...}; docs/scene.md.
/// Absent keys and "auto" leave the choice to the skeleton.
/// @throw IoError naming the place of the mistake
skeleton::Edit editFromJson(const JsonValue& value);
void editToJson(const skeleton::Edit& edit, JsonWriter& json);

/// "x", "y", "z", or a direction [x, y, z] that is not zero; nothing for "auto" or null.
std::optional<Vec3> axisFromJson(const JsonValue& value);

}  // namespace fielddeform::scene
