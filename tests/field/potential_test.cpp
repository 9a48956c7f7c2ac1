#include <fielddeform/field/potential.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

namespace fielddeform::field {
namespace {

using skeleton::Potential;
constexpr Potential kAll[] = {Potential::Exponential, Potential::Gaussian, Potential::Metaball, Potential::SoftObject};

// The printed formulas, in u = d / r.
double printed(Potential p, double k, double u) {
  switch (p) {
    case Potential::Exponential: return std::exp(-k * u) - std::exp(-k);
    case Potential::Gaussian: return std::exp(-k * u * u) - std::exp(-k);
    case Potential::Metaball: return u <= 1.0 / 3 ? 1 - 3 * u * u : 1.5 * (1 - u) * (1 - u);
    default: return 1 - 4.0 / 9 * std::pow(u, 6) + 17.0 / 9 * std::pow(u, 4) - 22.0 / 9 * u * u;
  }
}

TEST(Kernel, ValuesAreThePapersFormulas) {
  for (const Potential p : kAll)
    for (const double k : {0.5, 1.0, 4.0, 20.0}) {
      const Kernel e(p, k);
      for (double u = 0; u < 1; u += 1.0 / 64) EXPECT_NEAR(e.value(k * u), printed(p, k, u), 2e-15);
      EXPECT_NEAR(e.atZero(), printed(p, k, 0), 1e-15);
      EXPECT_EQ(e.value(0), e.atZero());
    }
}

TEST(Kernel, IsZeroAtAndBeyondTheRadiusAndPositiveWithin) {
  for (const Potential p : kAll) {
    const Kernel e(p, 4);
    for (const double x : {4.0, 4.1, 1e300, std::numeric_limits<double>::infinity()}) EXPECT_EQ(e.value(x), 0);
    EXPECT_GT(e.value(3.999), 0);
    EXPECT_EQ(e.derivative(4.1), 0);
    double last = e.value(-20);
    for (double x = -20 + 1.0 / 32; x <= 4; x += 1.0 / 32) {
      EXPECT_LT(e.value(x), last);
      last = e.value(x);
    }
  }
}

TEST(Kernel, DerivativeIsTheCentralDifference) {
  for (const Potential p : kAll)
    for (const double k : {1.0, 4.0}) {
      const Kernel e(p, k);
      for (double x = -2.95; x < k; x += 0.1) {
        if (std::abs(3 * x / k - 1) < 1e-3) continue;  // the metaball's pieces meet with a jump of curvature
        const double h = 1e-5, difference = (e.value(x + h) - e.value(x - h)) / (2 * h);
        EXPECT_NEAR(e.derivative(x), difference, 1e-8 * (1 + std::abs(difference)));  // h^2 and rounding / h
      }
    }
}

TEST(Kernel, InverseReturnsTheArgument) {
  for (const Potential p : kAll)
    for (const double k : {1.0, 4.0, 30.0}) {
      const Kernel e(p, k);
      for (int i = -200; i < 200; ++i) {
        const double x = (i + 0.5) / 200 * k;
        // The value's rounding, divided by the slope.
        const double tolerance = 4e-16 * e.atZero() / std::max(-e.derivative(x), 1e-14) + 1e-14 * std::abs(x);
        EXPECT_NEAR(e.inverse(e.value(x)), x, tolerance) << static_cast<int>(p) << ' ' << k;
        EXPECT_NEAR(e.slopeAt(e.value(x)), e.derivative(x), 1e-6 * e.atZero() / k);
      }
      EXPECT_EQ(e.inverse(0), k);
      EXPECT_EQ(e.inverse(-1), k);
    }
}

TEST(Kernel, SlopesVanishWhereThePapersSaySo) {
  for (const Potential p : {Potential::Gaussian, Potential::Metaball, Potential::SoftObject}) EXPECT_EQ(Kernel(p, 4).derivative(0), 0);
  for (const Potential p : {Potential::Metaball, Potential::SoftObject}) EXPECT_EQ(Kernel(p, 4).derivative(4), 0);
  EXPECT_LT(Kernel(Potential::Gaussian, 4).derivative(4), -0.03);
}

TEST(Kernel, InsideASolidItStaysFiniteAndInvertible) {
  for (const Potential p : kAll) {
    const Kernel e(p, 4);
    for (const double x : {-1.0, -100.0, -599.0}) EXPECT_NEAR(e.inverse(e.value(x)), x, 1e-13 * -x);
    EXPECT_TRUE(std::isfinite(e.value(-1e9)));
    EXPECT_LT(e.derivative(-1e9), 0);
    EXPECT_TRUE(std::isfinite(e.derivative(-1e9)));
  }
  EXPECT_EQ(Kernel(Potential::Exponential, 4).value(-700), Kernel(Potential::Exponential, 4).value(-600));
}

TEST(Kernel, SharpnessOutOfRangeIsRefused) {
  for (const double k : {0.0, -1.0, 501.0, std::nan(""), std::numeric_limits<double>::infinity()})
    EXPECT_THROW(Kernel(Potential::Gaussian, k), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::field
