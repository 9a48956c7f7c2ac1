#pragma once

#include <fielddeform/map/sculpt.h>

#include <filesystem>
#include <functional>

namespace fielddeform {
class JsonValue;
class JsonWriter;
}  // namespace fielddeform

/// Moves as scenes and the command line hold them: files not yet read.
///   {"op": "targets", "file": "pairs.csv"}
///   {"op": "targets", "points": [[x, y, z, tx, ty, tz], [x, y, z, tx, ty, tz, weight]],
///    "directions": [[x, y, z, dx, dy, dz, ix, iy, iz]], "pins": [[x, y, z]]}
///   {"op": "magnet", "centre": [x, y, z], "radius": 1, "by": [x, y, z], "profile": "smooth"}
///   {"op": "magnet", "centre": [x, y, z], "radius": 1, "towards": [x, y, z], "strength": 1, "profile": "flat"}
///   {"op": "suction", "centre": [x, y, z], "axis": [x, y, z], "radius": 1, "depth": 1, "by": [x, y, z], "turn_deg": 0}
///   {"op": "press", "point": [x, y, z], "normal": [x, y, z]}
///   {"op": "press", "tool": "ball.obj"}
namespace fielddeform::map {

struct TargetsFile {
  std::filesystem::path path;  ///< readTargets()
};
struct PressPlane {
  Vec3 point = Vec3::Zero();
  Vec3 normal = Vec3::UnitZ();  ///< towards the object's side
};
struct PressFile {
  std::filesystem::path path;  ///< a closed mesh
};
using MoveSpec = std::variant<TargetsFile, Targets, Magnet, SuctionCup, PressPlane, PressFile>;

/// @param folder  where relative paths start
/// @throw IoError with JSON Pointer and line: unknown operation or key, a value of another kind or out of range
MoveSpec moveFromJson(const JsonValue& value, const std::filesystem::path& folder);
/// Writes what moveFromJson() reads back as the same move. @param pathText  how to write a path
void moveToJson(const MoveSpec& move, JsonWriter& json, const std::function<std::string(const std::filesystem::path&)>& pathText);

/// Reads the files of a move. @param vertices  what vertex numbers in a file of targets refer to
/// @throw IoError, std::invalid_argument
Move loadMove(const MoveSpec& move, Points vertices);

}  // namespace fielddeform::map
