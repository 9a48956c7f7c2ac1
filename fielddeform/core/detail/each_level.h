// Includes FIELDDEFORM_LEVEL_SOURCE once a level within a namespace of its own: baseline, avx2, avx512. GCC takes vectors and
// comparisons of them that a level lacks apart, lane by lane, before it inlines; so every function of such a source must be of the
// level itself: LANES_TARGET stands before each, LANES_INLINE before those that are always inlined. The source finds
//   Pack   the level's widest vector of doubles, Mask what a comparison of two gives, anyOf(Mask) whether some lane holds
//   load(from, pack), store(pack, to)   at any address
// To be included within an unnamed namespace of its user, after core/detail/simd.h; once a source.
#ifndef FIELDDEFORM_LEVEL_SOURCE
#error "FIELDDEFORM_LEVEL_SOURCE is the header to include"
#endif

#define LANES_INLINE LANES_TARGET inline __attribute__((always_inline))
#define LANES_MEMORY                                                                                       \
  LANES_INLINE void load(const double* numbers, Pack& out) { __builtin_memcpy(&out, numbers, sizeof(Pack)); } \
  LANES_INLINE void store(const Pack& x, double* numbers) { __builtin_memcpy(numbers, &x, sizeof(Pack)); }

namespace baseline {
#define LANES_TARGET
typedef double Pack __attribute__((vector_size(16)));
using Mask = decltype(Pack{} < Pack{});
LANES_INLINE bool anyOf(const Mask& mask) { return (mask[0] | mask[1]) != 0; }
LANES_MEMORY
#include FIELDDEFORM_LEVEL_SOURCE
#undef LANES_TARGET
}  // namespace baseline

#if defined(__x86_64__)
namespace avx2 {
#define LANES_TARGET FIELDDEFORM_SIMD_AVX2
typedef double Pack __attribute__((vector_size(32)));
using Mask = decltype(Pack{} < Pack{});
LANES_INLINE bool anyOf(const Mask& mask) { return _mm256_movemask_pd(reinterpret_cast<const __m256d&>(mask)) != 0; }
LANES_MEMORY
#include FIELDDEFORM_LEVEL_SOURCE
#undef LANES_TARGET
}  // namespace avx2

namespace avx512 {
#define LANES_TARGET FIELDDEFORM_SIMD_AVX512
typedef double Pack __attribute__((vector_size(64)));
using Mask = decltype(Pack{} < Pack{});
LANES_INLINE bool anyOf(const Mask& mask) { return _mm512_movepi64_mask(reinterpret_cast<const __m512i&>(mask)) != 0; }
LANES_MEMORY
#include FIELDDEFORM_LEVEL_SOURCE
#undef LANES_TARGET
}  // namespace avx512
#else
namespace avx2 = baseline;
namespace avx512 = baseline;
#endif

#undef LANES_MEMORY
#undef LANES_INLINE
