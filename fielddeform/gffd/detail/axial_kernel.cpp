#include <fielddeform/core/detail/simd.h>
#include <fielddeform/gffd/detail/axial_kernel.h>
#include <fielddeform/gffd/detail/lane_math.h>

#include <limits>

namespace fielddeform::gffd::detail {
namespace {

using fielddeform::detail::SimdLevel;
using fielddeform::detail::simdLevel;

constexpr double kFall = 4 * 1.4426950408889634;  // weights 2^(-kFall d / r) = exp(-4 d / r)
constexpr double kLeast = 1e-200;                 // of a squared length: below it nothing was summed up

template <class Pack>
struct Turned {
  Pack q[4], move[3], nearness;
};

// v + 2 w (u x v) + 2 u x (u x v), q = (u, w).
template <class Pack>
FIELDDEFORM_SIMD_INLINE void rotate(const Pack* q, const Pack* v, Pack* out) {
  const Pack x = q[1] * v[2] - q[2] * v[1], y = q[2] * v[0] - q[0] * v[2], z = q[0] * v[1] - q[1] * v[0];
  out[0] = v[0] + 2.0 * (q[3] * x + (q[1] * z - q[2] * y));
  out[1] = v[1] + 2.0 * (q[3] * y + (q[2] * x - q[0] * z));
  out[2] = v[2] + 2.0 * (q[3] * z + (q[0] * y - q[1] * x));
}

template <class Pack>
FIELDDEFORM_SIMD_INLINE void turn(const FrameBlock& f, const Block& points, std::size_t p, std::size_t count, Turned<Pack>& out) {
  const auto channel = [&](int c, Pack& to) __attribute__((always_inline)) { std::memcpy(&to, f.at[c] + p, sizeof(Pack)); };
  Pack square, radius, length, scale, point[3], back[3], turned[3];
  for (int k = 0; k < 4; ++k) channel(FrameBlock::kTurn + k, out.q[k]);
  square = out.q[0] * out.q[0] + out.q[1] * out.q[1] + out.q[2] * out.q[2] + out.q[3] * out.q[3];
  sqrtLanes(square, length);
  for (int k = 0; k < 4; ++k) out.q[k] = out.q[k] / length;
  loadLanes(points.x, p, count, point[0]);
  loadLanes(points.y, p, count, point[1]);
  loadLanes(points.z, p, count, point[2]);
  for (int k = 0; k < 3; ++k) {
    channel(FrameBlock::kRest + k, back[k]);
    back[k] = back[k] - point[k];
  }
  rotate(out.q, back, turned);
  channel(FrameBlock::kScale, scale);
  for (int k = 0; k < 3; ++k) {
    channel(FrameBlock::kMove + k, out.move[k]);
    out.move[k] = out.move[k] - (scale * turned[k] - back[k]);
  }
  std::memcpy(&square, f.distance + p, sizeof(Pack));
  channel(FrameBlock::kRadius, radius);
  sqrtLanes(square, out.nearness);
  out.nearness = out.nearness / radius;
}

struct OneTask {
  const FrameBlock& frames;
  const Block& points;
  std::size_t count;
  MotionBlock& out;
};

template <class L>
FIELDDEFORM_SIMD_INLINE void oneKernel(const OneTask& task) {
  using Pack = typename L::Pack;
  Turned<Pack> m;
  for (std::size_t p = 0; p < task.count; p += sizeof(Pack) / 8) {
    turn(task.frames, task.points, p, task.count, m);
    storeLanes(m.move[0], task.out.x + p);
    storeLanes(m.move[1], task.out.y + p);
    storeLanes(m.move[2], task.out.z + p);
    storeLanes(m.q[0], task.out.qx + p);
    storeLanes(m.q[1], task.out.qy + p);
    storeLanes(m.q[2], task.out.qz + p);
    storeLanes(m.q[3], task.out.qw + p);
    storeLanes(m.nearness, task.out.nearness + p);
  }
}

struct AddTask {
  const FrameBlock& frames;
  const Block& points;
  std::size_t count;
  bool first;
  MotionSums& sums;
};

template <class Pack>
FIELDDEFORM_SIMD_INLINE void addTo(double* sum, bool first, const Pack& x) {
  Pack before{};
  if (!first) std::memcpy(&before, sum, sizeof(Pack));
  before = before + x;
  storeLanes(before, sum);
}

template <class L>
FIELDDEFORM_SIMD_INLINE void addKernel(const AddTask& task) {
  using Pack = typename L::Pack;
  MotionSums& s = task.sums;
  Turned<Pack> m;
  Pack first[4], weight, nearest, dual[4];
  for (std::size_t p = 0; p < task.count; p += sizeof(Pack) / 8) {
    turn(task.frames, task.points, p, task.count, m);
    nearest = m.nearness;
    for (int k = 0; k < 4; ++k) {
      if (task.first) storeLanes(m.q[k], s.first[k] + p);
      std::memcpy(&first[k], s.first[k] + p, sizeof(Pack));
    }
    if (!task.first) {
      std::memcpy(&nearest, s.nearness + p, sizeof(Pack));
      nearest = m.nearness < nearest ? m.nearness : nearest;
    }
    storeLanes(nearest, s.nearness + p);
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
      addTo<Pack>(s.real[k] + p, task.first, weight * q[k]);
      addTo<Pack>(s.dual[k] + p, task.first, weight * (0.5 * dual[k]));
    }
  }
}

struct FinishTask {
  const MotionSums& sums;
  std::size_t count;
  MotionBlock& out;
};

template <class L>
FIELDDEFORM_SIMD_INLINE void finishKernel(const FinishTask& task) {
  using Pack = typename L::Pack;
  const MotionSums& s = task.sums;
  Pack q[4], d[4], length, nearest;
  const Pack none = Pack{} + std::numeric_limits<double>::quiet_NaN();
  for (std::size_t p = 0; p < task.count; p += sizeof(Pack) / 8) {
    for (int k = 0; k < 4; ++k) {
      std::memcpy(&q[k], s.real[k] + p, sizeof(Pack));
      std::memcpy(&d[k], s.dual[k] + p, sizeof(Pack));
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
    storeLanes(x, task.out.x + p);
    storeLanes(y, task.out.y + p);
    storeLanes(z, task.out.z + p);
    storeLanes(q[0], task.out.qx + p);
    storeLanes(q[1], task.out.qy + p);
    storeLanes(q[2], task.out.qz + p);
    storeLanes(q[3], task.out.qw + p);
    std::memcpy(&nearest, s.nearness + p, sizeof(Pack));
    storeLanes(nearest, task.out.nearness + p);
  }
}

FIELDDEFORM_LANES(runOne, OneTask, oneKernel)
FIELDDEFORM_LANES(runAdd, AddTask, addKernel)
FIELDDEFORM_LANES(runFinish, FinishTask, finishKernel)

}  // namespace

void frameMotion(const FrameBlock& frames, const Block& points, std::size_t count, MotionBlock& out) {
  runOne({frames, points, count, out});
}

void addFrameMotion(const FrameBlock& frames, const Block& points, std::size_t count, bool first, MotionSums& sums) {
  runAdd({frames, points, count, first, sums});
}

void finishMotions(const MotionSums& sums, std::size_t count, MotionBlock& out) { runFinish({sums, count, out}); }

}  // namespace fielddeform::gffd::detail
