// The lanes of grid_kernel.cpp, by way of core/detail/each_level.h.
#ifndef LANES_TARGET
#error "included by core/detail/each_level.h alone"
#endif

#include <fielddeform/gffd/detail/lane_math_level.h>

// Lagrange's cubic through f at -1, 0, 1, 2 in powers of t, for n neighbouring columns; differences first, so that equal
// values give exactly a constant.
LANES_INLINE void powers(double* f, std::size_t stride, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i) {
    const double a = f[i], b = f[stride + i], c = f[2 * stride + i], d = f[3 * stride + i];
    const double step = c - b;
    const double third = ((d - a) - 3 * step) * (1.0 / 6);
    const double second = ((a - b) + step) * 0.5;
    f[i] = b;
    f[stride + i] = (step - second) - third;
    f[2 * stride + i] = second;
    f[3 * stride + i] = third;
  }
}

LANES_TARGET void nodesKernel(const NodesTask& task) {
  powers(task.cell, 48, 48);
  for (std::size_t i = 0; i < 4; ++i) powers(task.cell + 48 * i, 12, 12);
  for (std::size_t i = 0; i < 16; ++i) powers(task.cell + 12 * i, 3, 3);
}

// Horner on three axes. Coefficient of u^i v^j w^k, component e: cell[48 i + 12 j + 3 k + e].
LANES_TARGET void cubicKernel(const CubicTask& task) {
  constexpr std::size_t lanes = sizeof(Pack) / 8;
  const double* cell = task.cell;
  for (std::size_t p = 0; p < task.count; p += lanes) {
    Pack u, v, w;
    load(task.u + p, u);
    load(task.v + p, v);
    load(task.w + p, w);
    Pack sum[3] = {};
    for (int i = 3; i >= 0; --i) {
      Pack plane[3] = {};
      for (int j = 3; j >= 0; --j) {
        const double* c = cell + 48 * i + 12 * j;
        for (int e = 0; e < 3; ++e) plane[e] = plane[e] * v + (((c[9 + e] * w + c[6 + e]) * w + c[3 + e]) * w + c[e]);
      }
      for (int e = 0; e < 3; ++e) sum[e] = sum[e] * u + plane[e];
    }
    store(sum[0], task.x + p);
    store(sum[1], task.y + p);
    store(sum[2], task.z + p);
  }
}

LANES_TARGET void oneKernel(const OneTask& task) {
  const LineHits& h = task.hits;
  LineValues& o = task.out;
  const double slope = task.reference / task.radius;
  for (std::size_t i = 0; i < kLanes; ++i) {
    const double d = std::sqrt(h.square[i]);
    const double s = slope / d;
    o.value[i] = task.reference * (d / task.radius);
    o.gx[i] = h.x[i] * s;
    o.gy[i] = h.y[i] * s;
    o.gz[i] = h.z[i] * s;
  }
}

LANES_TARGET void addKernel(const AddTask& task) {
  const LineHits& h = task.hits;
  LineSums& s = task.sums;
  const double weight = task.term.weight, k = task.sharpness, end = task.end, inverse = 1 / task.term.radius;
  const Pack zero{}, one = zero + 1.0, plain = zero + (task.term.plain ? 1.0 : 0.0);
  for (std::size_t i = 0; i < kLanes; i += sizeof(Pack) / 8) {
    Pack square, d, e, sum, active, known, only, x, y, z, gx, gy, gz;
    load(h.square + i, square);
    sqrtLanes(square, d);
    const Pack f = d * inverse;
    const Pack exponent = f * (-kLog2E * k);
    powerOfTwoLanes(exponent, e);
    const auto reaches = (e > end) & (f < 1.0);
    const Pack add = reaches ? weight * (e - end) : zero;
    const Pack slope = reaches ? (weight * inverse) * e / d : zero;
    load(s.sum + i, sum);
    store(sum + add, s.sum + i);
    load(h.x + i, x);
    load(h.y + i, y);
    load(h.z + i, z);
    load(s.gx + i, gx);
    load(s.gy + i, gy);
    load(s.gz + i, gz);
    store(gx + slope * x, s.gx + i);
    store(gy + slope * y, s.gy + i);
    store(gz + slope * z, s.gz + i);
    load(s.active + i, active);
    load(s.plain + i, known);
    load(s.only + i, only);
    store(active + (reaches ? one : zero), s.active + i);
    store(reaches ? plain : known, s.plain + i);
    store(reaches ? f : only, s.only + i);
  }
}

LANES_TARGET void finishKernel(const FinishTask& task) {
  const LineSums& s = task.sums;
  LineValues& o = task.out;
  const double k = task.sharpness, reference = task.reference, floor = task.slopeFloor;
  for (std::size_t i = 0; i < kLanes; ++i) {
    const double total = s.sum[i] + task.end;
    const double x = -numeric::log(total);
    // Alone, a primitive of weight 1 has the slope of its distance: there is no floor under it.
    const bool single = s.active[i] * s.plain[i] == 1;
    double steepness = total;
    steepness = !single && 2 * x < k && steepness < floor ? floor : steepness;
    const double slope = reference / steepness;
    const double value = single ? reference * s.only[i] : reference * (x / k);
    o.value[i] = s.active[i] > 0 ? value : std::numeric_limits<double>::quiet_NaN();
    o.gx[i] = slope * s.gx[i];
    o.gy[i] = slope * s.gy[i];
    o.gz[i] = slope * s.gz[i];
  }
}
