#pragma once

#include <fielddeform/map/direct_manipulation.h>
#include <fielddeform/map/skeleton_motion.h>

#include <optional>

namespace fielddeform::map {

struct FittedLatticeOptions {
  /// Nodes along x, y, z, each 2 to 64; absent: 4 along the shortest side of the box, in proportion up to 12 along others.
  std::optional<std::array<int, 3>> nodes{};
  double damping = 0.03;        ///< >= 0, of the strongest target: what only great changes of nodes could meet is left (numeric/min_norm.h)
  double padding = 0.05;        ///< room around points and skeleton, share of the longest side, >= 0
  PairOptions pairs{.offset = 0.6, .rings = 2, .most = 4000};  ///< the targets
};

struct FittedLattice {
  Lattice lattice;
  ManipulationReport report;
  std::size_t targets = 0;
};

/// A cubic B-spline lattice around an object, moved so that the skeleton's points (and frame points) go where they went:
/// first by the best rigid motion of all, which any lattice carries exactly, then by the least change of the nodes.
/// [Hsu, Hughes & Kaufman 1992]
/// @param points  what the lattice is to contain beside the skeleton; those that are not finite are left out
FittedLattice fitLattice(const SkeletonMotion& motion, Points points, const FittedLatticeOptions& options = {});

}  // namespace fielddeform::map
