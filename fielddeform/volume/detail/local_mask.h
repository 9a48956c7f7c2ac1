#pragma once

#include <fielddeform/volume/detail/local_edit.h>

namespace fielddeform::volume::detail {

struct LocalMask {
  std::vector<double> value;  ///< #V in [0, 1]; exactly 0: kept bit for bit
  bool fromFalloff = false;
  double length = 0;          ///< partLength() of what has a mask above 0, scaled
  std::size_t moved = 0;      ///< vertices with a mask above 0
  bool free = false;          ///< 1 all over what moves, so that its centroid and rotation must be held otherwise
};

/// Which components' volumes the pass holds: those that the edit touched, and those that a given mask (or none) would move.
std::vector<std::uint8_t> heldComponents(const LocalEdit& edit, const LocalInput& input, MaskKind kind);

/// @throw InfeasibleError if a held component has only zeros, or a boundary edge would move
LocalMask makeMask(const LocalEdit& edit, const LocalInput& input, MaskKind kind, const std::vector<std::uint8_t>& held);

inline double smoothstep(double t) {
  const double c = t < 0 ? 0 : t > 1 ? 1 : t;
  return c * c * (3 - 2 * c);
}

}  // namespace fielddeform::volume::detail
