#include <gtest/gtest.h>
#include <tests/map/lattices.h>

#include <cmath>
#include <limits>
#include <stdexcept>

namespace fielddeform::map {
namespace {

using test::everyAxis;

// Points of [0, 1], ends and middles included, and those on either side of every breakpoint.
std::vector<double> parameters(const AxisBasis& axis) {
  std::vector<double> u;
  for (int i = 0; i <= 40; ++i) u.push_back(i / 40.0);
  for (std::uint64_t i = 0; i < 40; ++i) u.push_back(uniform01(1, i));
  for (const double k : axis.knots()) {
    const double low = axis.knots()[static_cast<std::size_t>(axis.degree())];
    const double high = axis.knots()[axis.knots().size() - 1 - static_cast<std::size_t>(axis.degree())];
    const double at = (k - low) / (high - low);
    for (const double v : {std::nextafter(at, -1.0), at, std::nextafter(at, 2.0)})
      if (v >= 0 && v <= 1) u.push_back(v);
  }
  return u;
}

TEST(AxisBasis, IsAPartitionOfUnityWithLinearPrecision) {
  for (const AxisBasis& axis : everyAxis())
    for (const double u : parameters(axis)) {
      const AxisBasis::Values v = axis.evaluate(u);
      double sum = 0, x = 0, slope = 0, dx = 0;
      for (int k = 0; k < axis.support(); ++k) {
        ASSERT_LT(v.first + k, axis.nodes());
        sum += v.weight[k];
        x += v.weight[k] * axis.restNode(v.first + k);
        slope += v.slope[k];
        dx += v.slope[k] * axis.restNode(v.first + k);
        EXPECT_GE(v.weight[k], -4e-16);  // rounding, where a function begins
      }
      EXPECT_NEAR(sum, 1, 2e-15);  // a rounding or two a degree
      EXPECT_NEAR(x, u, 2e-15);                            // a root near the border: a few roundings
      const double scale = 4.0 * axis.nodes() * axis.degree() * 20;  // of the slopes, in the shortest of the segments above
      EXPECT_NEAR(slope, 0, 1e-15 * scale);
      EXPECT_NEAR(dx, 1, 1e-15 * scale);
    }
}

TEST(AxisBasis, AgreesWithTheTextbook) {
  for (const AxisBasis& axis : everyAxis())
    for (const double u : parameters(axis)) {
      const AxisBasis::Values v = axis.evaluate(u);
      std::vector<double> all(static_cast<std::size_t>(axis.nodes()), 0.0);
      for (int k = 0; k < axis.support(); ++k) all[v.first + k] = v.weight[k];
      const std::vector<double> slow = test::slowWeights(axis, u);
      for (int i = 0; i < axis.nodes(); ++i)  // one sided at a multiple knot, where the functions are continuous anyway
        EXPECT_NEAR(all[i], slow[i], 1e-13) << axis.nodes() << " nodes, degree " << axis.degree() << ", u = " << u;
    }
}

TEST(AxisBasis, SlopesAreCentralDifferences) {
  const double h = 1e-6;
  for (const AxisBasis& axis : everyAxis())
    for (std::uint64_t i = 0; i < 40; ++i) {
      const double u = h + (1 - 2 * h) * uniform01(2, i);
      const AxisBasis::Values v = axis.evaluate(u), a = axis.evaluate(u - h), b = axis.evaluate(u + h);
      if (a.first != b.first) continue;
      for (int k = 0; k < axis.support(); ++k)
        // h^2 times a third derivative, and 1e-16 / h
        EXPECT_NEAR((b.weight[k] - a.weight[k]) / (2 * h), v.slope[k], 1e-6 * axis.nodes() * axis.nodes());
    }
}

TEST(AxisBasis, UniformSplinesAreAsSmoothAsTheirDegreeAllows) {
  for (const Border border : {Border::Coincident, Border::Free})
    for (const int degree : {2, 3})
      for (const int n : {4, 5, 9}) {
        const AxisBasis axis = AxisBasis::bspline(n, degree, border);
        const auto at = [&](double u) {
          const AxisBasis::Values v = axis.evaluate(u);
          std::vector<double> all(2 * static_cast<std::size_t>(n), 0.0);
          for (int k = 0; k < axis.support(); ++k) {
            all[v.first + k] = v.weight[k];
            all[n + v.first + k] = v.slope[k];
          }
          return all;
        };
        for (int q = 1; q < 6 * (n - 1); ++q) {  // every breakpoint is a sixth of a node spacing
          const double e = 1e-9;
          const auto a = at(q / (6.0 * (n - 1)) - e), b = at(q / (6.0 * (n - 1)) + e);
          for (std::size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(a[i], b[i], 1e-6);  // e times the next derivative, <= 8 n^2
        }
      }
}

TEST(AxisBasis, OneSegmentIsBernstein) {
  const AxisBasis spline = AxisBasis::withKnots(3, {2, 2, 2, 2, 5, 5, 5, 5}), bezier = AxisBasis::bernstein(4);
  for (std::uint64_t i = 0; i < 100; ++i) {
    const double u = uniform01(3, i);
    const AxisBasis::Values a = spline.evaluate(u), b = bezier.evaluate(u);
    for (int k = 0; k < 4; ++k) {
      EXPECT_NEAR(a.weight[k], b.weight[k], 5e-16);
      EXPECT_NEAR(a.slope[k], b.slope[k], 5e-15);
    }
  }
}

TEST(AxisBasis, CoincidentBordersMeetTheEndNodesAndBeginStraight) {
  for (const int degree : {1, 2, 3})
    for (const int n : {4, 5, 10}) {
      const AxisBasis axis = AxisBasis::bspline(n, degree, Border::Coincident);
      EXPECT_EQ(axis.evaluate(0).weight[0], 1);
      EXPECT_EQ(axis.evaluate(1).weight[degree], 1);
      const double outer = degree == 3 ? 1.0 / 6 : degree == 2 ? 0.5 : 1;
      for (int i = 0; i < 20; ++i) {
        const double x = outer * i / 20;  // in node spacings
        const AxisBasis::Values v = axis.evaluate(x / (n - 1));
        EXPECT_EQ(v.first, 0);
        EXPECT_NEAR(v.weight[0], 1 - x, 1e-15);
        EXPECT_NEAR(v.weight[1], x, 1e-15);
        EXPECT_NEAR(v.slope[1], n - 1, 1e-14 * n);
        for (int k = 2; k <= degree; ++k) EXPECT_EQ(v.weight[k], 0);
      }
    }
}

TEST(AxisBasis, MultipleKnotsMeetTheirNode) {
  const AxisBasis axis = AxisBasis::withKnots(3, {0, 0, 0, 0, 1, 1, 1, 2, 2, 2, 2});
  EXPECT_EQ(axis.nodes(), 7);
  EXPECT_EQ(axis.restNode(3), 0.5);
  const AxisBasis::Values v = axis.evaluate(0.5);
  EXPECT_EQ(v.first, 3);
  EXPECT_EQ(v.weight[0], 1);
}

TEST(AxisBasis, IsMirrored) {
  for (const int degree : {1, 2, 3})
    for (const Border border : {Border::Coincident, Border::Free}) {
      const AxisBasis axis = AxisBasis::bspline(7, degree, border);
      for (std::uint64_t i = 0; i < 100; ++i) {
        const double u = uniform01(4, i);
        const AxisBasis::Values a = axis.evaluate(u), b = axis.evaluate(1 - u);
        ASSERT_EQ(a.first, 7 - 1 - degree - b.first);
        for (int k = 0; k <= degree; ++k) {
          EXPECT_NEAR(a.weight[k], b.weight[degree - k], 2e-15);
          EXPECT_NEAR(a.slope[k], -b.slope[degree - k], 5e-14);
        }
      }
    }
}

TEST(AxisBasis, HighDegreesAreStable) {
  for (const int n : {64, 513, 3000}) {
    const AxisBasis axis = AxisBasis::bernstein(n);
    for (const double u : {0.0, 1e-9, 0.31, 0.5, 0.999, 1.0}) {
      const AxisBasis::Values v = axis.evaluate(u);
      double sum = 0, x = 0;
      for (int k = 0; k < n; ++k) {
        EXPECT_GE(v.weight[k], 0);
        sum += v.weight[k];
        x += v.weight[k] * axis.restNode(k);
      }
      EXPECT_NEAR(sum, 1, 1e-15 * n);  // a rounding a degree
      EXPECT_NEAR(x, u, 1e-15 * n);
    }
  }
}

TEST(AxisBasis, FewNodesLowerTheDegreeAndOutsideIsClamped) {
  EXPECT_EQ(AxisBasis::bspline(2, 3, Border::Coincident).degree(), 1);
  EXPECT_EQ(AxisBasis::bspline(3, 3, Border::Free).degree(), 2);
  for (const AxisBasis& axis : everyAxis()) {
    EXPECT_EQ(axis.evaluate(-3).weight, axis.evaluate(0).weight);
    EXPECT_EQ(axis.evaluate(7).weight, axis.evaluate(1).weight);
    EXPECT_EQ(axis.evaluate(std::nan("")).weight, axis.evaluate(0).weight);
  }
}

TEST(AxisBasis, BadInputIsRefused) {
  const double nan = std::nan(""), inf = std::numeric_limits<double>::infinity();
  EXPECT_THROW(AxisBasis::bernstein(1), std::invalid_argument);
  EXPECT_THROW(AxisBasis::bspline(1, 1, Border::Free), std::invalid_argument);
  EXPECT_THROW(AxisBasis::bspline(5, 0, Border::Free), std::invalid_argument);
  EXPECT_THROW(AxisBasis::bspline(5, 4, Border::Free), std::invalid_argument);
  EXPECT_THROW(AxisBasis::bspline(5, 3, Border::Knots), std::invalid_argument);
  for (const std::vector<double>& knots : std::vector<std::vector<double>>{
           {}, {0, 0, 0, 1, 1, 1, 1}, {0, 0, 0, 0, 2, 1, 3, 3, 3, 3}, {0, 0, 0, 0, nan, 1, 1, 1, 1}, {0, 0, 0, 0, 1, 1, 1, inf},
           {0, 0, 0, 0, 0, 1, 1, 1, 1}, {0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2}, {1, 1, 1, 1, 1, 1, 1, 1}, {0, 0, 0, 0, 1e-320, 1, 1, 1, 1}})
    EXPECT_THROW(AxisBasis::withKnots(3, knots), std::invalid_argument) << knots.size();
}

}  // namespace
}  // namespace fielddeform::map
