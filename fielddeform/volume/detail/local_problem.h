#pragma once

#include <fielddeform/volume/detail/local_solve.h>

namespace fielddeform::volume::detail {

struct LocalSolved {
  std::vector<Vec3> displacement;  ///< #V by 3, scaled
  int iterations = 0;
  double deviation = 0;            ///< the largest |dV / V| that is left
};

/// Solves by the energy and the solver that the options name.
/// @throw InfeasibleError if the volumes cannot be met
LocalSolved solveLocally(const LocalEdit& edit, const LocalMask& mask, LocalParts& parts, const LocalLattice& lattice,
                         const ComponentVolumes& volumes, const LocalOptions& options, Progress& progress);

}  // namespace fielddeform::volume::detail
