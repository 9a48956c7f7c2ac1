#include <fielddeform/core/parallel.h>
#include <fielddeform/core/random.h>
#include <fielddeform/numeric/compact_rbf.h>
#include <fielddeform/numeric/rbf.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <vector>

namespace fielddeform::numeric {
namespace {

Vec3 randomPoint(std::uint64_t seed, std::uint64_t i) {
  return {2 * uniform01(seed, 3 * i) - 1, 2 * uniform01(seed, 3 * i + 1) - 1, 2 * uniform01(seed, 3 * i + 2) - 1};
}

struct Data {
  std::vector<Vec3> centres;
  std::vector<double> values;
};

double smooth(const Vec3& p) { return std::sin(2 * p.x()) + p.y() * p.y() - 0.5 * p.z(); }

Data scattered(std::size_t n, std::uint64_t seed = 1) {
  Data d;
  for (std::size_t i = 0; i < n; ++i) {
    d.centres.push_back(randomPoint(seed, i));
    d.values.push_back(smooth(d.centres.back()));
  }
  return d;
}

TEST(CompactRbf, MeetsTheValuesWithinTheTolerance) {
  const Data d = scattered(3000);
  for (const double tolerance : {1e-3, 1e-6}) {
    CompactRbfOptions o;
    o.tolerance = tolerance;
    const CompactRbf f(d.centres, d.values, o);
    EXPECT_EQ(f.report().distinct, 3000u);
    EXPECT_LE(f.report().residual, tolerance);
    double worst = 0;
    Vec3 g;
    for (std::size_t i = 0; i < d.centres.size(); ++i) worst = std::max(worst, std::abs(f.evaluate(d.centres[i], g) - d.values[i]));
    EXPECT_NEAR(worst, f.report().residual, 1e-12);
  }
}

TEST(CompactRbf, BetweenTheCentresTheErrorFallsWithTheirSpacing) {
  std::vector<double> errors;
  for (const std::size_t n : {200, 1600, 12800}) {  // half the spacing each
    const Data d = scattered(n, 3);
    const CompactRbf f(d.centres, d.values);
    double sum = 0;
    Vec3 g;
    for (std::uint64_t i = 0; i < 500; ++i) {
      const Vec3 p = 0.7 * randomPoint(4, i);
      sum += std::pow(f.evaluate(p, g) - smooth(p), 2);
    }
    errors.push_back(std::sqrt(sum / 500));
  }
  EXPECT_LT(errors[1], 0.4 * errors[0]);
  EXPECT_LT(errors[2], 0.4 * errors[1]);
}

TEST(CompactRbf, ReproducesLinearFunctionsEverywhere) {
  Data d = scattered(500);
  const auto linear = [](const Vec3& p) { return 3 - p.x() + 2 * p.y() + 0.25 * p.z(); };
  for (std::size_t i = 0; i < 500; ++i) d.values[i] = linear(d.centres[i]);
  const CompactRbf f(d.centres, d.values);
  EXPECT_EQ(f.report().levels, 0);
  Vec3 g;
  for (std::uint64_t i = 0; i < 50; ++i) {
    const Vec3 p = 5 * randomPoint(5, i);
    EXPECT_NEAR(f.evaluate(p, g), linear(p), 1e-12);
    EXPECT_LT((g - Vec3(-1, 2, 0.25)).norm(), 1e-12);
  }
}

TEST(CompactRbf, GradientIsTheCentralDifference) {
  const Data d = scattered(2500, 6);
  const CompactRbf f(d.centres, d.values);
  const double h = 1e-5;
  Vec3 g, unused;
  for (std::uint64_t i = 0; i < 200; ++i) {
    const Vec3 p = 1.2 * randomPoint(7, i);
    f.evaluate(p, g);
    Vec3 central;
    for (int k = 0; k < 3; ++k)
      central[k] = (f.evaluate(p + h * Vec3::Unit(k), unused) - f.evaluate(p - h * Vec3::Unit(k), unused)) / (2 * h);
    EXPECT_LT((central - g).norm(), 1e-6);  // h^2 times third derivatives of about (3 / spacing)^3
  }
}

TEST(CompactRbf, FlatStraightAndCoincidentCentresGiveNumbers) {
  for (const int dimensions : {0, 1, 2}) {
    Data d = scattered(400, 8);
    for (std::size_t i = 0; i < d.centres.size(); ++i) {
      for (int k = dimensions; k < 3; ++k) d.centres[i][k] = 0.5;
      d.values[i] = smooth(d.centres[i]);
    }
    const CompactRbf f(d.centres, d.values);
    EXPECT_EQ(f.report().distinct, dimensions == 0 ? 1u : 400u);
    EXPECT_LE(f.report().residual, 1e-6) << dimensions;
    Vec3 g;
    for (std::uint64_t i = 0; i < 50; ++i) EXPECT_TRUE(std::isfinite(f.evaluate(3 * randomPoint(9, i), g)) && g.allFinite());
  }
  Data twice = scattered(300);  // contradicting values are averaged
  const std::size_t n = twice.centres.size();
  for (std::size_t i = 0; i < n; ++i) {
    twice.centres.push_back(twice.centres[i]);
    twice.values.push_back(twice.values[i] + 1);
  }
  const CompactRbf f(twice.centres, twice.values);
  EXPECT_EQ(f.report().distinct, 300u);
  Vec3 g;
  EXPECT_NEAR(f.evaluate(twice.centres[0], g), twice.values[0] + 0.5, 1e-6);
}

// Noise of 0.2 (0.058 in the mean square) on n values.
Data noisy(std::size_t n) {
  Data d = scattered(n, 10);
  for (std::size_t i = 0; i < n; ++i) d.values[i] += 0.2 * (uniform01(11, i) - 0.5);
  return d;
}

CompactRbf smoothed(const Data& d, double smoothing) {
  CompactRbfOptions o;
  o.smoothing = smoothing;
  return CompactRbf(d.centres, d.values, o);
}

// Mean square of what differs in the middle.
template <class A, class B>
double meanSquare(const A& a, const B& b) {
  double sum = 0;
  for (std::uint64_t i = 0; i < 500; ++i) {
    const Vec3 p = 0.8 * randomPoint(12, i);
    sum += std::pow(a(p) - b(p), 2);
  }
  return sum / 500;
}

TEST(CompactRbf, SmoothingGivesWayToNoise) {
  const Data d = noisy(2000);
  const CompactRbf rough(d.centres, d.values), soft = smoothed(d, 0.3);
  Vec3 g;
  const auto roughly = [&](const Vec3& p) { return rough.evaluate(p, g); };
  const auto softly = [&](const Vec3& p) { return soft.evaluate(p, g); };
  // About 60 of 2000 degrees of freedom are left: sqrt(60 / 2000) of the noise, and its square is 1 / 30.
  EXPECT_LT(meanSquare(softly, smooth), 0.15 * meanSquare(roughly, smooth));
  EXPECT_GT(soft.report().residual, 0.09);  // the noise stays behind: at most 0.1
  EXPECT_LT(soft.report().residual, 0.2);
}

TEST(CompactRbf, SmoothingMeansWhatItMeansForTheCubicKernel) {
  const Data d = noisy(1500);
  std::vector<Vec3> values;
  for (const double v : d.values) values.emplace_back(v, 0, 0);
  Vec3 g;
  for (const double smoothing : {0.003, 0.03, 0.3, 3.0, 30.0}) {  // from nearly all of the noise to hardly more than a plane
    RbfOptions o;
    o.smoothing = smoothing;
    const Rbf dense(d.centres, values, o);
    const CompactRbf compact = smoothed(d, smoothing);
    const auto densely = [&](const Vec3& p) { return dense.first(p, g); };
    const auto compactly = [&](const Vec3& p) { return compact.evaluate(p, g); };
    const double wanted = meanSquare(densely, smooth), error = meanSquare(compactly, smooth);
    EXPECT_LT(error, 2 * wanted) << smoothing;
    EXPECT_GT(error, wanted / 2) << smoothing;
    EXPECT_LT(meanSquare(densely, compactly), 0.6 * wanted) << smoothing;
    double left = 0, leftDensely = 0;
    for (std::size_t i = 0; i < d.centres.size(); ++i) {
      left += std::pow(compactly(d.centres[i]) - d.values[i], 2);
      leftDensely += std::pow(densely(d.centres[i]) - d.values[i], 2);
    }
    EXPECT_NEAR(left / leftDensely, 1, 0.25) << smoothing;
  }
}

TEST(CompactRbf, LittleSmoothingInterpolatesAndMuchLeavesTheLinearFit) {
  const Data d = noisy(1000);
  EXPECT_LT(smoothed(d, 1e-9).report().residual, 1e-3);
  const CompactRbf flat = smoothed(d, 1e9);
  Vec3 a, b;
  flat.evaluate(Vec3(-0.5, 0.2, 0.1), a);
  flat.evaluate(Vec3(0.4, -0.3, 0.6), b);
  EXPECT_LT((a - b).norm(), 1e-5);  // the linear fit's slopes are about 1
}

TEST(CompactRbf, MoreSmoothingLeavesMore) {
  const Data d = noisy(1200);
  double last = 0;
  for (const double smoothing : {0.0, 1e-4, 1e-3, 1e-2, 0.1, 1.0}) {
    const CompactRbf f = smoothed(d, smoothing);
    Vec3 g;
    double sum = 0;
    for (std::size_t i = 0; i < d.centres.size(); ++i) sum += std::pow(f.evaluate(d.centres[i], g) - d.values[i], 2);
    EXPECT_GE(sum, last) << smoothing;
    last = sum;
  }
}

TEST(CompactRbf, PowersOfTwoAndThreadsChangeNoBit) {
  const Data d = scattered(1500, 13);
  std::vector<Vec3> scaled = d.centres;
  for (Vec3& c : scaled) c *= 4096;
  const CompactRbf f(d.centres, d.values);
  const ThreadLimit limit(1);
  const CompactRbf g(scaled, d.values);
  Vec3 a, b;
  for (std::uint64_t i = 0; i < 100; ++i) {
    const Vec3 p = randomPoint(14, i);
    EXPECT_EQ(f.evaluate(p, a), g.evaluate(4096 * p, b));
    EXPECT_EQ(a, 4096 * b);
  }
}

TEST(CompactRbf, BadInputIsRefused) {
  const Data d = scattered(20);
  std::vector<double> few(3);
  EXPECT_THROW(CompactRbf({}, {}), std::invalid_argument);
  EXPECT_THROW(CompactRbf(d.centres, few), std::invalid_argument);
  Data bad = d;
  bad.centres[3].y() = std::nan("");
  EXPECT_THROW(CompactRbf(bad.centres, bad.values), std::invalid_argument);
  bad = d;
  bad.values[3] = HUGE_VAL;
  EXPECT_THROW(CompactRbf(bad.centres, bad.values), std::invalid_argument);
  CompactRbfOptions o;
  o.tolerance = 0;
  EXPECT_THROW(CompactRbf(d.centres, d.values, o), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::numeric
