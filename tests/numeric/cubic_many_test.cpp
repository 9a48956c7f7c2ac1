// Sums of w |p - c|^3 at many points together, against the plain sums.
#include <fielddeform/core/detail/simd.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/core/random.h>
#include <fielddeform/numeric/detail/cubic_many.h>
#include <fielddeform/numeric/detail/cubic_sum.h>
#include <fielddeform/numeric/detail/cubic_taylor.h>
#include <fielddeform/numeric/rbf.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

namespace fielddeform::numeric {
namespace {

using fielddeform::detail::SimdLevel, fielddeform::detail::SimdLimit;

Vec3 randomPoint(std::uint64_t seed, std::uint64_t i) {
  return {2 * uniform01(seed, 3 * i) - 1, 2 * uniform01(seed, 3 * i + 1) - 1, 2 * uniform01(seed, 3 * i + 2) - 1};
}

std::vector<Vec3> cloud(std::uint64_t seed, std::size_t n, double size = 1, const Vec3& middle = Vec3::Zero()) {
  std::vector<Vec3> p(n);
  for (std::size_t i = 0; i < n; ++i) p[i] = middle + size * randomPoint(seed, i);
  return p;
}

// Blocks of cubic_sum.h; unused places repeat the last centre with weights 0.
std::vector<double> blocksOf(const std::vector<Vec3>& centres, const std::vector<Vec3>& weights) {
  const std::size_t n = centres.size(), lanes = detail::kCubicLanes, count = (n + lanes - 1) / lanes;
  std::vector<double> blocks(count * detail::kCubicBlock, 0.0);
  for (std::size_t i = 0; i < count * lanes; ++i)
    for (int k = 0; k < 3; ++k) {
      double* block = blocks.data() + i / lanes * detail::kCubicBlock + i % lanes;
      block[static_cast<std::size_t>(k) * lanes] = centres[std::min(i, n - 1)][k];
      if (i < n) block[static_cast<std::size_t>(3 + k) * lanes] = weights[i][k];
    }
  return blocks;
}

// Value and gradient of a polynomial at a point, by way of the kernel.
std::array<double, 4> polynomialAt(const std::vector<double>& terms, const Vec3& origin, const Vec3& p) {
  const std::size_t n = detail::kCubicTogether;
  std::vector<double> x(n, p.x()), y(n, p.y()), z(n, p.z()), out(4 * n);
  detail::cubicFirstTogether({terms.data(), origin, nullptr, 0}, {x.data(), y.data(), z.data(), n}, out.data());
  return {out[0], out[n], out[2 * n], out[3 * n]};
}

std::vector<double> taylorOf(const std::vector<Vec3>& centres, const std::vector<Vec3>& weights, const Vec3& origin) {
  std::vector<double> terms(detail::kTaylorTerms, 0.0);
  const auto blocks = blocksOf(centres, weights);
  detail::addTaylor(blocks.data(), blocks.size() / detail::kCubicBlock, origin, 1, terms.data());
  return terms;
}

TEST(CubicTaylor, IsWithinItsBoundAndTheBoundIsNotIdle) {
  const Vec3 origin(0.3, -0.2, 0.1);
  for (const double ratio : {0.5, 0.35, 0.2}) {
    double value = 0, gradient = 0;  // greatest errors, of the bounds
    for (std::uint64_t i = 0; i < 300; ++i) {
      const double distance = 0.1 + 2 * uniform01(5, i), radius = ratio * distance;
      const Vec3 centre = origin + distance * randomPoint(1, i).normalized();
      const auto terms = taylorOf({centre}, {Vec3(1, 0, 0)}, origin);
      const detail::TaylorBound bound = detail::taylorBound(radius, distance);
      for (std::uint64_t j = 0; j < 10; ++j) {
        const Vec3 p = origin + radius * randomPoint(2, 10 * i + j).normalized(), d = p - centre;
        const auto v = polynomialAt(terms, origin, p);
        const double r = d.norm();
        value = std::max(value, std::abs(v[0] - r * r * r) / bound.value);
        gradient = std::max(gradient, (Vec3(v[1], v[2], v[3]) - 3 * r * d).norm() / bound.gradient);
      }
    }
    EXPECT_LE(value, 1) << ratio;
    EXPECT_LE(gradient, 1) << ratio;
    // Measured: 0.04 to 0.3. Where the bound were a hundred times too large, centres would be taken for near without need.
    EXPECT_GT(value, 0.01) << ratio;
    EXPECT_GT(gradient, 0.01) << ratio;
  }
}

TEST(CubicTaylor, NearCentresHaveNoBound) {
  EXPECT_EQ(detail::taylorBound(1, 1.9).value, std::numeric_limits<double>::infinity());
  EXPECT_EQ(detail::taylorBound(0, 0).gradient, std::numeric_limits<double>::infinity());
  EXPECT_EQ(detail::taylorBound(0, 1).value, 0);
}

TEST(CubicTaylor, MovedItIsTheSamePolynomial) {
  const auto centres = cloud(3, 20, 0.5, Vec3(3, 1, -2)), weights = cloud(4, 20);
  const Vec3 origin(0.1, 0.2, -0.1), by(-0.3, 0.25, 0.4);
  const auto terms = taylorOf(centres, weights, origin);
  auto moved = terms;
  detail::moveTaylor(by, moved.data());
  for (std::uint64_t i = 0; i < 50; ++i) {
    const Vec3 p = origin + randomPoint(5, i);
    const auto a = polynomialAt(terms, origin, p), b = polynomialAt(moved, origin + by, p);
    for (std::size_t k = 0; k < 4; ++k) EXPECT_NEAR(a[k], b[k], 1e-11);  // sums of terms of up to 1e3
  }
}

struct Result {
  std::vector<double> value;
  std::vector<Vec3> gradient;
  std::vector<int> times;
  bool operator==(const Result&) const = default;
};

Result together(const std::vector<Vec3>& centres, const std::vector<Vec3>& weights, const std::vector<Vec3>& points, double tolerance) {
  Result r{std::vector<double>(points.size()), std::vector<Vec3>(points.size(), Vec3::Zero()), std::vector<int>(points.size())};
  detail::cubicMany({centres, weights, 1}, points, {tolerance, 10 * tolerance}, [&](std::size_t i, const double* s) {
    r.value[i] = s[0];
    r.gradient[i] = Vec3(s[1], s[2], s[3]);
    ++r.times[i];
  });
  return r;
}

struct Difference {
  double value = 0, gradient = 0;
};

Difference fromPlain(const std::vector<Vec3>& centres, const std::vector<Vec3>& weights, const std::vector<Vec3>& points, const Result& r) {
  const auto blocks = blocksOf(centres, weights);
  Difference d;
  for (std::size_t i = 0; i < points.size(); i += 7) {
    Vec3 gradient;
    const double value = detail::cubicSum(blocks.data(), blocks.size() / detail::kCubicBlock, points[i], gradient);
    d.value = std::max(d.value, std::abs(value - r.value[i]));
    d.gradient = std::max(d.gradient, (gradient - r.gradient[i]).norm());
  }
  return d;
}

// A cluster, a plane, a line, one place, points around and far away: every way in which groups come about.
std::vector<std::vector<Vec3>> batches() {
  std::vector<std::vector<Vec3>> all{cloud(10, 6000, 0.1, Vec3(0.3, 0.1, 0)), cloud(11, 6000, 1.2), cloud(12, 6000, 0.3), cloud(13, 3000, 0.5),
                                     std::vector<Vec3>(2000, Vec3(0.1, 0.2, 0.3)), cloud(14, 3000, 40, Vec3(100, 0, 0))};
  for (Vec3& p : all[2]) p.z() = 0.25;
  for (Vec3& p : all[3]) p.y() = p.x(), p.z() = -p.x();
  return all;
}

TEST(CubicMany, StaysWithinTheToleranceOfThePlainSums) {
  const auto centres = cloud(20, 400), weights = cloud(21, 400);
  for (const auto& points : batches())
    for (const double tolerance : {1e-2, 1e-5, 1e-9}) {
      const Result r = together(centres, weights, points, tolerance);
      const Difference d = fromPlain(centres, weights, points, r);
      const double size = points[0].norm() > 10 ? 1e9 : 1e3;  // of the sums, whose rounding is added
      EXPECT_LE(d.value, tolerance + 1e-14 * size);
      EXPECT_LE(d.gradient, 10 * tolerance + 1e-14 * size);
      EXPECT_EQ(std::count(r.times.begin(), r.times.end(), 1), static_cast<std::ptrdiff_t>(points.size()));
    }
}

TEST(CubicMany, ALooseToleranceIsMadeUseOf) {
  const auto centres = cloud(20, 400), weights = cloud(21, 400), points = batches()[0];
  EXPECT_GT(fromPlain(centres, weights, points, together(centres, weights, points, 1e-2)).value, 1e-9);
  EXPECT_GT(fromPlain(centres, weights, points, together(centres, weights, points, 1e-6)).value, 1e-12);
  EXPECT_LT(fromPlain(centres, weights, points, together(centres, weights, points, 0)).value, 1e-12);
}

TEST(CubicMany, ThreeComponentsAreTheSumsOfEach) {
  const auto centres = cloud(22, 300), weights = cloud(23, 300), points = batches()[0];
  const auto blocks = blocksOf(centres, weights);
  std::vector<Vec3> found(points.size());
  detail::cubicMany({centres, weights, 3}, points, {1e-6, 0}, [&](std::size_t i, const double* s) { found[i] = Vec3(s[0], s[1], s[2]); });
  double worst = 0;
  for (std::size_t i = 0; i < points.size(); i += 5)
    worst = std::max(worst, (found[i] - detail::cubicSums(blocks.data(), blocks.size() / detail::kCubicBlock, points[i])).cwiseAbs().maxCoeff());
  EXPECT_LE(worst, 1e-6);
  EXPECT_GT(worst, 1e-13);
}

TEST(CubicMany, SameBitsOnAnyProcessorAndThreadCount) {
  const auto centres = cloud(24, 333), weights = cloud(25, 333);
  auto points = cloud(26, 9000, 0.15);
  for (std::size_t i = 0; i < points.size(); i += 2) points[i] *= 8;
  std::vector<Vec3> three;
  Result expected;
  for (const SimdLevel level : {SimdLevel::Baseline, SimdLevel::Avx2, SimdLevel::Avx512})
    for (const int threads : {1, 3}) {
      const SimdLimit simd(level);
      const ThreadLimit limit(threads);
      const Result r = together(centres, weights, points, 1e-5);
      std::vector<Vec3> sums(points.size());
      detail::cubicMany({centres, weights, 3}, points, {1e-5, 0}, [&](std::size_t i, const double* s) { sums[i] = Vec3(s[0], s[1], s[2]); });
      if (expected.value.empty()) expected = r, three = sums;
      EXPECT_TRUE(r == expected) << toString(level) << threads;
      EXPECT_TRUE(sums == three) << toString(level) << threads;
    }
}

TEST(CubicMany, LeavesOutWhatIsNotFiniteOrAbsurdlyFar) {
  const auto centres = cloud(27, 20), weights = cloud(28, 20);
  std::vector<Vec3> points = cloud(29, 2000);
  points[3].x() = std::nan("");
  points[7].y() = std::numeric_limits<double>::infinity();
  points[1999].z() = -1e200;
  const Result r = together(centres, weights, points, 1e-6);
  for (std::size_t i = 0; i < points.size(); ++i) EXPECT_EQ(r.times[i], i == 3 || i == 7 || i == 1999 ? 0 : 1);
  for (const double v : r.value) EXPECT_TRUE(std::isfinite(v));
  EXPECT_EQ(together(centres, weights, {points[3], points[7]}, 1).times, (std::vector<int>{0, 0}));
  EXPECT_TRUE(together(centres, weights, {}, 1).times.empty());
}

// Points on the centres, and closer than anything else.
TEST(CubicMany, PointsOnTheCentresAreNoTrouble) {
  const auto centres = cloud(30, 300), weights = cloud(31, 300);
  std::vector<Vec3> points;
  for (int k = 0; k < 8; ++k)
    for (const Vec3& c : centres) points.push_back(c + (k % 2) * 1e-12 * randomPoint(32, points.size()));
  for (int k = 0; k < 1500; ++k) points.push_back(centres[5] + Vec3(1e-9 * k, 0, 0));
  const Difference d = fromPlain(centres, weights, points, together(centres, weights, points, 1e-6));
  EXPECT_LE(d.value, 1e-6);
  EXPECT_LE(d.gradient, 1e-5);
}

Vec3 smooth(const Vec3& p) { return {std::sin(2 * p.x()) + p.y(), p.x() * p.y(), std::exp(p.z())}; }

class RbfTogether : public testing::Test {
 protected:
  static constexpr std::size_t kPoints = 150000;
  std::vector<Vec3> centres = cloud(40, 260), values, points = cloud(41, kPoints, 0.5);
  RbfTogether() {
    for (const Vec3& c : centres) values.push_back(smooth(c));
  }
};

TEST_F(RbfTogether, DiffersFromOneByOneByTheToleranceAtMost) {
  points[17] = Vec3(1e9, 0, 0);  // taken one by one
  points[18] = Vec3(0, std::nan(""), 0);
  for (const double tolerance : {1e-4, 1e-8}) {
    const Rbf rbf(centres, values, {.tolerance = tolerance});
    ASSERT_TRUE(rbf.togetherIsQuicker(kPoints));
    std::vector<Vec3> three(kPoints), gradients(kPoints);
    std::vector<double> first(kPoints);
    rbf.evaluate(points, three);
    rbf.first(points, first, gradients);
    double value = 0, gradient = 0, all = 0, largest = 0;
    for (const Vec3& v : values) largest = std::max(largest, v.cwiseAbs().maxCoeff());
    for (std::size_t i = 0; i < kPoints; i += i < 100 ? 1 : 53) {
      Vec3 g;
      const double v = rbf.first(points[i], g);
      if (i == 18) {
        EXPECT_TRUE(std::isnan(first[i]) && std::isnan(three[i].x()));
        continue;
      }
      value = std::max(value, std::abs(first[i] - v));
      gradient = std::max(gradient, (gradients[i] - g).norm());
      all = std::max(all, (three[i] - rbf.evaluate(points[i])).cwiseAbs().maxCoeff());
    }
    EXPECT_LE(value, tolerance * largest);
    EXPECT_LE(all, tolerance * largest);
    EXPECT_LE(gradient, 20 * tolerance * largest);  // half the extent is 1
    EXPECT_GT(value, 1e-7 * tolerance * largest);
    EXPECT_EQ(three[17], rbf.evaluate(points[17]));
  }
}

TEST_F(RbfTogether, WithoutToleranceEveryBitIsThatOfOneByOne) {
  const Rbf rbf(centres, values, {.tolerance = 0});
  EXPECT_FALSE(rbf.togetherIsQuicker(kPoints));
  std::vector<Vec3> gradients(kPoints);
  std::vector<double> first(kPoints);
  rbf.first(points, first, gradients);
  for (std::size_t i = 0; i < kPoints; i += 1001) {
    Vec3 g;
    EXPECT_EQ(rbf.first(points[i], g), first[i]);
    EXPECT_EQ(g, gradients[i]);
  }
}

TEST_F(RbfTogether, PowersOfTwoScaleEveryBit) {
  const Rbf rbf(centres, values);
  auto scaled = centres, scaledValues = values, scaledPoints = points;
  for (auto* list : {&scaled, &scaledPoints})
    for (Vec3& p : *list) p *= 1024;
  for (Vec3& v : scaledValues) v /= 64;
  const Rbf other(scaled, scaledValues);
  std::vector<Vec3> a(kPoints), b(kPoints);
  rbf.evaluate(points, a);
  other.evaluate(scaledPoints, b);
  for (std::size_t i = 0; i < kPoints; ++i) ASSERT_EQ(Vec3(a[i] / 64), b[i]);
}

TEST_F(RbfTogether, BadInputIsRefused) {
  EXPECT_THROW(Rbf(centres, values, {.tolerance = -1}), std::invalid_argument);
  EXPECT_THROW(Rbf(centres, values, {.tolerance = std::nan("")}), std::invalid_argument);
  const Rbf rbf(centres, values);
  std::vector<double> few(kPoints - 1), enough(kPoints);
  std::vector<Vec3> gradients(kPoints), fewer(kPoints - 1);
  EXPECT_THROW(rbf.first(points, few, gradients), std::invalid_argument);
  EXPECT_THROW(rbf.first(points, enough, fewer), std::invalid_argument);
  EXPECT_THROW(rbf.evaluate(points, fewer), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::numeric
