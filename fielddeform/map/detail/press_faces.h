#pragma once

#include <fielddeform/map/press_tool.h>

#include <array>
#include <span>
#include <vector>

namespace fielddeform::map::detail {

/// Where a flat triangle of the object is deepest inside a tool.
struct FaceContact {
  Index triangle = 0;
  Vec3 weight = Vec3::Zero();  ///< barycentric, of the place
  PressTool::Contact contact;
};

/// The triangles that reach deeper into the tool than `tolerance`, in their order. A tool's distance changes by no more than one
/// moves, so that a piece of a triangle farther from the tool than its own radius is out of it; pieces that may not be are
/// quartered down to the tolerance, those first that may be deepest, up to 1024 of a
/// triangle (a 30th of it where all of it lies on the tool).
/// @param points     #P by 3, world    @param tolerance  world, > 0
std::vector<FaceContact> facesInside(const PressTool& tool, Points points, std::span<const std::array<Index, 3>> triangles, double tolerance);

}  // namespace fielddeform::map::detail
