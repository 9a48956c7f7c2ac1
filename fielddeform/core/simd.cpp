#include <fielddeform/core/detail/simd.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>

namespace fielddeform::detail {
namespace {

std::atomic<SimdLevel> limit{SimdLevel::Avx512};

SimdLevel detect() noexcept {
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq"))
    return SimdLevel::Avx512;
  if (__builtin_cpu_supports("avx2")) return SimdLevel::Avx2;
#endif
  return SimdLevel::Baseline;
}

SimdLevel fromEnvironment() noexcept {
  const char* word = std::getenv("FIELDDEFORM_SIMD");
  if (word)
    for (const SimdLevel level : {SimdLevel::Baseline, SimdLevel::Avx2})
      if (toString(level) == word) return level;
  return SimdLevel::Avx512;
}

}  // namespace

std::string_view toString(SimdLevel level) noexcept {
  switch (level) {
    case SimdLevel::Avx2: return "avx2";
    case SimdLevel::Avx512: return "avx512";
    case SimdLevel::Baseline: break;
  }
  return "baseline";
}

SimdLevel supportedSimdLevel() noexcept {
  static const SimdLevel level = detect();
  return level;
}

SimdLevel simdLevel() noexcept {
  static const SimdLevel best = std::min(supportedSimdLevel(), fromEnvironment());
  return std::min(best, limit.load(std::memory_order_relaxed));
}

SimdLimit::SimdLimit(SimdLevel level) noexcept : before_(limit.exchange(level, std::memory_order_relaxed)) {}
SimdLimit::~SimdLimit() { limit.store(before_, std::memory_order_relaxed); }

}  // namespace fielddeform::detail
