#include <fielddeform/core/detail/simd.h>
#include <fielddeform/gffd/detail/grid_kernel.h>
#include <fielddeform/gffd/detail/lane_math.h>
#include <fielddeform/numeric/elementary.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace fielddeform::gffd::detail {
namespace {

using fielddeform::detail::SimdLevel;
using fielddeform::detail::simdLevel;

constexpr double kLog2E = 1.4426950408889634;

// Lagrange's cubic through f at -1, 0, 1, 2 in powers of t, for n neighbouring columns; differences first, so that equal
// values give exactly a constant.
FIELDDEFORM_SIMD_INLINE void powers(double* f, std::size_t stride, std::size_t n) {
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

struct NodesTask {
  double* cell;
};

template <class L>
FIELDDEFORM_SIMD_INLINE void nodesKernel(const NodesTask& task) {
  powers(task.cell, 48, 48);
  for (std::size_t i = 0; i < 4; ++i) powers(task.cell + 48 * i, 12, 12);
  for (std::size_t i = 0; i < 16; ++i) powers(task.cell + 12 * i, 3, 3);
}

struct CubicTask {
  const double* cell;
  std::size_t count;
  const double *u, *v, *w;
  double *x, *y, *z;
};

// Horner on three axes. Coefficient of u^i v^j w^k, component e: cell[48 i + 12 j + 3 k + e].
template <class L>
FIELDDEFORM_SIMD_INLINE void cubicKernel(const CubicTask& task) {
  using Pack = typename L::Pack;
  constexpr std::size_t lanes = sizeof(Pack) / 8;
  const double* cell = task.cell;
  for (std::size_t p = 0; p < task.count; p += lanes) {
    Pack u, v, w;
    std::memcpy(&u, task.u + p, sizeof(Pack));
    std::memcpy(&v, task.v + p, sizeof(Pack));
    std::memcpy(&w, task.w + p, sizeof(Pack));
    Pack sum[3] = {};
    for (int i = 3; i >= 0; --i) {
      Pack plane[3] = {};
      for (int j = 3; j >= 0; --j) {
        const double* c = cell + 48 * i + 12 * j;
        for (int e = 0; e < 3; ++e) plane[e] = plane[e] * v + (((c[9 + e] * w + c[6 + e]) * w + c[3 + e]) * w + c[e]);
      }
      for (int e = 0; e < 3; ++e) sum[e] = sum[e] * u + plane[e];
    }
    storeLanes(sum[0], task.x + p);
    storeLanes(sum[1], task.y + p);
    storeLanes(sum[2], task.z + p);
  }
}

struct OneTask {
  const LineHits& hits;
  double radius, reference;
  LineValues& out;
};

template <class L>
FIELDDEFORM_SIMD_INLINE void oneKernel(const OneTask& task) {
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

struct AddTask {
  const LineHits& hits;
  const LineTerm& term;
  double sharpness, end;
  LineSums& sums;
};

template <class L>
FIELDDEFORM_SIMD_INLINE void addKernel(const AddTask& task) {
  using Pack = typename L::Pack;
  const LineHits& h = task.hits;
  LineSums& s = task.sums;
  const double weight = task.term.weight, k = task.sharpness, end = task.end, inverse = 1 / task.term.radius;
  const Pack zero{}, one = zero + 1.0, plain = zero + (task.term.plain ? 1.0 : 0.0);
  for (std::size_t i = 0; i < kLanes; i += sizeof(Pack) / 8) {
    const auto at = [i](const double* numbers, Pack& to) __attribute__((always_inline)) { std::memcpy(&to, numbers + i, sizeof(Pack)); };
    Pack square, d, e, sum, active, known, only, x, y, z, gx, gy, gz;
    at(h.square, square);
    sqrtLanes(square, d);
    const Pack f = d * inverse;
    const Pack exponent = f * (-kLog2E * k);
    powerOfTwoLanes(exponent, e);
    const auto reaches = (e > end) & (f < 1.0);
    const Pack add = reaches ? weight * (e - end) : zero;
    const Pack slope = reaches ? (weight * inverse) * e / d : zero;
    at(s.sum, sum);
    storeLanes<Pack>(sum + add, s.sum + i);
    at(h.x, x);
    at(h.y, y);
    at(h.z, z);
    at(s.gx, gx);
    at(s.gy, gy);
    at(s.gz, gz);
    storeLanes<Pack>(gx + slope * x, s.gx + i);
    storeLanes<Pack>(gy + slope * y, s.gy + i);
    storeLanes<Pack>(gz + slope * z, s.gz + i);
    at(s.active, active);
    at(s.plain, known);
    at(s.only, only);
    storeLanes<Pack>(active + (reaches ? one : zero), s.active + i);
    storeLanes<Pack>(reaches ? plain : known, s.plain + i);
    storeLanes<Pack>(reaches ? f : only, s.only + i);
  }
}

struct FinishTask {
  const LineSums& sums;
  double sharpness, end, slopeFloor, reference;
  LineValues& out;
};

template <class L>
FIELDDEFORM_SIMD_INLINE void finishKernel(const FinishTask& task) {
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

FIELDDEFORM_LANES(runNodes, NodesTask, nodesKernel)
FIELDDEFORM_LANES(runCubic, CubicTask, cubicKernel)
FIELDDEFORM_LANES(runOne, OneTask, oneKernel)
FIELDDEFORM_LANES(runAdd, AddTask, addKernel)
FIELDDEFORM_LANES(runFinish, FinishTask, finishKernel)

}  // namespace

void cubicFromNodes(double* cell) { runNodes({cell}); }

void cubicAt(const double* cell, std::size_t count, const double* u, const double* v, const double* w, double* x, double* y,
             double* z) {
  runCubic({cell, count, u, v, w, x, y, z});
}

void oneLine(const LineHits& hits, double radius, double reference, LineValues& out) { runOne({hits, radius, reference, out}); }

void addLine(const LineHits& hits, const LineTerm& term, double sharpness, double end, LineSums& sums) {
  runAdd({hits, term, sharpness, end, sums});
}

void finishLines(const LineSums& sums, double sharpness, double end, double slopeFloor, double reference, LineValues& out) {
  runFinish({sums, sharpness, end, slopeFloor, reference, out});
}

}  // namespace fielddeform::gffd::detail
