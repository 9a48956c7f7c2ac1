#pragma once

#include <fielddeform/core/types.h>
#include <fielddeform/gffd/detail/grid_kernel.h>

namespace fielddeform::gffd::detail {

/// A segment, or a point by itself.
struct LineSegment {
  Vec3 a, b, along;       // along: unit, or zero for a point
  double length;
  double before, after;   // |t' - t| at its ends; 0 at the ends of an open line
};

/// The closest points of a block on a run of segments, in the best vector instructions and with the same bytes in all.
struct WalkTask {
  const LineSegment* segments;
  Index begin, end;  ///< the run that holds every point's closest segment
  Index start;       ///< where a walk begins
  double reach;      ///< no point is farther from a point of the run
  bool certain;      ///< walking from `start` finds the closest (LineFinder); else every segment is tried
  const Block& points;
  std::size_t count;
  LineHits& hits;    ///< its first `count` places, rounded up to whole vectors, are written
};
void walkLine(const WalkTask& task);

}  // namespace fielddeform::gffd::detail
