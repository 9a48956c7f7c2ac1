// The float look never clears a triangle that the guard's bounds forbid, and clears nearly all that are far within.
#include <fielddeform/core/detail/simd.h>
#include <fielddeform/core/random.h>
#include <fielddeform/core/types.h>
#include <fielddeform/gffd/detail/guard_kernel.h>
#include <fielddeform/gffd/guard.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <vector>

namespace fielddeform::gffd::tests {
namespace {

using detail::kGuardBlock;
using Triangle = std::array<Vec3, 3>;

Vec3 randomPoint(std::uint64_t seed, std::uint64_t i) {
  return 2 * Vec3(uniform01(seed, 3 * i), uniform01(seed, 3 * i + 1), uniform01(seed, 3 * i + 2)) - Vec3::Ones();
}

// Over the bounds in doubles, whose rounding is nothing beside what is tested.
bool isBad(const Triangle& q, const Triangle& x, const GuardOptions& o) {
  const Vec3 n = (q[1] - q[0]).cross(q[2] - q[0]), m = (x[1] - x[0]).cross(x[2] - x[0]);
  bool bad = n.dot(m) < o.minCosine * n.norm() * m.norm();
  for (std::size_t k = 0; k < 3; ++k) bad = bad || (x[(k + 1) % 3] - x[k]).norm() > o.maxStretch * (q[(k + 1) % 3] - q[k]).norm();
  return bad;
}

struct Pair {
  Triangle q, x;
};

// Triangles of all shapes and sizes, down to slivers, and corrections from none to large.
Pair randomPair(std::uint64_t i) {
  Pair p;
  const double size = std::pow(10.0, static_cast<double>(splitmix64(1, i) % 13) - 6), thin = std::pow(10.0, -static_cast<double>(splitmix64(2, i) % 9));
  const Vec3 a = randomPoint(3, i), along = randomPoint(4, i), aside = randomPoint(5, i);
  p.q = {a, a + size * along, a + size * (uniform01(6, i) * along + thin * aside)};
  const double move = std::pow(10.0, -static_cast<double>(splitmix64(7, i) % 5));
  for (std::size_t k = 0; k < 3; ++k) p.x[k] = p.q[k] + size * move * randomPoint(8 + k, i);
  return p;
}

std::vector<std::int32_t> suspects(const std::vector<Pair>& pairs, const GuardOptions& o, double unit) {
  detail::GuardEdges e{};
  for (std::size_t i = 0; i < kGuardBlock; ++i)
    for (int k = 0; k < 3; ++k) {
      const Pair& p = pairs[i];
      e.q1[k][i] = static_cast<float>((p.q[1] - p.q[0])[k] * unit);
      e.q2[k][i] = static_cast<float>((p.q[2] - p.q[0])[k] * unit);
      e.x1[k][i] = static_cast<float>((p.x[1] - p.x[0])[k] * unit);
      e.x2[k][i] = static_cast<float>((p.x[2] - p.x[0])[k] * unit);
    }
  const double cosine = o.minCosine + 0.01;
  std::vector<std::int32_t> found(kGuardBlock);
  detail::findSuspects(e, {static_cast<float>(cosine * cosine), static_cast<float>(o.maxStretch * o.maxStretch * (1 - 2e-3))}, found.data());
  return found;
}

TEST(GuardKernel, NeverClearsATriangleOverTheBounds) {
  const GuardOptions options;
  std::size_t bad = 0, good = 0, cleared = 0;
  for (std::uint64_t block = 0; block < 1500; ++block) {
    std::vector<Pair> pairs;
    for (std::uint64_t i = 0; i < kGuardBlock; ++i) pairs.push_back(randomPair(block * kGuardBlock + i));
    const auto found = suspects(pairs, options, 1);
    for (std::size_t i = 0; i < kGuardBlock; ++i) {
      const bool over = isBad(pairs[i].q, pairs[i].x, options);
      bad += over;
      good += !over;
      cleared += found[i] == 0;
      ASSERT_FALSE(over && found[i] == 0) << block << ' ' << i;
    }
  }
  EXPECT_GT(bad, 10000u);
  EXPECT_GT(good, 10000u);
  EXPECT_GT(cleared, good / 4);  // many here are slivers or tiny
}

TEST(GuardKernel, SuspectsWhatIsNoNumberAndWhatLeavesTheRange) {
  std::vector<Pair> pairs(kGuardBlock, Pair{{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)}, {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)}});
  pairs[1].x[2][1] = std::numeric_limits<double>::quiet_NaN();
  pairs[2].x[1][0] = std::numeric_limits<double>::infinity();
  for (auto* t : {&pairs[3].q, &pairs[3].x})
    for (Vec3& p : *t) p *= 1e-30;
  for (auto* t : {&pairs[4].q, &pairs[4].x})
    for (Vec3& p : *t) p *= 1e30;
  pairs[5].x[1] = pairs[5].x[0];
  const auto found = suspects(pairs, {}, 1);
  EXPECT_EQ(found[0], 0);
  for (std::size_t i = 1; i <= 5; ++i) EXPECT_EQ(found[i], 1) << i;
  EXPECT_EQ(found[6], 0);
}

TEST(GuardKernel, EveryInstructionSetSuspectsTheSame) {
  using fielddeform::detail::SimdLevel;
  std::vector<Pair> pairs;
  for (std::uint64_t i = 0; i < kGuardBlock; ++i) pairs.push_back(randomPair(i));
  const auto first = suspects(pairs, {}, 1);
  for (const SimdLevel level : {SimdLevel::Baseline, SimdLevel::Avx2, SimdLevel::Avx512}) {
    if (level > fielddeform::detail::supportedSimdLevel()) continue;
    const fielddeform::detail::SimdLimit limit(level);
    EXPECT_EQ(suspects(pairs, {}, 1), first) << toString(level);
  }
}

}  // namespace
}  // namespace fielddeform::gffd::tests
