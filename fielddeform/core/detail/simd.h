#pragma once

#include <cstdint>
#include <string_view>

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

/// Defines void name(Task& task): kernel<one of three classes of vectors>(task) at the level of this processor.
#define FIELDDEFORM_LEVELS_OF(name, Task, kernel, OfBaseline, OfAvx2, OfAvx512)             \
  void name##Baseline(Task& task) { kernel<OfBaseline>(task); }                             \
  FIELDDEFORM_SIMD_AVX2 void name##Avx2(Task& task) { kernel<OfAvx2>(task); }               \
  FIELDDEFORM_SIMD_AVX512 void name##Avx512(Task& task) { kernel<OfAvx512>(task); }         \
  void name(Task& task) {                                                                   \
    switch (::fielddeform::detail::simdLevel()) {                                           \
      case ::fielddeform::detail::SimdLevel::Avx512: return name##Avx512(task);             \
      case ::fielddeform::detail::SimdLevel::Avx2: return name##Avx2(task);                 \
      case ::fielddeform::detail::SimdLevel::Baseline: return name##Baseline(task);         \
    }                                                                                       \
  }
/// The same with what Baseline, Avx2 and Avx512 mean where it stands: the vectors above, or classes with more.
#define FIELDDEFORM_LEVELS(name, Task, kernel) FIELDDEFORM_LEVELS_OF(name, Task, kernel, Baseline, Avx2, Avx512)
