#pragma once

#include <fielddeform/volume/detail/local_solve.h>

namespace fielddeform::volume::detail {

struct LocalSolved {
  int iterations = 0;
  double deviation = 0;            ///< the largest |dV / V| that is left
};

/// @param displacement  #V by 3, scaled; written where the parts' masks are above 0
/// Solves by the energy and the solver that the options name.
/// @throw InfeasibleError if the volumes cannot be met
LocalSolved solveLocally(const LocalEdit& edit, const LocalMask& mask, LocalParts& parts, const LocalLattice& lattice,
                         const ComponentVolumes& volumes, const LocalOptions& options, Progress& progress,
                         std::span<Vec3> displacement);

}  // namespace fielddeform::volume::detail
