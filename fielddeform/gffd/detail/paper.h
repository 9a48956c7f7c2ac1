#pragma once

#include <fielddeform/gffd/detail/stage.h>

#include <functional>

namespace fielddeform::gffd::detail {

/// Fig. 5 of Qin et al. 2003, with its direction and its bisection, in the clipped field. Printed, it can loop forever
/// (the reversal of the step is dead code, a zero gradient gives 0/0, there is no cap): where the paper would not end,
/// the vertex is Stalled at the best position so far.
/// @param direction      unit vector at a position, or zero where there is none
/// @param target         the pseudo-distance to recover, world
/// @param tolerance      epsilon, world
/// @param maxIterations  outer steps
Tracked trackAsPrinted(const field::Field& posed, const std::function<Vec3(const Vec3&)>& direction, const Vec3& start,
                       double target, double tolerance, int maxIterations);

/// Corresponding points for the warp of eq (4): the points of the matched primitives. Where they lie on one straight line
/// they do not say how the space around it turns; then each gets four frame points, 0.05 radii off the line.
struct WarpPairs {
  std::vector<Vec3> rest, posed;
};
WarpPairs warpPairs(const skeleton::SkeletonPair& pair);

/// Direction of eq (3): towards the skeleton, zero outside the influence region.
Vec3 gradientDirection(const field::Field& posed, const Vec3& point);

}  // namespace fielddeform::gffd::detail
