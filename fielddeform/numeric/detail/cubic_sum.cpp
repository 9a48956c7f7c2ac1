// Eight lanes that never meet before the end, on vectors as wide as the processor has: the same bits on all. Root, sums and
// products are rounded as IEEE says everywhere.
#include <fielddeform/core/detail/simd.h>
#include <fielddeform/numeric/detail/cubic_sum.h>

#include <cmath>
#include <cstring>

namespace fielddeform::numeric::detail {
namespace {

using fielddeform::detail::SimdLevel;
using fielddeform::detail::simdLevel;

using fielddeform::detail::Baseline, fielddeform::detail::Avx2, fielddeform::detail::Avx512;
using fielddeform::detail::Eight;

struct Task {
  const double* blocks;
  std::size_t count;
  Vec3 p;
};

FIELDDEFORM_SIMD_INLINE double total(const double* v) {
  return ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]));
}

// Adds up, over all centres, `Sums` numbers that `add(sums, x, y, z, r2, r, weights)` adds to; x, y, z from the centre.
template <class L, std::size_t Sums, class Add>
FIELDDEFORM_SIMD_INLINE void sumAll(const Task& task, double* out, const Add& add) {
  using Pack = typename L::Pack;
  constexpr std::size_t lanes = sizeof(Pack) / 8, packs = kCubicLanes / lanes;
  Pack sums[packs][Sums] = {};
  const double px = task.p[0], py = task.p[1], pz = task.p[2];
  const double* b = task.blocks;
  for (std::size_t n = task.count; n-- > 0; b += kCubicBlock)
    for (std::size_t k = 0; k < packs; ++k) {
      const double* at = b + k * lanes;
      const Pack x = px - *reinterpret_cast<const Pack*>(at);
      const Pack y = py - *reinterpret_cast<const Pack*>(at + kCubicLanes);
      const Pack z = pz - *reinterpret_cast<const Pack*>(at + 2 * kCubicLanes);
      const Pack r2 = x * x + y * y + z * z;
      Pack r;
      for (std::size_t l = 0; l < lanes; ++l) r[l] = std::sqrt(r2[l]);
      add(sums[k], x, y, z, r2, r, at + 3 * kCubicLanes);
    }
  for (std::size_t s = 0; s < Sums; ++s) {
    double lane[kCubicLanes];
    for (std::size_t k = 0; k < packs; ++k) std::memcpy(lane + k * lanes, &sums[k][s], sizeof(Pack));
    out[s] = total(lane);
  }
}

template <class L>
FIELDDEFORM_SIMD_INLINE void threeKernel(const Task& task, double* out) {
  using Pack = typename L::Pack;
  sumAll<L, 3>(task, out, [](Pack* sums, const Pack&, const Pack&, const Pack&, const Pack& r2, const Pack& r, const double* w)
                              __attribute__((always_inline)) {
    const Pack r3 = r2 * r;
    for (std::size_t c = 0; c < 3; ++c) sums[c] += *reinterpret_cast<const Pack*>(w + c * kCubicLanes) * r3;
  });
}

template <class L>
FIELDDEFORM_SIMD_INLINE void gradientKernel(const Task& task, double* out) {
  using Pack = typename L::Pack;
  sumAll<L, 4>(task, out, [](Pack* sums, const Pack& x, const Pack& y, const Pack& z, const Pack& r2, const Pack& r, const double* w)
                              __attribute__((always_inline)) {
    const Pack s = *reinterpret_cast<const Pack*>(w) * r;
    sums[0] += s * r2;
    sums[1] += s * x;
    sums[2] += s * y;
    sums[3] += s * z;
  });
}

void threeBaseline(const Task& task, double* out) { threeKernel<Baseline>(task, out); }
FIELDDEFORM_SIMD_AVX2 void threeAvx2(const Task& task, double* out) { threeKernel<Avx2>(task, out); }
FIELDDEFORM_SIMD_AVX512 void threeAvx512(const Task& task, double* out) { threeKernel<Avx512>(task, out); }
void gradientBaseline(const Task& task, double* out) { gradientKernel<Baseline>(task, out); }
FIELDDEFORM_SIMD_AVX2 void gradientAvx2(const Task& task, double* out) { gradientKernel<Avx2>(task, out); }
FIELDDEFORM_SIMD_AVX512 void gradientAvx512(const Task& task, double* out) { gradientKernel<Avx512>(task, out); }

}  // namespace

Vec3 cubicSums(const double* blocks, std::size_t count, const Vec3& p) {
  const Task task{blocks, count, p};
  double out[3];
  switch (simdLevel()) {
    case SimdLevel::Avx512: threeAvx512(task, out); break;
    case SimdLevel::Avx2: threeAvx2(task, out); break;
    case SimdLevel::Baseline: threeBaseline(task, out); break;
  }
  return {out[0], out[1], out[2]};
}

double cubicSum(const double* blocks, std::size_t count, const Vec3& p, Vec3& gradient) {
  const Task task{blocks, count, p};
  double out[4];
  switch (simdLevel()) {
    case SimdLevel::Avx512: gradientAvx512(task, out); break;
    case SimdLevel::Avx2: gradientAvx2(task, out); break;
    case SimdLevel::Baseline: gradientBaseline(task, out); break;
  }
  gradient = 3 * Vec3(out[1], out[2], out[3]);
  return out[0];
}

}  // namespace fielddeform::numeric::detail
