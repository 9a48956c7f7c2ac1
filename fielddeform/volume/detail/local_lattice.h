#pragma once

#include <fielddeform/map/lattice.h>
#include <fielddeform/volume/detail/local_part.h>
#include <fielddeform/volume/energy.h>

namespace fielddeform::volume::detail {

/// A cubic B-spline lattice around the moved surface, posed: axis-aligned, every node once. Scaled coordinates.
struct LocalLattice {
  map::Lattice lattice;
  std::array<int, 3> cells{};
  Vec3 cell = Vec3::Zero();       ///< edges of a cell
  std::vector<Index> active;      ///< nodes whose function reaches a moved vertex, ascending
  std::shared_ptr<const map::MaskedMap> map;  ///< over the active nodes; bindings of the parts fit
};

/// @param nodes  per axis, or absent: cubic cells of h = 1.25 l, 3 to 29 on the longest axis
/// Also binds the parts: they may be moved, not copied, as long as they are used with it.
LocalLattice makeLattice(LocalParts& parts, double length, const std::optional<std::array<int, 3>>& nodes);

/// The two terms of H = B^T diag(a) B + (l / h)^4 / N K, over the active nodes; both triangles.
/// K: squared second differences along the axes, mixed ones twice: the bending of the lattice; rigid and linear motions cost nothing.
SparseMatrix bendingMatrix(const LocalLattice& lattice);
/// B^T diag(a) B, exactly, from the moments of the vertices in each cell.
SparseMatrix surfaceMatrix(const LocalLattice& lattice, const LocalParts& parts);
/// (l / h)^power / N
double stiffness(const LocalLattice& lattice, double length, int power);

}  // namespace fielddeform::volume::detail
