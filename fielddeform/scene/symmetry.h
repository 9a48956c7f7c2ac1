#pragma once

#include <fielddeform/skeleton/skeleton.h>

namespace fielddeform::scene {

/// A mirror plane perpendicular to an axis.
struct MirrorPlane {
  int axis = 0;     ///< 0, 1, 2: x, y, z
  double at = 0;    ///< coordinate of the plane on that axis, world
};

/// Makes the edits of a skeleton symmetric: what was done on one side is done on the other.
///
/// Points of rest primitives are matched with the mirror images of others, within 1e-3 of the rest skeleton's size.
/// * A point that moved takes its unmoved partner along; of two that moved, each goes the mean of both (mirrored) ways;
///   a point that is its own partner stays on the plane it was on.
/// * Roll and point radii of a line that is its own mirror image merge by the same rule, the roll mirrored.
/// * A removed, replaced, re-weighted or re-sized primitive takes its unedited partner along.
/// * A primitive without a partner, and an added one, gets a mirrored twin named "NAME.mirror".
/// @throw std::invalid_argument if plane.axis is not 0, 1 or 2, or a twin's name is taken
skeleton::SkeletonPair mirrorEdits(const skeleton::SkeletonPair& pair, const MirrorPlane& plane);

}  // namespace fielddeform::scene
