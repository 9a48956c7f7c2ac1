// The lanes of line_walk.cpp, by way of core/detail/each_level.h.
#ifndef LANES_TARGET
#error "included by core/detail/each_level.h alone"
#endif

#include <fielddeform/gffd/detail/lane_math_level.h>

struct Foot {
  Pack x, y, z, square, along, element;
};

// The ends are met exactly, so that neighbours that share one agree to the bit.
LANES_INLINE void footOn(const LineSegment& s, Index element, const Pack& x, const Pack& y, const Pack& z, Foot& f) {
  const Pack zero{};
  const Pack ax = x - s.a[0], ay = y - s.a[1], az = z - s.a[2];
  const Pack t = ax * s.along[0] + ay * s.along[1] + az * s.along[2];
  const Pack inner = t > 0.0 ? t : zero;
  const Mask beyond = (t >= s.length) & (t > 0.0);
  f.x = beyond ? x - s.b[0] : ax - inner * s.along[0];
  f.y = beyond ? y - s.b[1] : ay - inner * s.along[1];
  f.z = beyond ? z - s.b[2] : az - inner * s.along[2];
  f.square = f.x * f.x + f.y * f.y + f.z * f.z;
  f.along = t;
  f.element = zero + static_cast<double>(element);
}

LANES_INLINE void take(const Mask& mask, const Foot& f, Foot& best) {
  best.x = mask ? f.x : best.x;
  best.y = mask ? f.y : best.y;
  best.z = mask ? f.z : best.z;
  best.square = mask ? f.square : best.square;
  best.along = mask ? f.along : best.along;
  best.element = mask ? f.element : best.element;
}

// Lanes walk together until the last has arrived. What that shows a lane beyond its own arrival is farther by more than
// rounding, so that its result is its own.
LANES_INLINE void walk(const WalkTask& task, Index at, const Pack& x, const Pack& y, const Pack& z, Foot& best) {
  const LineSegment* s = task.segments;
  footOn(s[at], at, x, y, z, best);
  const Pack start = best.along;
  Foot f;
  Mask going = start >= task.stops[at].after;
  for (Index i = at; i + 1 < task.end && anyOf(going); ++i) {
    footOn(s[i + 1], i + 1, x, y, z, f);
    take(f.square < best.square, f, best);
    going &= f.along >= task.stops[i + 1].after;
  }
  going = start <= task.stops[at].before;
  for (Index i = at; i > task.begin && anyOf(going); --i) {
    footOn(s[i - 1], i - 1, x, y, z, f);
    take(f.square <= best.square, f, best);  // of equals the first
    going &= f.along <= task.stops[i - 1].before;
  }
}

LANES_INLINE void tryAll(const WalkTask& task, const Pack& x, const Pack& y, const Pack& z, Foot& best) {
  const Pack zero{};
  best = {zero, zero, zero, zero + std::numeric_limits<double>::infinity(), zero, zero + static_cast<double>(task.begin)};
  Foot f;
  for (Index i = task.begin; i < task.end; ++i) {
    footOn(task.segments[i], i, x, y, z, f);
    take(f.square < best.square, f, best);
  }
}

LANES_TARGET void walkAll(const WalkTask& task) {
  for (std::size_t p = 0; p < task.count; p += sizeof(Pack) / 8) {
    Pack x, y, z;
    loadLanes(task.points.x, p, task.count, x);
    loadLanes(task.points.y, p, task.count, y);
    loadLanes(task.points.z, p, task.count, z);
    Foot best;
    if (task.stops) walk(task, jump(task, task.points.x[p], task.points.y[p], task.points.z[p]), x, y, z, best);
    else tryAll(task, x, y, z, best);
    store(best.x, task.hits.x + p);
    store(best.y, task.hits.y + p);
    store(best.z, task.hits.z + p);
    store(best.square, task.hits.square + p);
    store(best.along, task.hits.along + p);
    store(best.element, task.hits.element + p);
  }
}
