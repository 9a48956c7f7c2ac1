#pragma once

#include <fielddeform/gffd/detail/grid_kernel.h>

namespace fielddeform::gffd::detail {

/// What the nearest frame of a primitive says to a block of points, channel by channel.
struct FrameBlock {
  /// Rest position, move, rotation (x y z w, of any length), scale, radius.
  enum Channel { kRest = 0, kMove = 3, kTurn = 6, kScale = 10, kRadius = 11, kChannels = 12 };
  alignas(64) double at[kChannels][kLanes];
  alignas(64) double distance[kLanes];  ///< squared
};

/// Motions of a block of points, each in coordinates whose origin is its point (LocalMotion).
struct MotionBlock {
  alignas(64) double x[kLanes], y[kLanes], z[kLanes];                      ///< displacement
  alignas(64) double qx[kLanes], qy[kLanes], qz[kLanes], qw[kLanes];       ///< rotation
  alignas(64) double nearness[kLanes];                                     ///< least |d_i| / r_i
};

/// Sums of dual quaternions over the primitives.
struct MotionSums {
  alignas(64) double real[4][kLanes], dual[4][kLanes], first[4][kLanes], nearness[kLanes];
};

/// The motion of one primitive's frames: q* + s R (P - p*) as in AxialPredictor::at. All `count` places, rounded up to whole
/// vectors, must hold numbers.
void frameMotion(const FrameBlock& frames, const Block& points, std::size_t count, MotionBlock& out);
/// Adds that motion with weight exp(-4 d / r). @param first  the sums are begun
void addFrameMotion(const FrameBlock& frames, const Block& points, std::size_t count, bool first, MotionSums& sums);
/// The blend. Where the rotations cancel or the weights vanish the displacement is no number.
void finishMotions(const MotionSums& sums, std::size_t count, MotionBlock& out);

}  // namespace fielddeform::gffd::detail
