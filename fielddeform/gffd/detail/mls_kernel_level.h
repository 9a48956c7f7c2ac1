// The lanes of mls_kernel.cpp, by way of core/detail/each_level.h.
#ifndef LANES_TARGET
#error "included by core/detail/each_level.h alone"
#endif

#include <fielddeform/gffd/detail/lane_math_level.h>

struct Sums {
  Pack weight, scale, p[3], q[3], pq[9], turn[9];
};

// m = a b, rows.
LANES_INLINE void product(const Pack* a, const Pack* b, Pack* m) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) m[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
}

// The least distance in radii times 8 log2(e).
LANES_INLINE void nearestOf(const Task& task, const Pack* at, Pack& nearest) {
  Pack least = Pack{} + 1e300;
  const Pack px = at[0], py = at[1], pz = at[2];
  for (const MlsRun& run : task.runs)
    for (std::uint32_t j = run.begin; j < run.end; ++j) {
      const MlsTerm& term = task.terms[j];
      const Pack x = term.rest[0] - px, y = term.rest[1] - py, z = term.rest[2] - pz;
      const Pack square = (x * x + y * y + z * z) * term.steepness;
      least = square < least ? square : least;
    }
  const Pack found = least;
  sqrtLanes(found, nearest);
}

// Weights of some samples relative to the nearest one's; none below rounding.
LANES_INLINE void weigh(const MlsTerm* terms, std::size_t count, const Pack* at, const Pack& nearest, Pack* weights) {
  const Pack zero{}, px = at[0], py = at[1], pz = at[2], least = nearest;
  for (std::size_t i = 0; i < count; ++i) {
    const MlsTerm& term = terms[i];
    const Pack x = term.rest[0] - px, y = term.rest[1] - py, z = term.rest[2] - pz;
    const Pack square = (x * x + y * y + z * z) * term.steepness;
    Pack distance, w;
    sqrtLanes(square, distance);
    const Pack exponent = least - distance;
    powerOfTwoLanes(exponent, w);
    w = w * term.mass;
    weights[i] = exponent < kNegligible ? zero : w;
  }
}

LANES_INLINE void addFrames(const MlsTerm* terms, std::size_t count, const Pack* weights, Sums& s) {
  Pack weight = s.weight, scale = s.scale;
  Pack r0 = s.turn[0], r1 = s.turn[1], r2 = s.turn[2], r3 = s.turn[3], r4 = s.turn[4], r5 = s.turn[5], r6 = s.turn[6],
       r7 = s.turn[7], r8 = s.turn[8];
  for (std::size_t i = 0; i < count; ++i) {
    const MlsTerm& term = terms[i];
    const Pack w = weights[i];
    weight += w;
    scale += w * term.scale;
    r0 += w * term.rotation[0];
    r1 += w * term.rotation[1];
    r2 += w * term.rotation[2];
    r3 += w * term.rotation[3];
    r4 += w * term.rotation[4];
    r5 += w * term.rotation[5];
    r6 += w * term.rotation[6];
    r7 += w * term.rotation[7];
    r8 += w * term.rotation[8];
  }
  s.weight = weight;
  s.scale = scale;
  const Pack r[9] = {r0, r1, r2, r3, r4, r5, r6, r7, r8};
  for (int k = 0; k < 9; ++k) s.turn[k] = r[k];
}

LANES_INLINE void addPoints(const MlsTerm* terms, std::size_t count, const Pack* at, const Pack* weights, Sums& s) {
  const Pack ax = at[0], ay = at[1], az = at[2];
  Pack px = s.p[0], py = s.p[1], pz = s.p[2], qx = s.q[0], qy = s.q[1], qz = s.q[2];
  Pack xx = s.pq[0], xy = s.pq[1], xz = s.pq[2], yx = s.pq[3], yy = s.pq[4], yz = s.pq[5], zx = s.pq[6], zy = s.pq[7], zz = s.pq[8];
  for (std::size_t i = 0; i < count; ++i) {
    const MlsTerm& term = terms[i];
    const Pack w = weights[i];
    const Pack x = w * (term.rest[0] - ax), y = w * (term.rest[1] - ay), z = w * (term.rest[2] - az);
    const Pack u = term.posed[0] - ax, v = term.posed[1] - ay, t = term.posed[2] - az;
    px += x;
    py += y;
    pz += z;
    qx += w * u;
    qy += w * v;
    qz += w * t;
    xx += x * u;
    xy += x * v;
    xz += x * t;
    yx += y * u;
    yy += y * v;
    yz += y * t;
    zx += z * u;
    zy += z * v;
    zz += z * t;
  }
  const Pack p[3] = {px, py, pz}, q[3] = {qx, qy, qz}, pq[9] = {xx, xy, xz, yx, yy, yz, zx, zy, zz};
  for (int k = 0; k < 3; ++k) s.p[k] = p[k];
  for (int k = 0; k < 3; ++k) s.q[k] = q[k];
  for (int k = 0; k < 9; ++k) s.pq[k] = pq[k];
}

// Samples in their order, some at a time: weights, then sums, so that registers hold them.
LANES_INLINE void sumUp(const Task& task, const Pack* at, Sums& s) {
  constexpr std::uint32_t kSome = 32;
  Pack nearest, weights[kSome];
  nearestOf(task, at, nearest);
  s = Sums{};
  for (const MlsRun& run : task.runs)
    for (std::uint32_t j = run.begin; j < run.end; j += kSome) {
      const MlsTerm* terms = &task.terms[j];
      const std::size_t count = run.end - j < kSome ? run.end - j : kSome;
      weigh(terms, count, at, nearest, weights);
      addFrames(terms, count, weights, s);
      addPoints(terms, count, at, weights, s);
    }
}

// Orthonormal rows from the first two of a mean of rotations.
LANES_INLINE void orthonormal(const Pack* mean, Pack* r) {
  Pack length;
  sqrtLanes(mean[0] * mean[0] + mean[1] * mean[1] + mean[2] * mean[2], length);
  for (int k = 0; k < 3; ++k) r[k] = mean[k] / length;
  const Pack along = r[0] * mean[3] + r[1] * mean[4] + r[2] * mean[5];
  for (int k = 0; k < 3; ++k) r[3 + k] = mean[3 + k] - along * r[k];
  sqrtLanes(r[3] * r[3] + r[4] * r[4] + r[5] * r[5], length);
  for (int k = 0; k < 3; ++k) r[3 + k] = r[3 + k] / length;
  r[6] = r[1] * r[5] - r[2] * r[4];
  r[7] = r[2] * r[3] - r[0] * r[5];
  r[8] = r[0] * r[4] - r[1] * r[3];
}

// One step of numeric::polarRefine in lanes: r <- Cayley(w / 2) r towards the greatest tr(r a). Says whether it was the last.
LANES_INLINE void newton(const Pack* a, Pack* r, Pack& arrived) {
  Pack m[9], turn[9], next[9];
  product(r, a, m);
  const Pack trace = m[0] + m[4] + m[8];
  const Pack d0 = trace - m[0], d1 = trace - m[4], d2 = trace - m[8];
  const Pack e = -0.5 * (m[1] + m[3]), f = -0.5 * (m[2] + m[6]), g = -0.5 * (m[5] + m[7]);
  const Pack minor = d0 * d1 - e * e;
  const Pack c0 = d1 * d2 - g * g, c1 = f * g - e * d2, c2 = e * g - d1 * f;
  const Pack c11 = d0 * d2 - f * f, c12 = e * f - d0 * g;
  const Pack det = d0 * c0 + e * c1 + f * c2, size = d0 + d1 + d2;
  const Pack ax = m[5] - m[7], ay = m[6] - m[2], az = m[1] - m[3];
  const Pack scale = 0.5 / det;
  const Pack x = (c0 * ax + c1 * ay + c2 * az) * scale, y = (c1 * ax + c11 * ay + c12 * az) * scale,
             z = (c2 * ax + c12 * ay + minor * az) * scale;
  const Pack square = x * x + y * y + z * z;
  const Pack zero{}, one = zero + 1.0;
  const auto sound = (d0 > 0.0) & (minor > 0.0) & (det > kIllConditioned * (size * size * size));
  arrived = (sound & (square < kArrived)) ? one : zero;
  // The rotation of the quaternion (1, w / 2).
  const Pack s = 2.0 / (1.0 + square);
  turn[0] = 1.0 - s * (y * y + z * z);
  turn[1] = s * (x * y - z);
  turn[2] = s * (x * z + y);
  turn[3] = s * (x * y + z);
  turn[4] = 1.0 - s * (x * x + z * z);
  turn[5] = s * (y * z - x);
  turn[6] = s * (x * z - y);
  turn[7] = s * (y * z + x);
  turn[8] = 1.0 - s * (x * x + y * y);
  product(turn, r, next);
  for (int k = 0; k < 9; ++k) r[k] = next[k];
}

LANES_TARGET void mlsKernel(const Task& task) {
  for (std::size_t p = 0; p < task.count; p += sizeof(Pack) / 8) {
    Pack at[3];
    loadLanes(task.points.x, p, task.count, at[0]);
    loadLanes(task.points.y, p, task.count, at[1]);
    loadLanes(task.points.z, p, task.count, at[2]);
    Sums s;
    sumUp(task, at, s);
    const Pack inverse = 1.0 / s.weight, scale = s.scale / s.weight;
    Pack a[9], r[9], square = Pack{}, size, arrived;
    for (int k = 0; k < 3; ++k) {
      s.p[k] = s.p[k] * inverse;
      s.q[k] = s.q[k] * inverse;
    }
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        a[3 * i + j] = s.pq[3 * i + j] * inverse - s.p[i] * s.q[j];
        square += a[3 * i + j] * a[3 * i + j];
      }
    sqrtLanes(square, size);
    const Pack one = Pack{} + 1.0;
    const Pack share = 1.0 / (size > 0.0 ? size : one);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) a[3 * i + j] = a[3 * i + j] * share + kFrames * (s.turn[3 * j + i] * inverse);
    orthonormal(s.turn, r);
    for (int k = 0; k < kSteps; ++k) newton(a, r, arrived);
    store(arrived, task.out.settled + p);
    for (int k = 0; k < 9; ++k) store(r[k], task.out.turn[k] + p);
    store(s.q[0] - scale * (r[0] * s.p[0] + r[1] * s.p[1] + r[2] * s.p[2]), task.out.x + p);
    store(s.q[1] - scale * (r[3] * s.p[0] + r[4] * s.p[1] + r[5] * s.p[2]), task.out.y + p);
    store(s.q[2] - scale * (r[6] * s.p[0] + r[7] * s.p[1] + r[8] * s.p[2]), task.out.z + p);
  }
}
