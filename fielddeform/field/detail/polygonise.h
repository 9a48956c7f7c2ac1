#pragma once

#include <fielddeform/field/detail/blocks.h>
#include <fielddeform/mesh/mesh.h>

namespace fielddeform::field::detail {

/// The surface between negative (inside) and other values of blocks of lattice points, by tetrahedra: each cell of eight
/// points is cut into six along one diagonal, so that the surface is a manifold, closed wherever it meets no cell that
/// lacks points. Triangles are oriented towards the values that are not negative.
/// @param corners  sorted, of the blocks; @param values  512 a block
/// @param place    the vertex on the edge from a to b, whose values have different signs; called from many threads
/// @param megabytes  what the surface may take while it is made; @throw std::length_error if it takes more
mesh::Mesh polygonise(const std::vector<Cell>& corners, std::span<const float> values, double megabytes,
                      const std::function<Vec3(const Cell& a, const Cell& b, double va, double vb)>& place);

/// Keeps vertices of neighbouring edges apart: a share of the way, in [0.001, 0.999].
double betweenEnds(double t);

}  // namespace fielddeform::field::detail
