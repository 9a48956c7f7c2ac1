#include <fielddeform/core/detail/simd.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/core/random.h>
#include <fielddeform/numeric/detail/cholesky.h>
#include <fielddeform/numeric/rbf.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

namespace fielddeform::numeric {
namespace {

Vec3 randomPoint(std::uint64_t seed, std::uint64_t i) {
  return {2 * uniform01(seed, 3 * i) - 1, 2 * uniform01(seed, 3 * i + 1) - 1, 2 * uniform01(seed, 3 * i + 2) - 1};
}

std::vector<Vec3> cloud(std::uint64_t seed, std::size_t n) {
  std::vector<Vec3> p(n);
  for (std::size_t i = 0; i < n; ++i) p[i] = randomPoint(seed, i);
  return p;
}

Vec3 smooth(const Vec3& p) { return {std::sin(2 * p.x()) + p.y(), p.x() * p.y(), std::exp(p.z())}; }

std::vector<Vec3> valuesOf(const std::vector<Vec3>& centres, Vec3 (*f)(const Vec3&)) {
  std::vector<Vec3> v;
  for (const Vec3& c : centres) v.push_back(f(c));
  return v;
}

double interpolationError(const Rbf& rbf, const std::vector<Vec3>& centres, const std::vector<Vec3>& values) {
  double worst = 0;
  for (std::size_t i = 0; i < centres.size(); ++i) worst = std::max(worst, (rbf.evaluate(centres[i]) - values[i]).norm());
  return worst;
}

TEST(Rbf, MeetsTheValuesAtTheCentres) {
  for (const std::size_t n : {5u, 30u, 300u}) {
    const auto centres = cloud(1, n), values = valuesOf(centres, smooth);
    const Rbf rbf(centres, values);
    EXPECT_LT(interpolationError(rbf, centres, values), 1e-11);
    EXPECT_LT(rbf.report().residual, 1e-11);
    EXPECT_EQ(rbf.report().distinct, n);
    EXPECT_EQ(rbf.report().polynomialTerms, 4);
    EXPECT_EQ(rbf.report().ridge, 0);
  }
}

TEST(Rbf, SolvesTheSystemOfThePaper) {
  const auto centres = cloud(2, 60), values = valuesOf(centres, smooth);
  const int n = 60;
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(n + 4, n + 4), b = Eigen::MatrixXd::Zero(n + 4, 3);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) a(i, j) = std::pow((centres[i] - centres[j]).norm(), 3);
    a(i, n) = a(n, i) = 1;
    for (int k = 0; k < 3; ++k) a(i, n + 1 + k) = a(n + 1 + k, i) = centres[i][k];
    b.row(i) = values[i].transpose();
  }
  const Eigen::MatrixXd x = a.fullPivLu().solve(b);
  const Rbf rbf(centres, values);
  for (std::uint64_t i = 0; i < 200; ++i) {
    const Vec3 p = 1.5 * randomPoint(3, i);
    Vec3 expected = x.row(n).transpose() + x.bottomRows(3).transpose() * p;
    for (int j = 0; j < n; ++j) expected += x.row(j).transpose() * std::pow((p - centres[j]).norm(), 3);
    EXPECT_LT((rbf.evaluate(p) - expected).norm(), 1e-10);
  }
}

TEST(Rbf, ReproducesAffineMaps) {
  Mat3 m;
  m << 1, 2, -0.5, 0.3, -1, 2, 0.7, 0.1, 1.5;
  const Vec3 t(0.3, -2, 5);
  const auto centres = cloud(4, 100);
  std::vector<Vec3> values;
  for (const Vec3& c : centres) values.push_back(m * c + t);
  const Rbf rbf(centres, values);
  for (std::uint64_t i = 0; i < 200; ++i) {
    const Vec3 p = 3 * randomPoint(5, i);
    EXPECT_LT((rbf.evaluate(p) - (m * p + t)).norm(), 1e-11);
    EXPECT_LT((rbf.jacobian(p) - m).norm(), 1e-11);
  }
}

TEST(Rbf, JacobianIsTheCentralDifference) {
  const auto centres = cloud(6, 80);
  const Rbf rbf(centres, valuesOf(centres, smooth));
  const double h = 1e-5;
  for (std::uint64_t i = 0; i < 200; ++i) {
    const Vec3 p = 1.3 * randomPoint(7, i);
    for (int k = 0; k < 3; ++k) {
      const Vec3 difference = (rbf.evaluate(p + h * Vec3::Unit(k)) - rbf.evaluate(p - h * Vec3::Unit(k))) / (2 * h);
      EXPECT_LT((rbf.jacobian(p).col(k) - difference).norm(), 1e-7);  // h^2 times third derivatives of r^3
    }
  }
}

TEST(Rbf, OnALineItIsTheNaturalCubicSpline) {
  // Knots 0, 1, 2, values 0, 1, 0: second derivative at the middle -3, natural ends; s(1/2) = 11/16, slope 3/2 at 0.
  const Vec3 along = Vec3(1, 2, 2) / 3, start(5, -1, 2);
  const std::vector<Vec3> centres{start, start + along, start + 2 * along};
  const std::vector<Vec3> values{Vec3::Zero(), Vec3(1, 0, -2), Vec3::Zero()};
  const Rbf rbf(centres, values);
  EXPECT_EQ(rbf.report().polynomialTerms, 2);
  EXPECT_LT((rbf.evaluate(start + 0.5 * along) - 11.0 / 16 * values[1]).norm(), 1e-13);
  EXPECT_LT((rbf.jacobian(start) * along - 1.5 * values[1]).norm(), 1e-13);
  EXPECT_LT((rbf.evaluate(start - 10 * along) + 15 * values[1]).norm(), 1e-10);  // linear beyond the ends
}

TEST(Rbf, FlatSetsTakeTheLeastGradientAcross) {
  auto centres = cloud(8, 40);
  for (Vec3& c : centres) c.z() = 0.25;
  const Rbf plane(centres, valuesOf(centres, smooth));
  EXPECT_EQ(plane.report().polynomialTerms, 3);
  EXPECT_LT(interpolationError(plane, centres, valuesOf(centres, smooth)), 1e-12);
  for (const Vec3& c : centres) EXPECT_LT(plane.jacobian(c).col(2).norm(), 1e-11);
}

TEST(Rbf, FewCentresGiveTheConstantLineOrPlane) {
  const std::vector<Vec3> c{Vec3(1, 2, 3), Vec3(3, 2, 3), Vec3(1, 3, 3), Vec3(1, 2, 7)}, v{Vec3(1, 1, 1), Vec3(5, 1, 1), Vec3(1, 2, 1), Vec3(1, 1, 9)};
  for (std::size_t n = 1; n <= 4; ++n) {
    const Rbf rbf(Points(c.data(), n), Points(v.data(), n));
    EXPECT_EQ(rbf.report().polynomialTerms, static_cast<int>(n));
    for (std::size_t i = 0; i < n; ++i) EXPECT_LT((rbf.evaluate(c[i]) - v[i]).norm(), 1e-14);
    const Vec3 expected(n >= 2 ? 7 : 1, n >= 3 ? 3 : 1, n >= 4 ? 5 : 1);
    EXPECT_LT((rbf.evaluate(Vec3(4, 4, 5)) - expected).norm(), 1e-13);
  }
}

TEST(Rbf, CoincidentCentresAreMergedAndAveraged) {
  auto centres = cloud(9, 20), values = valuesOf(centres, smooth);
  centres.push_back(centres[3]);
  values.push_back(values[3] + Vec3(2, 0, 0));
  const Rbf rbf(centres, values);
  EXPECT_EQ(rbf.report().centres, 21u);
  EXPECT_EQ(rbf.report().distinct, 20u);
  EXPECT_LT((rbf.evaluate(centres[3]) - values[3] - Vec3(1, 0, 0)).norm(), 1e-12);
  const std::vector<Vec3> all(50, Vec3(1, 2, 3));
  const Rbf constant(all, all);
  EXPECT_EQ(constant.report().polynomialTerms, 1);
  EXPECT_EQ(constant.evaluate(Vec3(7, 7, 7)), Vec3(1, 2, 3));
}

TEST(Rbf, AlmostCoincidentCentresWithContradictingValuesStayFinite) {
  for (const double gap : {1e-3, 1e-5, 1e-7, 2e-9}) {
    auto centres = cloud(10, 50), values = valuesOf(centres, smooth);
    for (std::size_t i = 0; i < 10; ++i) {
      centres.push_back(centres[i] + gap * Vec3(1, 0, 0));
      values.push_back(values[i] + Vec3(0, 1, 0));
    }
    const Rbf rbf(centres, values);
    EXPECT_TRUE(std::isfinite(rbf.report().residual));
    for (std::uint64_t i = 0; i < 50; ++i) EXPECT_TRUE(rbf.evaluate(randomPoint(11, i)).allFinite());
  }
}

TEST(Rbf, ThinSetsStillInterpolate) {
  for (const double thickness : {1e-3, 1e-6, 1e-8, 1e-10, 1e-14}) {
    auto centres = cloud(12, 60);
    for (Vec3& c : centres) c.z() *= thickness;
    const Rbf rbf(centres, valuesOf(centres, smooth));
    EXPECT_LT(interpolationError(rbf, centres, valuesOf(centres, smooth)), 1e-7) << thickness;
  }
}

TEST(Rbf, PowersOfTwoScaleEveryBitAndDistanceFromTheOriginHardlyMatters) {
  const auto centres = cloud(13, 50), values = valuesOf(centres, smooth);
  const Rbf rbf(centres, values);
  for (const double f : {1024.0, 1.0 / 1024, std::ldexp(1.0, 600), std::ldexp(1.0, -600)}) {
    auto scaled = centres, scaledValues = values;
    for (Vec3& c : scaled) c *= f;
    for (Vec3& v : scaledValues) v *= f;
    const Rbf other(scaled, scaledValues);
    for (std::uint64_t i = 0; i < 50; ++i) {
      const Vec3 p = 2 * randomPoint(14, i);
      EXPECT_EQ(Vec3(rbf.evaluate(p) * f), other.evaluate(p * f));
      EXPECT_EQ(rbf.jacobian(p), other.jacobian(p * f));
    }
  }
  auto far = centres;
  const Vec3 away(1e4, -2e4, 1e4);
  for (Vec3& c : far) c += away;
  const Rbf other(far, values);
  for (std::uint64_t i = 0; i < 50; ++i) {
    const Vec3 p = randomPoint(15, i);
    EXPECT_LT((rbf.evaluate(p) - other.evaluate(p + away)).norm(), 1e-9);  // coordinates there are rounded to 4e-12
  }
}

TEST(Rbf, SmoothingTendsToTheLeastSquaresLine) {
  std::vector<Vec3> centres, values;
  for (int i = 0; i < 20; ++i) {
    centres.push_back(Vec3(i, 0, 0));
    values.push_back(Vec3(2.0 * i + (i % 2 ? 1 : -1), 0, 0));
  }
  // The oracle: the normal equations of the straight line.
  double sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (int i = 0; i < 20; ++i) {
    sx += i;
    sxx += i * i;
    sy += values[i].x();
    sxy += i * values[i].x();
  }
  const double slope = (20 * sxy - sx * sy) / (20 * sxx - sx * sx);
  const Rbf rbf(centres, values, {.smoothing = 1e9});
  EXPECT_NEAR(rbf.jacobian(Vec3(5.5, 0, 0))(0, 0), slope, 1e-7);
  double last = 1e-9;
  for (const double smoothing : {1e-6, 1e-5, 1e-4}) {
    const double residual = Rbf(centres, values, {.smoothing = smoothing}).report().residual;
    EXPECT_GT(residual, last);
    last = residual;
  }
}

TEST(Rbf, SameBitsOnAnyThreadCount) {
  const auto centres = cloud(16, 250), values = valuesOf(centres, smooth), points = cloud(17, 500);
  std::vector<Vec3> expected;
  for (const int threads : {1, 2, 7}) {
    const ThreadLimit limit(threads);
    std::vector<Vec3> out(points.size());
    Rbf(centres, values).evaluate(points, out);
    if (expected.empty()) expected = out;
    EXPECT_EQ(out, expected);
  }
}

TEST(Rbf, FirstIsTheFirstComponentAndItsGradient) {
  for (const std::size_t n : {1u, 7u, 8u, 9u, 200u}) {
    const auto centres = cloud(11, n);
    const Rbf rbf(centres, valuesOf(centres, smooth));
    for (std::uint64_t i = 0; i < 20; ++i) {
      const Vec3 p = i ? 1.5 * randomPoint(12, i) : centres[0];
      Vec3 gradient;
      EXPECT_NEAR(rbf.first(p, gradient), rbf.evaluate(p).x(), 1e-11) << n;
      EXPECT_LT((gradient.transpose() - rbf.jacobian(p).row(0)).norm(), 1e-10) << n;
    }
  }
}

TEST(Rbf, SameBitsOnAnyProcessor) {
  const auto centres = cloud(13, 101);
  const Rbf rbf(centres, valuesOf(centres, smooth));
  using fielddeform::detail::SimdLevel;
  std::vector<Vec3> results[3];
  for (const SimdLevel level : {SimdLevel::Baseline, SimdLevel::Avx2, SimdLevel::Avx512}) {
    const fielddeform::detail::SimdLimit limit(level);
    for (std::uint64_t i = 0; i < 50; ++i) {
      const Vec3 p = 1.3 * randomPoint(14, i);
      Vec3 gradient;
      const double first = rbf.first(p, gradient);
      for (const Vec3& x : {rbf.evaluate(p), gradient, Vec3(first, 0, 0)}) results[static_cast<int>(level)].push_back(x);
    }
  }
  EXPECT_TRUE(results[0] == results[1]);
  EXPECT_TRUE(results[0] == results[2]);
}

TEST(Rbf, BadInputIsRefusedWithTheNumber) {
  const auto centres = cloud(18, 2001);
  try {
    Rbf(centres, centres);
    FAIL();
  } catch (const std::invalid_argument& e) {
    EXPECT_NE(std::string(e.what()).find("2001"), std::string::npos);
    EXPECT_NE(std::string(e.what()).find("2000"), std::string::npos);
  }
  EXPECT_THROW(Rbf({}, {}), std::invalid_argument);
  EXPECT_THROW(Rbf(Points(centres.data(), 3), Points(centres.data(), 2)), std::invalid_argument);
  EXPECT_THROW(Rbf(Points(centres.data(), 3), Points(centres.data(), 3), {.smoothing = -1}), std::invalid_argument);
  const std::vector<Vec3> bad{Vec3(0, std::nan(""), 0)}, good{Vec3::Zero()};
  EXPECT_THROW(Rbf(bad, good), std::invalid_argument);
  EXPECT_THROW(Rbf(good, bad), std::invalid_argument);
}

TEST(Cholesky, SolvesAndRefuses) {
  const std::size_t n = 130;  // more than two blocks
  Eigen::MatrixXd b(n, n);
  for (std::size_t i = 0; i < n * n; ++i) b.data()[i] = uniform01(19, i) - 0.5;
  const Eigen::MatrixXd a = b * b.transpose() + 0.1 * Eigen::MatrixXd::Identity(n, n);
  detail::Dense d{n, std::vector<double>(a.data(), a.data() + n * n)};
  ASSERT_TRUE(detail::factorize(d));
  Eigen::VectorXd x = b.col(0), y = x;
  detail::solve(d, y.data());
  EXPECT_LT((a * y - x).norm(), 1e-11);
  detail::Dense indefinite{2, {1, 2, 2, 1}};
  EXPECT_FALSE(detail::factorize(indefinite));
  detail::Dense singular{2, {1, 1, 1, 1}};
  EXPECT_FALSE(detail::factorize(singular));
}

TEST(RbfSlow, TwoThousandCentresInterpolate) {
  const auto centres = cloud(20, 2000), values = valuesOf(centres, smooth);
  const Rbf rbf(centres, values);
  EXPECT_LT(interpolationError(rbf, centres, values), 1e-9);
}

}  // namespace
}  // namespace fielddeform::numeric
