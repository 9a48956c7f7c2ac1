#include <fielddeform/core/detail/simd.h>
#include <fielddeform/gffd/detail/line_walk.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace fielddeform::gffd::detail {
namespace {

constexpr int kJumps = 8;

// By the lengths of the segments to about where a point is: from there a walk is short.
inline Index jump(const WalkTask& task, double x, double y, double z) {
  Index at = task.start;
  for (int k = 0; k < kJumps; ++k) {
    const LineSegment& s = task.segments[at];
    const double t = (x - s.a[0]) * s.along[0] + (y - s.a[1]) * s.along[1] + (z - s.a[2]) * s.along[2];
    const double share = t / s.length;
    if (!(share <= -1 || share >= 2)) break;
    const double to = std::clamp(at + std::floor(share), static_cast<double>(task.begin), static_cast<double>(task.end - 1));
    if (static_cast<Index>(to) == at) break;
    at = static_cast<Index>(to);
  }
  return at;
}

#define FIELDDEFORM_LEVEL_SOURCE <fielddeform/gffd/detail/line_walk_level.h>
#include <fielddeform/core/detail/each_level.h>

FIELDDEFORM_BY_LEVEL(runWalk, const WalkTask, walkAll)

}  // namespace

void walkLine(const WalkTask& task) { runWalk(task); }

}  // namespace fielddeform::gffd::detail
