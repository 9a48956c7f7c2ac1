#pragma once

#include <fielddeform/map/casteljau.h>
#include <fielddeform/map/skeleton_motion.h>

namespace fielddeform::map {

/// The de Casteljau map along the one line of a skeleton: cubic pieces through its points at rest and posed, handles by the
/// frames, roll and radii of the motion (curvesAlong). Points that coincide count once.
/// @throw std::invalid_argument if the skeleton is not one open line with a length
CasteljauMap casteljauAlong(const SkeletonMotion& motion);

}  // namespace fielddeform::map
