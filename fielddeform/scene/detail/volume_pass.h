#pragma once

#include <fielddeform/core/json_reader.h>
#include <fielddeform/core/json_writer.h>
#include <fielddeform/scene/report.h>
#include <fielddeform/scene/scene.h>

#include <functional>

/// The volume pass of a scene: its part of the scene file.
namespace fielddeform::scene::detail {

/// The value of "volume" that is not null. Paths are taken relative to `folder`.
/// @throw IoError
VolumePass readVolumePass(const JsonValue& object, const std::filesystem::path& folder);

/// Writes the value. @param pathText how a path stands in the file, or empty: paths are left out
void writeVolumePass(JsonWriter& json, const VolumePass& pass,
                     const std::function<std::string(const std::filesystem::path&)>& pathText);

/// Writes the report's "pass" object as a member.
void writeVolumePassReport(JsonWriter& json, const VolumePassReport& report);

}  // namespace fielddeform::scene::detail
