#include <fielddeform/core/detail/simd.h>
#include <fielddeform/gffd/detail/lane_math.h>
#include <fielddeform/gffd/detail/line_walk.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace fielddeform::gffd::detail {
namespace {

using fielddeform::detail::SimdLevel;
using fielddeform::detail::simdLevel;

constexpr int kJumps = 8;

// By the lengths of the segments to about where a point is: from there a walk is short.
FIELDDEFORM_SIMD_INLINE Index jump(const WalkTask& task, double x, double y, double z) {
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

template <class Pack>
struct Foot {
  Pack x, y, z, square, along, element;
};

// The ends are met exactly, so that neighbours that share one agree to the bit.
template <class Pack>
FIELDDEFORM_SIMD_INLINE void footOn(const LineSegment& s, Index element, const Pack& x, const Pack& y, const Pack& z, Foot<Pack>& f) {
  const Pack zero{};
  const Pack ax = x - s.a[0], ay = y - s.a[1], az = z - s.a[2];
  const Pack t = ax * s.along[0] + ay * s.along[1] + az * s.along[2];
  const Pack inner = t > 0.0 ? t : zero;
  const auto beyond = (t >= s.length) & (t > 0.0);
  f.x = beyond ? x - s.b[0] : ax - inner * s.along[0];
  f.y = beyond ? y - s.b[1] : ay - inner * s.along[1];
  f.z = beyond ? z - s.b[2] : az - inner * s.along[2];
  f.square = f.x * f.x + f.y * f.y + f.z * f.z;
  f.along = t;
  f.element = zero + static_cast<double>(element);
}

template <class Pack, class Mask>
FIELDDEFORM_SIMD_INLINE void take(const Mask& mask, const Foot<Pack>& f, Foot<Pack>& best) {
  best.x = mask ? f.x : best.x;
  best.y = mask ? f.y : best.y;
  best.z = mask ? f.z : best.z;
  best.square = mask ? f.square : best.square;
  best.along = mask ? f.along : best.along;
  best.element = mask ? f.element : best.element;
}

// Lanes walk together until the last has arrived. What that shows a lane beyond its own arrival is farther by more than
// rounding, so that its result is its own.
template <class Pack>
FIELDDEFORM_SIMD_INLINE void walk(const WalkTask& task, Index at, const Pack& x, const Pack& y, const Pack& z, Foot<Pack>& best) {
  const LineSegment* s = task.segments;
  footOn(s[at], at, x, y, z, best);
  const Pack start = best.along;
  Foot<Pack> f;
  auto going = start >= task.stops[at].after;
  for (Index i = at; i + 1 < task.end && anyLane(going); ++i) {
    footOn(s[i + 1], i + 1, x, y, z, f);
    take(f.square < best.square, f, best);
    going &= f.along >= task.stops[i + 1].after;
  }
  going = start <= task.stops[at].before;
  for (Index i = at; i > task.begin && anyLane(going); --i) {
    footOn(s[i - 1], i - 1, x, y, z, f);
    take(f.square <= best.square, f, best);  // of equals the first
    going &= f.along <= task.stops[i - 1].before;
  }
}

template <class Pack>
FIELDDEFORM_SIMD_INLINE void tryAll(const WalkTask& task, const Pack& x, const Pack& y, const Pack& z, Foot<Pack>& best) {
  const Pack zero{};
  best = {zero, zero, zero, zero + std::numeric_limits<double>::infinity(), zero, zero + static_cast<double>(task.begin)};
  Foot<Pack> f;
  for (Index i = task.begin; i < task.end; ++i) {
    footOn(task.segments[i], i, x, y, z, f);
    take(f.square < best.square, f, best);
  }
}

template <class L>
FIELDDEFORM_SIMD_INLINE void walkKernel(const WalkTask& task) {
  using Pack = typename L::Pack;
  constexpr std::size_t lanes = sizeof(Pack) / 8;
  for (std::size_t p = 0; p < task.count; p += lanes) {
    Pack x, y, z;
    loadLanes(task.points.x, p, task.count, x);
    loadLanes(task.points.y, p, task.count, y);
    loadLanes(task.points.z, p, task.count, z);
    Foot<Pack> best;
    if (task.stops) walk(task, jump(task, task.points.x[p], task.points.y[p], task.points.z[p]), x, y, z, best);
    else tryAll(task, x, y, z, best);
    storeLanes(best.x, task.hits.x + p);
    storeLanes(best.y, task.hits.y + p);
    storeLanes(best.z, task.hits.z + p);
    storeLanes(best.square, task.hits.square + p);
    storeLanes(best.along, task.hits.along + p);
    storeLanes(best.element, task.hits.element + p);
  }
}

FIELDDEFORM_LANES(runWalk, WalkTask, walkKernel)

}  // namespace

void walkLine(const WalkTask& task) { runWalk(task); }

}  // namespace fielddeform::gffd::detail
