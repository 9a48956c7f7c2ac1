#pragma once

#include <fielddeform/mesh/mesh.h>
#include <fielddeform/skeleton/skeleton.h>

#include <functional>
#include <string>

namespace fielddeform::samples {

enum class Ends : std::uint8_t {
  Axis,    ///< a vertex on the axis closes the first and the last ring
  Joined,  ///< the last ring joins the first: a closed profile that does not touch the axis
};

/// A closed surface of revolution about y: rings of `around` vertices at (radius, height), from the lowest to the
/// highest (joined: counter-clockwise with the radius to the right). Quads but for the ends.
/// @param ripple  factor on the radius by angle (radians) and height
mesh::Mesh revolve(const std::vector<Eigen::Vector2d>& profile, int around,
                   const std::function<double(double, double)>& ripple = {}, Ends ends = Ends::Axis);

/// A turned baluster along y, 4 long, about 1 wide, with fluting; closed, quads.
mesh::Mesh baluster();

/// The Utah teapot of 32 bicubic patches, y up, 3.15 high, spout towards +x: body, lid, handle and spout as they were
/// modelled, four pieces that touch one another. Quads.  [Newell 1975]
/// @param level  quads along a patch's side
mesh::Mesh teapot(int level);

skeleton::Primitive polyline(std::string name, std::vector<Vec3> points, double radius);
/// A closed mesh primitive with the faces of a mesh.
skeleton::Primitive solid(std::string name, const mesh::Mesh& mesh, double radius);

}  // namespace fielddeform::samples
