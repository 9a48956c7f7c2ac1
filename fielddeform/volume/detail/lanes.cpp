#include <fielddeform/core/detail/simd.h>
#include <fielddeform/volume/detail/lanes.h>

namespace fielddeform::volume::detail {
namespace {

using fielddeform::detail::SimdLevel;
using fielddeform::detail::simdLevel;

using fielddeform::detail::Two, fielddeform::detail::Four;

// By way of a class: a template argument loses its attributes.
struct Baseline {
  using Pack = Two;
};
struct Avx2 {
  using Pack = Four;
};

#define PACK(pointer) (*reinterpret_cast<const Pack*>(pointer))
#define PACK_OUT(pointer) (*reinterpret_cast<Pack*>(pointer))

struct DotTask {
  const double* rows;
  std::size_t stride, count;
  const double* columns;
  Vec3* out;
};

template <class L>
FIELDDEFORM_SIMD_INLINE void dotKernel(const DotTask& t) {
  using Pack = typename L::Pack;
  constexpr std::size_t lanes = sizeof(Pack) / 8, packs = kLanes / lanes;
  const std::size_t stride = t.stride;
  const double *x = t.columns, *y = x + stride, *z = y + stride, *row = t.rows;
  for (std::size_t r = 0; r < t.count; ++r, row += stride) {
    Pack a[packs] = {}, b[packs] = {}, c[packs] = {};
    for (std::size_t i = 0; i < stride; i += kLanes)
      for (std::size_t k = 0; k < packs; ++k) {
        const std::size_t at = i + k * lanes;
        const Pack w = PACK(row + at);
        a[k] += w * PACK(x + at);
        b[k] += w * PACK(y + at);
        c[k] += w * PACK(z + at);
      }
    double lane[3][kLanes];
    for (std::size_t k = 0; k < packs; ++k) PACK_OUT(lane[0] + k * lanes) = a[k], PACK_OUT(lane[1] + k * lanes) = b[k], PACK_OUT(lane[2] + k * lanes) = c[k];
    double* out = reinterpret_cast<double*>(t.out + r);
    for (std::size_t d = 0; d < 3; ++d) out[d] = (lane[d][0] + lane[d][2]) + (lane[d][1] + lane[d][3]);
  }
}

struct AddTask {
  const double* rows;
  std::size_t stride;
  const Index* index;
  std::size_t count;
  const Vec3* g;
  double* sums;
};

/// Two rows at once: half the traffic with the sums, and the same order of additions for each number.
template <class L>
FIELDDEFORM_SIMD_INLINE void addKernel(const AddTask& t) {
  using Pack = typename L::Pack;
  constexpr std::size_t lanes = sizeof(Pack) / 8;
  const std::size_t stride = t.stride;
  double *x = t.sums, *y = x + stride, *z = y + stride;
  const double* g = reinterpret_cast<const double*>(t.g);
  std::size_t r = 0;
  for (; r + 2 <= t.count; r += 2) {
    const double* a = t.rows + (t.index ? t.index[r] : r) * stride;
    const double* b = t.rows + (t.index ? t.index[r + 1] : r + 1) * stride;
    const double ax = g[3 * r], ay = g[3 * r + 1], az = g[3 * r + 2], bx = g[3 * r + 3], by = g[3 * r + 4], bz = g[3 * r + 5];
    for (std::size_t i = 0; i < stride; i += lanes) {
      const Pack p = PACK(a + i), q = PACK(b + i);
      PACK_OUT(x + i) = (PACK(x + i) + p * ax) + q * bx;
      PACK_OUT(y + i) = (PACK(y + i) + p * ay) + q * by;
      PACK_OUT(z + i) = (PACK(z + i) + p * az) + q * bz;
    }
  }
  for (; r < t.count; ++r) {
    const double* a = t.rows + (t.index ? t.index[r] : r) * stride;
    for (std::size_t i = 0; i < stride; i += lanes) {
      const Pack p = PACK(a + i);
      PACK_OUT(x + i) = PACK(x + i) + p * g[3 * r];
      PACK_OUT(y + i) = PACK(y + i) + p * g[3 * r + 1];
      PACK_OUT(z + i) = PACK(z + i) + p * g[3 * r + 2];
    }
  }
}

struct WedgeTask {
  const std::size_t* offset;
  std::size_t n, stride, width;
  const double *u, *v;
  const std::size_t* start;
  std::size_t count;
  double* out;
};

template <class L>
FIELDDEFORM_SIMD_INLINE void wedgeKernel(const WedgeTask& t) {
  using Pack = typename L::Pack;
  constexpr std::size_t lanes = sizeof(Pack) / 8;
  for (std::size_t r = 0; r < t.count; ++r) {
    const double *u = t.u + t.start[r] * t.stride, *v = t.v + t.start[r] * t.stride;
    const std::size_t products = t.start[r + 1] - t.start[r];
    for (std::size_t j = 0; j + 1 < t.n; ++j) {
      const std::size_t first = (j + 1) / kLanes * kLanes;
      double* out = t.out + r * t.width + t.offset[j];
      for (std::size_t k = first; k < t.stride; k += lanes) {
        Pack sum = {};
        for (std::size_t m = 0; m < products; ++m) {
          const double *a = u + m * t.stride, *b = v + m * t.stride;
          sum += a[j] * PACK(b + k) - PACK(a + k) * b[j];
        }
        PACK_OUT(out + (k - first)) = sum;
      }
    }
  }
}

struct OuterTask {
  const double *rows, *products;
  std::size_t stride, width, count;
  double* sums;
};

/// Four rows of sums, `packs` packs of each.
template <class L, std::size_t packs>
FIELDDEFORM_SIMD_INLINE void outerTile(const OuterTask& t, std::size_t i, std::size_t p) {
  using Pack = typename L::Pack;
  constexpr std::size_t lanes = sizeof(Pack) / 8;
  Pack sum[4][packs];
  for (std::size_t a = 0; a < 4; ++a)
    for (std::size_t b = 0; b < packs; ++b) sum[a][b] = PACK(t.sums + (i + a) * t.width + p + b * lanes);
  const double *row = t.rows + i, *product = t.products + p;
  for (std::size_t r = 0; r < t.count; ++r, row += t.stride, product += t.width)
    for (std::size_t b = 0; b < packs; ++b) {
      const Pack w = PACK(product + b * lanes);
      for (std::size_t a = 0; a < 4; ++a) sum[a][b] += row[a] * w;
    }
  for (std::size_t a = 0; a < 4; ++a)
    for (std::size_t b = 0; b < packs; ++b) PACK_OUT(t.sums + (i + a) * t.width + p + b * lanes) = sum[a][b];
}

template <class L>
FIELDDEFORM_SIMD_INLINE void outerKernel(const OuterTask& t) {
  constexpr std::size_t lanes = sizeof(typename L::Pack) / 8, wide = 2 * lanes;
  std::size_t p = 0;
  for (; p + wide <= t.width; p += wide)
    for (std::size_t i = 0; i < t.stride; i += 4) outerTile<L, 2>(t, i, p);
  for (; p < t.width; p += lanes)
    for (std::size_t i = 0; i < t.stride; i += 4) outerTile<L, 1>(t, i, p);
}

void dotBaseline(const DotTask& t) { dotKernel<Baseline>(t); }
FIELDDEFORM_SIMD_AVX2 void dotAvx2(const DotTask& t) { dotKernel<Avx2>(t); }
void addBaseline(const AddTask& t) { addKernel<Baseline>(t); }
FIELDDEFORM_SIMD_AVX2 void addAvx2(const AddTask& t) { addKernel<Avx2>(t); }
void wedgeBaseline(const WedgeTask& t) { wedgeKernel<Baseline>(t); }
FIELDDEFORM_SIMD_AVX2 void wedgeAvx2(const WedgeTask& t) { wedgeKernel<Avx2>(t); }
void outerBaseline(const OuterTask& t) { outerKernel<Baseline>(t); }
FIELDDEFORM_SIMD_AVX2 void outerAvx2(const OuterTask& t) { outerKernel<Avx2>(t); }

}  // namespace

void dot3Rows(const double* rows, std::size_t stride, std::size_t count, const double* columns, Vec3* out) {
  const DotTask task{rows, stride, count, columns, out};
  simdLevel() == SimdLevel::Baseline ? dotBaseline(task) : dotAvx2(task);
}

void addRows(const double* rows, std::size_t stride, const Index* index, std::size_t count, const Vec3* g, double* sums) {
  const AddTask task{rows, stride, index, count, g, sums};
  simdLevel() == SimdLevel::Baseline ? addBaseline(task) : addAvx2(task);
}

WedgeLayout::WedgeLayout(std::size_t nodes) : n(nodes), stride(padded(nodes)) {
  for (std::size_t j = 0; j + 1 < n; ++j) {
    offset.push_back(width);
    width += stride - first(j);
  }
}

void wedgeRows(const WedgeLayout& layout, const double* u, const double* v, const std::size_t* start, std::size_t count, double* out) {
  const WedgeTask task{layout.offset.data(), layout.n, layout.stride, layout.width, u, v, start, count, out};
  simdLevel() == SimdLevel::Baseline ? wedgeBaseline(task) : wedgeAvx2(task);
}

void addOuter(const WedgeLayout& layout, const double* rows, const double* products, std::size_t count, double* sums) {
  const OuterTask task{rows, products, layout.stride, layout.width, count, sums};
  simdLevel() == SimdLevel::Baseline ? outerBaseline(task) : outerAvx2(task);
}

}  // namespace fielddeform::volume::detail
