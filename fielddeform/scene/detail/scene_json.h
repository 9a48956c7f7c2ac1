#pragma once

#include <fielddeform/core/json_writer.h>
#include <fielddeform/scene/scene.h>

namespace fielddeform::scene::detail {

/// The members of a scene's object after "format" and "version".
/// @param folder  what paths are relative to; null leaves paths out (reports keep them under "run")
void writeSceneBody(JsonWriter& json, const Scene& scene, const std::filesystem::path* folder);

}  // namespace fielddeform::scene::detail
