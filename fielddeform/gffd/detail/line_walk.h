#pragma once

#include <fielddeform/core/types.h>
#include <fielddeform/gffd/detail/grid_kernel.h>

namespace fielddeform::gffd::detail {

/// A segment, or a point by itself.
struct LineSegment {
  Vec3 a, b, along;  // along: unit, or zero for a point
  double length;
};

/// Where on a segment a foot must lie that no other may be nearer beyond its ends: from the start of the segment, world.
struct WalkStop {
  float before, after;  ///< a walk towards the start ends with a foot beyond `before`, one towards the end before `after`
};

/// The closest points of a block on a run of segments, in the best vector instructions and with the same bytes in all.
struct WalkTask {
  const LineSegment* segments;
  Index begin, end;  ///< the run that holds every point's closest segment
  Index start;       ///< where a walk begins
  const WalkStop* stops;  ///< of the segments, for a walk from `start` (LineFinder); null: every one of the run is tried
  const Block& points;
  std::size_t count;
  LineHits& hits;    ///< its first `count` places, rounded up to whole vectors, are written
};
void walkLine(const WalkTask& task);

}  // namespace fielddeform::gffd::detail
