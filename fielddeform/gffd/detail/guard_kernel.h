#pragma once

#include <cstddef>
#include <cstdint>

/// The guard's first look at triangles: in float, many at once, erring on the side of suspicion.
namespace fielddeform::gffd::detail {

inline constexpr std::size_t kGuardBlock = 64;

/// Two edges from the first corner of each triangle, predicted (q) and corrected (x), in a unit in which edges are of
/// order one.
struct GuardEdges {
  alignas(64) float q1[3][kGuardBlock], q2[3][kGuardBlock], x1[3][kGuardBlock], x2[3][kGuardBlock];
};

struct GuardBounds {
  float cosineSquared;  ///< of the normals' angle: less is suspect; above the guard's bound by more than float can err
  float stretchSquared; ///< more is suspect; below the guard's bound likewise
};

/// suspect[i] = 0: in exact numbers too, the triangle's normal has turned less and its edges are longer by less than the
/// bounds say. 1: unknown; also for slivers (sine below 1e-3, whose normals float does not know), for what is no number,
/// and for what leaves the range of float. All kGuardBlock triangles are looked at.
void findSuspects(const GuardEdges& edges, const GuardBounds& bounds, std::int32_t* suspect);

}  // namespace fielddeform::gffd::detail
