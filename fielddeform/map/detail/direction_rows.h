#pragma once

#include <fielddeform/map/lattice.h>

namespace fielddeform::map::detail {

/// d phi_i / d(direction) at points, by rows; a point that the lattice leaves alone gets an empty row.
/// @param points, directions  #P by 3, world
SparseRows directionRows(const Lattice& lattice, Points points, Points directions);

}  // namespace fielddeform::map::detail
