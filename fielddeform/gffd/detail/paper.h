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

/// Points around the skeleton's own, which tell the warp how space turns.
enum class FramePoints : std::uint8_t {
  /// Around lines and points, six a vertex, along the axes of the world, 0.2 radii away but not more than 0.41 of the way
  /// to the nearest other primitive; each line turned by itself: parallel transport from one vertex, which turns by the
  /// line's best fit and then the smallest rotation of its tangent. Neighbours do not agree, so that rigid edits are not
  /// exact: what reproduces the prototype's figures of Fig. 5.
  Naive,
  /// Four a vertex, 0.05 radii off, by the predictors' frames; only where all points lie on one straight line.
  Straight,
};

/// Corresponding points for the warp of eq (4): the points of the matched primitives, and frame points.
struct WarpPairs {
  std::vector<Vec3> rest, posed;
};
/// @param most  naive frame points go around every second, fourth, ... vertex rather than pass this count, or are left out
WarpPairs warpPairs(const skeleton::SkeletonPair& pair, FramePoints frames, std::size_t most);

/// Direction of eq (3): towards the skeleton, zero outside the influence region.
Vec3 gradientDirection(const field::Field& posed, const Vec3& point);

}  // namespace fielddeform::gffd::detail
