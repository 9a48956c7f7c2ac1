#pragma once

#include <cstdint>
#include <string_view>
#if defined(__x86_64__)
#include <immintrin.h>
#endif

/// Run-time choice of vector instructions. A kernel is one always-inlined function over lanes that never meet (each lane
/// adds in the same order at any width, and nothing is fused: -ffp-contract=off), wrapped once a level:
///
///   template <class Level> FIELDDEFORM_SIMD_INLINE void kernel(const Task& task);
///   FIELDDEFORM_LEVELS(run, const Task, kernel)  // within an unnamed namespace: void run(const Task&)
///
/// so that every processor writes the same bytes. Such kernels call no function that is not always inlined.
#define FIELDDEFORM_SIMD_INLINE inline __attribute__((always_inline))
#if defined(__x86_64__)
#define FIELDDEFORM_SIMD_AVX2 __attribute__((target("avx2")))
#define FIELDDEFORM_SIMD_AVX512 __attribute__((target("avx512f,avx512vl,avx512dq")))
#else
#define FIELDDEFORM_SIMD_AVX2
#define FIELDDEFORM_SIMD_AVX512
#endif

namespace fielddeform::detail {

// Two, four and eight numbers at any address. A template argument loses their attributes: pass them by way of a class.
typedef double Two __attribute__((vector_size(16), aligned(8), may_alias));
typedef double Four __attribute__((vector_size(32), aligned(8), may_alias));
typedef double Eight __attribute__((vector_size(64), aligned(8), may_alias));

// The widest vector of each level, as a template's argument.
struct Baseline {
  using Pack = Two;
};
struct Avx2 {
  using Pack = Four;
};
struct Avx512 {
  using Pack = Eight;
};

enum class SimdLevel : std::uint8_t { Baseline, Avx2, Avx512 };  ///< Baseline: SSE2 on x86-64, what the compiler has elsewhere

std::string_view toString(SimdLevel level) noexcept;  ///< "baseline", "avx2", "avx512"

/// The best level of this processor.
SimdLevel supportedSimdLevel() noexcept;

/// The level that kernels use: the best one, no better than the environment variable FIELDDEFORM_SIMD says (read once) and
/// than a SimdLimit.
SimdLevel simdLevel() noexcept;

/// While it lives, kernels use at most this level: for tests and benchmarks. Process-wide.
class SimdLimit {
 public:
  explicit SimdLimit(SimdLevel level) noexcept;
  ~SimdLimit();
  SimdLimit(const SimdLimit&) = delete;
  SimdLimit& operator=(const SimdLimit&) = delete;

 private:
  SimdLevel before_;
};

}  // namespace fielddeform::detail

/// Defines void name(Task& task): kernel<Level>(task), Level the class Baseline, Avx2 or Avx512 that is known where it stands.
#define FIELDDEFORM_LEVELS(name, Task, kernel)                                              \
  void name##Baseline(Task& task) { kernel<Baseline>(task); }                               \
  FIELDDEFORM_SIMD_AVX2 void name##Avx2(Task& task) { kernel<Avx2>(task); }                 \
  FIELDDEFORM_SIMD_AVX512 void name##Avx512(Task& task) { kernel<Avx512>(task); }           \
  void name(Task& task) {                                                                   \
    switch (::fielddeform::detail::simdLevel()) {                                           \
      case ::fielddeform::detail::SimdLevel::Avx512: return name##Avx512(task);             \
      case ::fielddeform::detail::SimdLevel::Avx2: return name##Avx2(task);                 \
      case ::fielddeform::detail::SimdLevel::Baseline: break;                               \
    }                                                                                       \
    name##Baseline(task);                                                                   \
  }

/// Defines name(Task& task): kernel(task) of the namespace avx512, avx2 or baseline (core/detail/each_level.h), for kernels that
/// compare vectors.
#define FIELDDEFORM_BY_LEVEL(name, Task, kernel)                                            \
  auto name(Task& task) -> decltype(baseline::kernel(task)) {                               \
    switch (::fielddeform::detail::simdLevel()) {                                           \
      case ::fielddeform::detail::SimdLevel::Avx512: return avx512::kernel(task);           \
      case ::fielddeform::detail::SimdLevel::Avx2: return avx2::kernel(task);               \
      case ::fielddeform::detail::SimdLevel::Baseline: break;                               \
    }                                                                                       \
    return baseline::kernel(task);                                                          \
  }
