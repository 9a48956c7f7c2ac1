#pragma once

#include <fielddeform/mesh/mesh.h>

#include <functional>

namespace fielddeform::samples {

/// A function of space, negative inside, about as steep as a distance (slope at most 2).
using Implicit = std::function<double(const Vec3&)>;

/// The surface value = 0 as a closed mesh of even triangles, oriented outwards.  [surface nets, Gibson 1998, then
/// relaxed along the surface]
/// The function must be positive on the border of the box. Gaps and walls thinner than a spacing are closed, so that
/// the mesh is a manifold whatever the function.
mesh::Mesh isosurface(const Box& box, double spacing, const Implicit& value);

/// Gradient of a function by central differences of step h.
Vec3 gradient(const Implicit& value, const Vec3& at, double h);

}  // namespace fielddeform::samples
