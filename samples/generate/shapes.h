#pragma once

#include <fielddeform/mesh/mesh.h>
#include <fielddeform/skeleton/skeleton.h>

#include <functional>
#include <string>

namespace fielddeform::samples {

/// A closed surface of revolution about y: rings of `around` vertices at (radius, height), from the lowest to the
/// highest, closed by a vertex on the axis at both ends. Quads but for the ends.
/// @param ripple  factor on the radius by angle (radians) and height
mesh::Mesh revolve(const std::vector<Eigen::Vector2d>& profile, int around,
                   const std::function<double(double, double)>& ripple = {});

/// A bar of square section with rounded edges along y, `length` by `width`, closed, quads.
mesh::Mesh bar(double length, double width, int segments);

/// The Utah teapot of 32 bicubic patches, y up, 3.15 high, spout towards +x: body, lid, handle and spout as they were
/// modelled, four pieces that touch one another. Quads.  [Newell 1975]
/// @param level  quads along a patch's side
mesh::Mesh teapot(int level);

skeleton::Primitive polyline(std::string name, std::vector<Vec3> points, double radius);
/// A closed mesh primitive with the faces of a mesh.
skeleton::Primitive solid(std::string name, const mesh::Mesh& mesh, double radius);

}  // namespace fielddeform::samples
