#pragma once

#include <fielddeform/mesh/mesh.h>

#include <functional>

namespace fielddeform::tests {

/// The surface value = 0 of a sampled function, oriented towards positive values: every cube of a grid is cut into six
/// tetrahedra. Closed if the function is positive on the border of the box.
/// @param cells  grid cells along the box's longest side
/// Vertices keep a tenth of an edge from the grid's points, so that no triangle degenerates.
mesh::Mesh marchingTetrahedra(const Box& box, int cells, const std::function<double(const Vec3&)>& value);

}  // namespace fielddeform::tests
