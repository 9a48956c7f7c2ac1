#pragma once

#include <fielddeform/field/detail/blocks.h>
#include <fielddeform/field/field.h>

namespace fielddeform::field::detail {

/// A lattice about the middle of the field's skeleton.
Lattice latticeOf(const Field& field, double voxel);
/// Blocks that hold every point with d_i <= reach r_i for some primitive of the field, and `border` voxels more.
std::vector<Cell> coverField(const Field& field, const Lattice& lattice, double reach, double border, const BlockBudget& budget);

}  // namespace fielddeform::field::detail
