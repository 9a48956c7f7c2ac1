#include <fielddeform/core/random.h>
#include <fielddeform/numeric/elementary.h>
#include <gtest/gtest.h>

#include <vector>

namespace fielddeform::numeric {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

// libm's long double functions (64-bit mantissa) are exact to 1e-19: an independent reference.
double relativeError(double value, long double reference) {
  return static_cast<double>(std::abs((static_cast<long double>(value) - reference) / reference));
}

TEST(Elementary, ExpIsAccurateOverItsWholeRange) {
  double worst = 0;
  for (std::uint64_t i = 0; i < 300000; ++i) {
    const double u = uniform01(1, i);
    const double x = i % 3 == 0 ? -708 + 1417 * u : i % 3 == 1 ? 4 * u - 4 : (u - 0.5) * std::ldexp(1.0, -static_cast<int>(i % 60));
    worst = std::max(worst, relativeError(exp(x), std::exp(static_cast<long double>(x))));
  }
  EXPECT_LT(worst, 3e-16);
}

TEST(Elementary, ExpEndsGraduallyAndSaturates) {
  EXPECT_EQ(exp(0), 1);
  EXPECT_EQ(exp(-746), 0);
  EXPECT_EQ(exp(-1e300), 0);
  EXPECT_EQ(exp(-kInf), 0);
  EXPECT_EQ(exp(710), kInf);
  EXPECT_EQ(exp(kInf), kInf);
  EXPECT_TRUE(std::isnan(exp(std::nan(""))));
  for (double x = -745; x < -708; x += 0.37) EXPECT_NEAR(exp(x), std::exp(x), 5e-324 + 3e-16 * std::exp(x)) << x;
}

TEST(Elementary, LogIsAccurateOverItsWholeRange) {
  double worst = 0;
  for (std::uint64_t i = 0; i < 300000; ++i) {
    const double u = uniform01(2, i);
    // All magnitudes, the neighbourhood of 1 on both sides, and the range where the mantissa is folded.
    const double x = i % 3 == 0   ? std::ldexp(1 + u, static_cast<int>(i % 2098) - 1074)
                     : i % 3 == 1 ? 1 + (u - 0.5) * std::ldexp(1.0, -static_cast<int>(i % 45))
                                  : 0.5 + u;
    if (x == 1 || x == 0 || x == kInf) continue;
    worst = std::max(worst, relativeError(log(x), std::log(static_cast<long double>(x))));
  }
  EXPECT_LT(worst, 3e-16);
}

TEST(Elementary, LogOfSpecialValues) {
  EXPECT_EQ(log(1), 0);
  EXPECT_EQ(log(0), -kInf);
  EXPECT_EQ(log(-0.0), -kInf);
  EXPECT_EQ(log(kInf), kInf);
  EXPECT_TRUE(std::isnan(log(-1)));
  EXPECT_TRUE(std::isnan(log(std::nan(""))));
}

TEST(Elementary, SinAndCosAreAccurateInRange) {
  double worst = 0;
  for (std::uint64_t i = 0; i < 300000; ++i) {
    const double x = (2 * uniform01(3, i) - 1) * (i % 2 ? 5e5 : 7.0);
    const SinCos sc = sincos(x);
    const long double y = x;
    worst = std::max(worst, static_cast<double>(std::abs(sc.sin - std::sin(y))));
    worst = std::max(worst, static_cast<double>(std::abs(sc.cos - std::cos(y))));
  }
  EXPECT_LT(worst, 2e-16);
  for (int k = 1; k < 1000; k += 2) EXPECT_EQ(sincos(std::ldexp(1.0, -k)).sin, std::sin(std::ldexp(1.0, -k)));
  EXPECT_EQ(sincos(0).sin, 0);
  EXPECT_EQ(sincos(0).cos, 1);
  EXPECT_TRUE(std::isnan(sincos(6e5).sin));
  EXPECT_TRUE(std::isnan(sincos(std::nan("")).cos));
}

TEST(Elementary, Atan2IsAccurateInEveryOctant) {
  double worst = 0;
  for (std::uint64_t i = 0; i < 300000; ++i) {
    const double scale = std::ldexp(1.0, static_cast<int>(i % 40) - 30);
    const double x = 2 * uniform01(4, 2 * i) - 1, y = (2 * uniform01(4, 2 * i + 1) - 1) * scale;
    worst = std::max(worst, relativeError(atan2(y, x), std::atan2(static_cast<long double>(y), static_cast<long double>(x))));
  }
  EXPECT_LT(worst, 5e-16);
}

TEST(Elementary, Atan2OnTheAxesKeepsTheSignsOfZero) {
  for (const double y : {0.0, -0.0, 1.0, -1.0})
    for (const double x : {0.0, -0.0, 1.0, -1.0}) {
      EXPECT_EQ(atan2(y, x), std::atan2(y, x)) << y << ' ' << x;
      EXPECT_EQ(std::signbit(atan2(y, x)), std::signbit(y));
    }
}

TEST(Elementary, Atan2DoesNotSeePowersOfTwo) {
  for (std::uint64_t i = 0; i < 1000; ++i) {
    const double x = uniform01(5, 2 * i) - 0.5, y = uniform01(5, 2 * i + 1) - 0.5;
    EXPECT_EQ(atan2(y, x), atan2(1024 * y, 1024 * x));
  }
}

}  // namespace
}  // namespace fielddeform::numeric
