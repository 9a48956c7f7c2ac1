#pragma once

#include <fielddeform/skeleton/skeleton.h>

#include <filesystem>

namespace fielddeform {
class JsonValue;
class JsonWriter;
}  // namespace fielddeform

/// Skeleton files: JSON ("fielddeform-skeleton", complete) and Wavefront OBJ (shapes and names only, for modellers).
/// docs/skeleton.md has every key and rule. Coordinates are kept bit for bit; angles are degrees in files, radians here.
namespace fielddeform::skeleton {

enum class FileFormat : std::uint8_t { Json, Obj };

/// Reads a skeleton; the content tells the format (JSON begins with a brace).
/// @throw IoError with line and element: unreadable, malformed, not finite, out of range, unknown or repeated key or name
Skeleton readSkeleton(const std::filesystem::path& path);
/// The same from memory. @param path only named in errors
Skeleton parseSkeleton(std::string text, const std::filesystem::path& path);

/// Writes atomically; OBJ if the extension is .obj, else JSON.
/// @throw std::invalid_argument if the skeleton is not valid; IoError if it cannot be written
void writeSkeleton(const Skeleton& skeleton, const std::filesystem::path& path);
/// The text of a skeleton file. JSON keeps everything; OBJ keeps names, types, points and faces.
/// @throw std::invalid_argument if the skeleton is not valid, or extras is no JSON object
std::string formatSkeleton(const Skeleton& skeleton, FileFormat format);

/// One primitive as a JSON object, as it stands in files; scenes use it for the edit "replace".
/// @throw IoError naming the place of the mistake
Primitive primitiveFromJson(const JsonValue& value);
void primitiveToJson(const Primitive& primitive, JsonWriter& json);

/// Whether every edge has exactly two faces that run along it in opposite directions.
bool boundsSolid(std::span<const std::vector<Index>> faces);

namespace detail {
Skeleton parseJson(std::string text, const std::filesystem::path& path);
Skeleton parseObj(std::string_view text, const std::filesystem::path& path);
std::string formatJson(const Skeleton& skeleton);
std::string formatObj(const Skeleton& skeleton);
}  // namespace detail

}  // namespace fielddeform::skeleton
