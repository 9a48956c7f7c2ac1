#pragma once

#include <fielddeform/core/types.h>

#include <Eigen/Core>
#include <vector>

namespace fielddeform::render::detail {

/// Unit normals at the corners of triangles: the mean, weighted by angle, of the triangles around the corner's point
/// that turn by at most creaseAngle (radians) from its own. Points at one place count as one.
std::vector<Eigen::Vector3f> smoothNormals(const std::vector<Eigen::Vector3f>& points,
                                           const std::vector<Index>& corners, double creaseAngle);

}  // namespace fielddeform::render::detail
