#include <fielddeform/core/detail/simd.h>
#include <gtest/gtest.h>

#include <algorithm>

namespace fielddeform::detail {
namespace {

TEST(Simd, ALimitHoldsWhileItLives) {
  const SimdLevel before = simdLevel();
  EXPECT_LE(before, supportedSimdLevel());
  for (const SimdLevel level : {SimdLevel::Baseline, SimdLevel::Avx2, SimdLevel::Avx512}) {
    const SimdLimit limit(level);
    EXPECT_EQ(simdLevel(), std::min(level, before));
  }
  EXPECT_EQ(simdLevel(), before);
  EXPECT_EQ(toString(SimdLevel::Avx512), "avx512");
}

}  // namespace
}  // namespace fielddeform::detail
