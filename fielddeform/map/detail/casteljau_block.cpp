#include <fielddeform/map/detail/casteljau_sweep.h>

namespace fielddeform::map::detail {
namespace {

using fielddeform::detail::SimdLevel;
using Block = std::array<double, 3 * kSweepBlock>;

using fielddeform::detail::Baseline, fielddeform::detail::Avx2, fielddeform::detail::Avx512;

/// Numbers side by side that never meet.
template <class L>
struct Lanes {
  using Pack = typename L::Pack;
  Pack v;

  Lanes() = default;
  FIELDDEFORM_SIMD_INLINE explicit Lanes(double x) : v(Pack{} + x) {}
  FIELDDEFORM_SIMD_INLINE friend Lanes operator+(const Lanes& a, const Lanes& b) { return make(a.v + b.v); }
  FIELDDEFORM_SIMD_INLINE friend Lanes operator-(const Lanes& a, const Lanes& b) { return make(a.v - b.v); }
  FIELDDEFORM_SIMD_INLINE friend Lanes operator*(const Lanes& a, const Lanes& b) { return make(a.v * b.v); }
  FIELDDEFORM_SIMD_INLINE friend Lanes operator*(const Lanes& a, double b) { return make(a.v * b); }
  FIELDDEFORM_SIMD_INLINE static Lanes make(Pack p) {
    Lanes out;
    out.v = p;
    return out;
  }
};

template <class L>
FIELDDEFORM_SIMD_INLINE void kernel(const Sweep& s, const Block& uvw, Block& out) {
  using Pack = typename L::Pack;
  constexpr std::size_t lanes = sizeof(Pack) / 8;
  Lanes<L> b[kMaxCasteljauDegree + 1];
  for (std::size_t p = 0; p < kSweepBlock; p += lanes) {
    Triple<Lanes<L>> u, x;
    for (std::size_t c = 0; c < 3; ++c) u[c].v = *reinterpret_cast<const Pack*>(&uvw[c * kSweepBlock + p]);
    sweep(s.degree, s.c.data(), s.s.data(), s.t.data(), u, b, x);
    for (std::size_t c = 0; c < 3; ++c) *reinterpret_cast<Pack*>(&out[c * kSweepBlock + p]) = x[c].v;
  }
}

void baseline(const Sweep& s, const Block& uvw, Block& out) { kernel<Baseline>(s, uvw, out); }
FIELDDEFORM_SIMD_AVX2 void avx2(const Sweep& s, const Block& uvw, Block& out) { kernel<Avx2>(s, uvw, out); }
FIELDDEFORM_SIMD_AVX512 void avx512(const Sweep& s, const Block& uvw, Block& out) { kernel<Avx512>(s, uvw, out); }

}  // namespace

void sweepBlock(const Sweep& s, const Block& uvw, Block& out) {
  switch (fielddeform::detail::simdLevel()) {
    case SimdLevel::Avx512: return avx512(s, uvw, out);
    case SimdLevel::Avx2: return avx2(s, uvw, out);
    default: return baseline(s, uvw, out);
  }
}

}  // namespace fielddeform::map::detail
