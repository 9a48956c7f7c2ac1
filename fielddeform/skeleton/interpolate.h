#pragma once

#include <fielddeform/skeleton/skeleton.h>

namespace fielddeform::skeleton {

/// The pose at time t between a rest and a posed skeleton: 0 is the rest skeleton and 1 the posed one, both bit for bit.
///
/// In between, the primitives stand in the posed skeleton's order and under its names, then the removed ones. A matched
/// primitive's best rigid motion goes along its screw (a turn by at most half a circle, the shorter way) and what
/// is not rigid grows linearly; radii, roll and weight are linear, rotations turn steadily. A replaced primitive is the
/// posed one; a removed one's weight falls to 0, an added one's rises from 0.
/// @param t  in [0, 1]
/// @throw std::invalid_argument if t is out of range
Skeleton interpolatePose(const SkeletonPair& pair, double t);

}  // namespace fielddeform::skeleton
