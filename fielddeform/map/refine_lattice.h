#pragma once

#include <fielddeform/map/lattice.h>

namespace fielddeform::map {

/// An axis with more nodes and how its node values follow from those of the axis before, so that
///   sum_i phi_i(u) v_i = sum_j phi'_j(u) (M v)_j  for every u.
/// The rest nodes follow by the same matrix, so linear precision is kept.
struct AxisRefinement {
  AxisBasis axis = AxisBasis::bernstein(2);
  SparseRows matrix{};  ///< M: nodes after by nodes before
};

/// Where the pieces of an axis meet, in [0, 1], ascending, both ends included: pieces + 1 numbers (Bernstein: 0 and 1).
std::vector<double> breaks(const AxisBasis& axis);

/// Inserts a knot in the middle (of the spline's own parameter) of each of the given pieces: one node more a piece.
/// [Goldman 1990, blossoms; the Oslo algorithm's coefficients]
/// @param pieces  0 .. breaks - 2, ascending, distinct
/// @throw std::invalid_argument for a Bernstein axis or a piece out of range
AxisRefinement insertKnots(const AxisBasis& axis, std::span<const int> pieces);

/// Raises the degree of a Bernstein axis. [Farin, degree elevation]
/// @param nodes  > those of the axis
/// @throw std::invalid_argument for a B-spline axis
AxisRefinement elevate(const AxisBasis& axis, int nodes);

/// All pieces of a B-spline halved, or a Bernstein's degree doubled.
AxisRefinement refineAll(const AxisBasis& axis);

/// The lattice with one axis refined: the same map, with more nodes.
/// @throw std::invalid_argument if `axis` is not 0, 1 or 2, or the refinement is of an axis of another size
Lattice refined(const Lattice& lattice, int axis, const AxisRefinement& refinement);
/// refineAll() of every axis.
Lattice refined(const Lattice& lattice);

}  // namespace fielddeform::map
