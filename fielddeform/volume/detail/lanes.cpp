#include <fielddeform/core/detail/simd.h>
#include <fielddeform/volume/detail/lanes.h>

#include <algorithm>

namespace fielddeform::volume::detail {
namespace {

using fielddeform::detail::SimdLevel;
using fielddeform::detail::simdLevel;

using fielddeform::detail::Two, fielddeform::detail::Four, fielddeform::detail::Eight;

// By way of a class: a template argument loses its attributes.
struct TwoLanes {
  using Pack = Two;
  static constexpr std::size_t count = 2;
};
struct FourLanes {
  using Pack = Four;
  static constexpr std::size_t count = 4;
};
struct EightLanes {
  using Pack = Eight;
  static constexpr std::size_t count = 8;
};
/// Sums: what the four fixed lanes of a sum allow. Wide: where lanes never meet; Rest: for the last of rows padded to kLanes.
struct Baseline {
  using Sums = TwoLanes;
  using Wide = TwoLanes;
  using Rest = TwoLanes;
};
struct Avx2 {
  using Sums = FourLanes;
  using Wide = FourLanes;
  using Rest = FourLanes;
};
struct Avx512 {
  using Sums = FourLanes;
  using Wide = EightLanes;
  using Rest = FourLanes;
};

#define PACK(pointer) (*reinterpret_cast<const Pack*>(pointer))
#define PACK_OUT(pointer) (*reinterpret_cast<Pack*>(pointer))

struct DotTask {
  const double* rows;
  std::size_t stride, count;
  const double* columns;
  const Vec3* base;
  Vec3* out;
};

template <class L>
FIELDDEFORM_SIMD_INLINE void dotKernel(const DotTask& t) {
  using Pack = typename L::Sums::Pack;
  constexpr std::size_t lanes = L::Sums::count, packs = kLanes / lanes;
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
    const double* base = t.base ? reinterpret_cast<const double*>(t.base + r) : nullptr;
    for (std::size_t d = 0; d < 3; ++d) {
      const double sum = (lane[d][0] + lane[d][2]) + (lane[d][1] + lane[d][3]);
      out[d] = base ? base[d] + sum : sum;
    }
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
  using Pack = typename L::Rest::Pack;
  constexpr std::size_t lanes = L::Rest::count;
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
  const WedgePlan::Product* product;
  const std::size_t* start;  // of each owner's products
  const double* rows;
  std::size_t count;
  double* u;     // the differences of one owner's products
  double* zero;  // a row for those that subtract nothing
  double* out;
};

/// One pack of columns of J rows of an owner's sum, which begin at the same column.
template <class P, std::size_t J>
FIELDDEFORM_SIMD_INLINE void wedgeTile(const WedgeTask& t, const WedgePlan::Product* product, std::size_t products, std::size_t j, std::size_t k, double* out) {
  using Pack = typename P::Pack;
  Pack sum[J] = {};
  for (std::size_t m = 0; m < products; ++m) {
    const double *a = t.u + m * t.stride, *b = t.rows + product[m].second * t.stride;
    const Pack p = PACK(a + k), q = PACK(b + k);
    for (std::size_t i = 0; i < J; ++i) sum[i] += a[j + i] * q - p * b[j + i];
  }
  for (std::size_t i = 0; i < J; ++i) PACK_OUT(out + t.offset[j + i] + (k - WedgeLayout::first(j))) = sum[i];
}

template <class L, std::size_t J>
FIELDDEFORM_SIMD_INLINE void wedgeGroup(const WedgeTask& t, const WedgePlan::Product* product, std::size_t products, std::size_t j, double* out) {
  std::size_t k = WedgeLayout::first(j);
  for (; k + L::Wide::count <= t.stride; k += L::Wide::count) wedgeTile<typename L::Wide, J>(t, product, products, j, k, out);
  for (; k < t.stride; k += L::Rest::count) wedgeTile<typename L::Rest, J>(t, product, products, j, k, out);
}

template <class L>
FIELDDEFORM_SIMD_INLINE void wedgeKernel(const WedgeTask& t) {
  using Pack = typename L::Rest::Pack;
  for (std::size_t r = 0; r < t.count; ++r) {
    const WedgePlan::Product* product = t.product + t.start[r];
    const std::size_t products = t.start[r + 1] - t.start[r];
    for (std::size_t m = 0; m < products; ++m) {
      const double *a = t.rows + product[m].first * t.stride, *b = product[m].minus == kNoIndex ? t.zero : t.rows + product[m].minus * t.stride;
      for (std::size_t k = 0; k < t.stride; k += L::Rest::count) PACK_OUT(t.u + m * t.stride + k) = PACK(a + k) - PACK(b + k);
    }
    double* out = t.out + r * t.width;
    for (std::size_t j = 0; j + 1 < t.n;) {
      const std::size_t next = WedgeLayout::first(j) + kLanes - 1, group = (next < t.n - 1 ? next : t.n - 1) - j;
      switch (group) {
        case 1: wedgeGroup<L, 1>(t, product, products, j, out); break;
        case 2: wedgeGroup<L, 2>(t, product, products, j, out); break;
        case 3: wedgeGroup<L, 3>(t, product, products, j, out); break;
        default: wedgeGroup<L, 4>(t, product, products, j, out);
      }
      j += group;
    }
  }
}

struct OuterTask {
  const double* rows;
  const Index* owner;
  const double* products;
  std::size_t stride, width, count;
  double* sums;
};

/// Four rows of sums, `packs` packs of each.
template <class P, std::size_t packs>
FIELDDEFORM_SIMD_INLINE void outerTile(const OuterTask& t, std::size_t i, std::size_t p) {
  using Pack = typename P::Pack;
  constexpr std::size_t lanes = P::count;
  Pack sum[4][packs];
  for (std::size_t a = 0; a < 4; ++a)
    for (std::size_t b = 0; b < packs; ++b) sum[a][b] = PACK(t.sums + (i + a) * t.width + p + b * lanes);
  const double* product = t.products + p;
  for (std::size_t r = 0; r < t.count; ++r, product += t.width) {
    const double* row = t.rows + t.owner[r] * t.stride + i;
    for (std::size_t b = 0; b < packs; ++b) {
      const Pack w = PACK(product + b * lanes);
      for (std::size_t a = 0; a < 4; ++a) sum[a][b] += row[a] * w;
    }
  }
  for (std::size_t a = 0; a < 4; ++a)
    for (std::size_t b = 0; b < packs; ++b) PACK_OUT(t.sums + (i + a) * t.width + p + b * lanes) = sum[a][b];
}

template <class L>
FIELDDEFORM_SIMD_INLINE void outerKernel(const OuterTask& t) {
  std::size_t p = 0;
  for (; p + 2 * L::Wide::count <= t.width; p += 2 * L::Wide::count)
    for (std::size_t i = 0; i < t.stride; i += 4) outerTile<typename L::Wide, 2>(t, i, p);
  for (; p < t.width; p += L::Rest::count)
    for (std::size_t i = 0; i < t.stride; i += 4) outerTile<typename L::Rest, 1>(t, i, p);
}

void dotBaseline(const DotTask& t) { dotKernel<Baseline>(t); }
FIELDDEFORM_SIMD_AVX2 void dotAvx2(const DotTask& t) { dotKernel<Avx2>(t); }
void addBaseline(const AddTask& t) { addKernel<Baseline>(t); }
FIELDDEFORM_SIMD_AVX2 void addAvx2(const AddTask& t) { addKernel<Avx2>(t); }
FIELDDEFORM_LEVELS(runWedge, const WedgeTask, wedgeKernel)
FIELDDEFORM_LEVELS(runOuter, const OuterTask, outerKernel)

}  // namespace

void dot3Rows(const double* rows, std::size_t stride, std::size_t count, const double* columns, const Vec3* base, Vec3* out) {
  const DotTask task{rows, stride, count, columns, base, out};
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

void wedgeRows(const WedgeLayout& layout, const WedgePlan& plan, const double* rows, std::size_t begin, std::size_t end, double* out) {
  std::size_t most = 0;
  for (std::size_t o = begin; o < end; ++o) most = std::max(most, plan.start[o + 1] - plan.start[o]);
  std::vector<double> scratch((most + 1) * layout.stride, 0.0);
  runWedge({layout.offset.data(), layout.n, layout.stride, layout.width, plan.product.data(), plan.start.data() + begin,
                       rows, end - begin, scratch.data() + layout.stride, scratch.data(), out});
}

void addOuter(const WedgeLayout& layout, const double* rows, const Index* owner, const double* products, std::size_t count, double* sums) {
  runOuter({rows, owner, products, layout.stride, layout.width, count, sums});
}

}  // namespace fielddeform::volume::detail
