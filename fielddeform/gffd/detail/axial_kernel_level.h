// The lanes of axial_kernel.cpp, by way of core/detail/each_level.h.
#ifndef LANES_TARGET
#error "included by core/detail/each_level.h alone"
#endif

#include <fielddeform/gffd/detail/lane_math_level.h>

struct Turned {
  Pack q[4], move[3], nearness;
};

// v + 2 w (u x v) + 2 u x (u x v), q = (u, w).
LANES_INLINE void rotate(const Pack* q, const Pack* v, Pack* out) {
  const Pack x = q[1] * v[2] - q[2] * v[1], y = q[2] * v[0] - q[0] * v[2], z = q[0] * v[1] - q[1] * v[0];
  out[0] = v[0] + 2.0 * (q[3] * x + (q[1] * z - q[2] * y));
  out[1] = v[1] + 2.0 * (q[3] * y + (q[2] * x - q[0] * z));
  out[2] = v[2] + 2.0 * (q[3] * z + (q[0] * y - q[1] * x));
}

LANES_INLINE void turn(const FrameBlock& f, const Block& points, std::size_t p, std::size_t count, Turned& out) {
  Pack square, radius, length, scale, point[3], back[3], turned[3];
  for (int k = 0; k < 4; ++k) load(f.at[FrameBlock::kTurn + k] + p, out.q[k]);
  square = out.q[0] * out.q[0] + out.q[1] * out.q[1] + out.q[2] * out.q[2] + out.q[3] * out.q[3];
  sqrtLanes(square, length);
  for (int k = 0; k < 4; ++k) out.q[k] = out.q[k] / length;
  loadLanes(points.x, p, count, point[0]);
  loadLanes(points.y, p, count, point[1]);
  loadLanes(points.z, p, count, point[2]);
  for (int k = 0; k < 3; ++k) {
    load(f.at[FrameBlock::kRest + k] + p, back[k]);
    back[k] = back[k] - point[k];
  }
  rotate(out.q, back, turned);
  load(f.at[FrameBlock::kScale] + p, scale);
  for (int k = 0; k < 3; ++k) {
    load(f.at[FrameBlock::kMove + k] + p, out.move[k]);
    out.move[k] = out.move[k] - (scale * turned[k] - back[k]);
  }
  load(f.distance + p, square);
  load(f.at[FrameBlock::kRadius] + p, radius);
  sqrtLanes(square, out.nearness);
  out.nearness = out.nearness / radius;
}

LANES_TARGET void oneKernel(const OneTask& task) {
  Turned m;
  for (std::size_t p = 0; p < task.count; p += sizeof(Pack) / 8) {
    turn(task.frames, task.points, p, task.count, m);
    store(m.move[0], task.out.x + p);
    store(m.move[1], task.out.y + p);
    store(m.move[2], task.out.z + p);
    store(m.q[0], task.out.qx + p);
    store(m.q[1], task.out.qy + p);
    store(m.q[2], task.out.qz + p);
    store(m.q[3], task.out.qw + p);
    store(m.nearness, task.out.nearness + p);
  }
}

LANES_INLINE void addTo(double* sum, bool first, const Pack& x) {
  Pack before{};
  if (!first) load(sum, before);
  before = before + x;
  store(before, sum);
}

LANES_TARGET void addKernel(const AddTask& task) {
  MotionSums& s = task.sums;
  Turned m;
  Pack first[4], weight, nearest, dual[4];
  for (std::size_t p = 0; p < task.count; p += sizeof(Pack) / 8) {
    turn(task.frames, task.points, p, task.count, m);
    nearest = m.nearness;
    for (int k = 0; k < 4; ++k) {
      if (task.first) store(m.q[k], s.first[k] + p);
      load(s.first[k] + p, first[k]);
    }
    if (!task.first) {
      load(s.nearness + p, nearest);
      nearest = m.nearness < nearest ? m.nearness : nearest;
    }
    store(nearest, s.nearness + p);
    const Pack exponent = m.nearness * -kFall;
    powerOfTwoLanes(exponent, weight);
    const Pack same = m.q[0] * first[0] + m.q[1] * first[1] + m.q[2] * first[2] + m.q[3] * first[3];
    weight = same < 0.0 ? -weight : weight;
    // Dual part t q / 2 of the unit dual quaternion.
    const Pack *q = m.q, *t = m.move;
    dual[0] = t[0] * q[3] + (t[1] * q[2] - t[2] * q[1]);
    dual[1] = t[1] * q[3] + (t[2] * q[0] - t[0] * q[2]);
    dual[2] = t[2] * q[3] + (t[0] * q[1] - t[1] * q[0]);
    dual[3] = -(t[0] * q[0] + t[1] * q[1] + t[2] * q[2]);
    for (int k = 0; k < 4; ++k) {
      addTo(s.real[k] + p, task.first, weight * q[k]);
      addTo(s.dual[k] + p, task.first, weight * (0.5 * dual[k]));
    }
  }
}

LANES_TARGET void finishKernel(const FinishTask& task) {
  const MotionSums& s = task.sums;
  Pack q[4], d[4], length, nearest;
  const Pack none = Pack{} + std::numeric_limits<double>::quiet_NaN();
  for (std::size_t p = 0; p < task.count; p += sizeof(Pack) / 8) {
    for (int k = 0; k < 4; ++k) {
      load(s.real[k] + p, q[k]);
      load(s.dual[k] + p, d[k]);
    }
    const Pack square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    sqrtLanes(square, length);
    for (int k = 0; k < 4; ++k) {
      q[k] = q[k] / length;
      d[k] = d[k] / length;
    }
    // 2 vec(d conj(q)).
    Pack x = 2.0 * ((d[0] * q[3] - d[3] * q[0]) - (d[1] * q[2] - d[2] * q[1]));
    Pack y = 2.0 * ((d[1] * q[3] - d[3] * q[1]) - (d[2] * q[0] - d[0] * q[2]));
    Pack z = 2.0 * ((d[2] * q[3] - d[3] * q[2]) - (d[0] * q[1] - d[1] * q[0]));
    x = square > kLeast ? x : none;
    store(x, task.out.x + p);
    store(y, task.out.y + p);
    store(z, task.out.z + p);
    store(q[0], task.out.qx + p);
    store(q[1], task.out.qy + p);
    store(q[2], task.out.qz + p);
    store(q[3], task.out.qw + p);
    load(s.nearness + p, nearest);
    store(nearest, task.out.nearness + p);
  }
}
