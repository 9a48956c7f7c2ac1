#pragma once

#include <fielddeform/core/progress.h>
#include <fielddeform/render/detail/ray_scene.h>

namespace fielddeform::render::detail {

/// Draws one view into its cell of the picture.
/// @param bodies    what casts and receives shadows
/// @param overlays  what is drawn over it, shining through
void shadeView(const RayScene& bodies, const RayScene& overlays, const ViewFrame& frame, const Picture& picture,
               Image& image, Progress& progress);

}  // namespace fielddeform::render::detail
