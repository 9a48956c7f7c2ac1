#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/core/random.h>
#include <gtest/gtest.h>

#include <atomic>

namespace fielddeform {
namespace {

TEST(Parallel, CoversEveryElementOnceInAlignedRanges) {
  std::vector<std::atomic<int>> seen(10007);
  parallelFor(seen.size(), 64, [&](std::size_t begin, std::size_t end) {
    EXPECT_EQ(begin % 64, 0u);
    EXPECT_LE(end - begin, 64u);
    for (std::size_t i = begin; i < end; ++i) ++seen[i];
  });
  for (const auto& s : seen) ASSERT_EQ(s.load(), 1);
}

TEST(Parallel, EmptyRangeCallsNothing) {
  parallelFor(0, 16, [](std::size_t, std::size_t) { FAIL(); });
}

TEST(Parallel, ReductionHasTheSameBitsOnAnyThreadCount) {
  const std::size_t n = 100003;
  const auto sum = [&](int threads) {
    ThreadLimit limit(threads);
    return deterministicReduce(
        n, 512, 0.0,
        [](std::size_t begin, std::size_t end) {
          double s = 0;
          for (std::size_t i = begin; i < end; ++i) s += uniform01(7, i) * 1e10 - 5e9;
          return s;
        },
        [](double a, double b) { return a + b; });
  };
  const double one = sum(1);
  for (int threads : {2, 3, 7}) EXPECT_EQ(one, sum(threads)) << threads;
}

TEST(Parallel, CancelledProgressStopsTheLoop) {
  Progress progress;
  std::atomic<int> calls{0};
  EXPECT_THROW(parallelFor(100000, 1, progress,
                           [&](std::size_t, std::size_t) {
                             if (++calls == 10) progress.cancel();
                           }),
               Cancelled);
  EXPECT_LT(calls.load(), 1000);
}

TEST(Parallel, BodyExceptionsReachTheCaller) {
  EXPECT_THROW(parallelFor(1000, 1, [](std::size_t b, std::size_t) { if (b == 500) throw std::runtime_error("x"); }),
               std::runtime_error);
}

TEST(Parallel, SortedOrderIsStable) {
  const std::vector<std::uint64_t> keys{3, 1, 3, 0, 1};
  EXPECT_EQ(sortedOrder(keys), (std::vector<std::uint32_t>{3, 1, 4, 0, 2}));
}

}  // namespace
}  // namespace fielddeform
