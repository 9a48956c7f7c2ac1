#include <fielddeform/core/random.h>
#include <fielddeform/numeric/augmented_lagrangian.h>
#include <fielddeform/numeric/cubic.h>
#include <fielddeform/numeric/legendre.h>
#include <fielddeform/numeric/sqp.h>
#include <gtest/gtest.h>

#include <cmath>

namespace fielddeform::numeric {
namespace {

using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;

TEST(Cubic, FindsTheRootsItWasMadeOf) {
  for (std::uint64_t i = 0; i < 2000; ++i) {
    const double a = 4 * uniform01(1, 4 * i) - 2, b = 4 * uniform01(1, 4 * i + 1) - 2, c = 4 * uniform01(1, 4 * i + 2) - 2;
    const double scale = std::exp(20 * uniform01(1, 4 * i + 3) - 10);
    const auto roots = cubicRoots({-scale * a * b * c, scale * (a * b + b * c + c * a), -scale * (a + b + c), scale});
    double expected[] = {a, b, c};
    std::sort(std::begin(expected), std::end(expected));
    if (std::min(expected[1] - expected[0], expected[2] - expected[1]) < 1e-3) continue;  // rounding merges close ones
    ASSERT_EQ(roots.size(), 3u);
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(roots[k], expected[k], 1e-9);
  }
}

TEST(Cubic, TakesTheNearestRootAndLowerDegrees) {
  EXPECT_NEAR(*smallestCubicRoot({-6, 11, -6, 1}), 1, 1e-15);
  EXPECT_NEAR(*smallestCubicRoot({2, -4, 0, 0}), 0.5, 1e-16);
  EXPECT_NEAR(*smallestCubicRoot({1e-9, 1, 1e-20, -1e-25}), -1e-9, 1e-24);
  EXPECT_FALSE(smallestCubicRoot({1, 0, 1, 0}));
  EXPECT_FALSE(smallestCubicRoot({1, 0, 0, 0}));
  EXPECT_EQ(*smallestCubicRoot({0, 1, 0, 0}), 0);
}

TEST(Legendre, QuadratureIsExactToItsDegree) {
  for (const int n : {1, 2, 5, 12, 40}) {
    const Quadrature q = gaussLegendre(n);
    for (int degree = 0; degree < 2 * n; ++degree) {
      double sum = 0;
      for (std::size_t i = 0; i < q.point.size(); ++i) sum += q.weight[i] * std::pow(q.point[i], degree);
      EXPECT_NEAR(sum, 1.0 / (degree + 1), 1e-14);
    }
  }
  EXPECT_THROW(gaussLegendre(0), std::invalid_argument);
}

TEST(Legendre, PolynomialsAreOrthogonalAndTheirIntegralsTheirs) {
  const Quadrature q = gaussLegendre(12);
  Matrix gram = Matrix::Zero(10, 10);
  std::vector<double> p(10), s(10), sAhead(10), sBehind(10);
  for (std::size_t i = 0; i < 12; ++i) {
    shiftedLegendre(q.point[i], p);
    gram += q.weight[i] * Eigen::Map<Vector>(p.data(), 10) * Eigen::Map<Vector>(p.data(), 10).transpose();
  }
  for (int k = 0; k < 10; ++k) gram(k, k) -= 1.0 / (2 * k + 1);
  EXPECT_LT(gram.norm(), 1e-14);
  shiftedLegendreIntegrals(0, s);
  for (const double v : s) EXPECT_NEAR(v, 0, 1e-15);
  const double h = 1e-5;
  shiftedLegendre(0.3, p);
  shiftedLegendreIntegrals(0.3 + h, sAhead), shiftedLegendreIntegrals(0.3 - h, sBehind);
  for (std::size_t k = 0; k < 10; ++k) EXPECT_NEAR((sAhead[k] - sBehind[k]) / (2 * h), p[k], 1e-6);
}

double rosenbrock(const Vector& x, Vector& g) {
  g.setZero(x.size());
  double f = 0;
  for (Eigen::Index i = 0; i + 1 < x.size(); ++i) {
    const double a = x[i + 1] - x[i] * x[i], b = 1 - x[i];
    f += 100 * a * a + b * b;
    g[i] += -400 * a * x[i] - 2 * b;
    g[i + 1] += 200 * a;
  }
  return f;
}

TEST(Minimize, FollowsRosenbrocksValley) {
  for (const auto method : {conjugateGradients, lbfgs}) {
    Vector x = Vector::Constant(6, -0.7);
    int steps = 0;
    double last = 1e300;
    const MinimizeReport r = method(rosenbrock, x, {.gradient = 1e-9}, [&](const Vector&, double value) {
      EXPECT_LE(value, last + 1e-12);
      last = value;
      return ++steps > 0;
    });
    EXPECT_TRUE(r.converged);
    EXPECT_EQ(r.steps, steps);
    EXPECT_LT((x - Vector::Ones(6)).norm(), 1e-8);
  }
}

/// Least x^T D x / 2 + saddle terms on an ellipsoid sum a_i x_i^2 = 1.
class OnEllipsoid final : public ConstrainedProblem {
 public:
  explicit OnEllipsoid(Eigen::Index n) : d_(n), a_(n) {
    for (Eigen::Index i = 0; i < n; ++i) d_[i] = 1 + static_cast<double>(i) / static_cast<double>(n), a_[i] = 1 + 0.5 * std::sin(static_cast<double>(i));
  }
  Eigen::Index variables() const override { return d_.size(); }
  Eigen::Index constraints() const override { return 1; }
  double values(const Vector& x, Vector& c) override {
    c = Vector::Constant(1, a_.dot(x.cwiseAbs2()) - 1);
    return 0.5 * d_.dot(x.cwiseAbs2());
  }
  double derivatives(const Vector& x, Vector& g, Vector& c, Matrix& j) override {
    g = d_.cwiseProduct(x);
    j = 2 * a_.cwiseProduct(x);
    return values(x, c);
  }
  void hessian(const Vector&, const Vector& m, Matrix& h) override { h = (d_ + 2 * m[0] * a_).asDiagonal(); }
  void linearize(const Vector&, const Vector& m) override { diagonal_ = d_ + 2 * m[0] * a_; }
  void hessianTimes(const Vector& p, Vector& out) override { out = diagonal_.cwiseProduct(p); }
  /// min over i of d_i / (2 a_i)
  double least() const { return 0.5 * d_.cwiseQuotient(a_).minCoeff(); }

 private:
  Vector d_, a_, diagonal_;
};

TEST(Sqp, EndsAtTheLeastOfManyStationaryPoints) {
  // Every axis of the ellipsoid is stationary; all but one are saddles. The start is one of them.
  OnEllipsoid problem(9);
  Vector x = Vector::Unit(9, 4) * 0.7;
  const SqpReport r = sqp(problem, x, {.maxSaddles = 20});
  EXPECT_TRUE(r.converged);
  EXPECT_GT(r.saddles, 0);
  EXPECT_NEAR(r.value, problem.least(), 1e-12);
  Vector stuck = Vector::Unit(9, 4) * 0.7;
  const SqpReport s = sqp(problem, stuck, {.maxSaddles = 0});
  EXPECT_TRUE(s.converged);
  EXPECT_TRUE(s.saddle);
  EXPECT_GT(s.value, problem.least());
}

TEST(Sqp, SparseAndAugmentedLagrangianFindTheSame) {
  OnEllipsoid problem(40);
  Vector x(40);
  for (Eigen::Index i = 0; i < 40; ++i) x[i] = uniform01(3, static_cast<std::uint64_t>(i));
  Vector y = x;
  const SqpReport sparse = sparseSqp(problem, x, {});
  EXPECT_TRUE(sparse.converged);
  EXPECT_NEAR(sparse.value, problem.least(), 1e-10);
  for (const auto inner : {InnerMinimizer::ConjugateGradients, InnerMinimizer::Lbfgs}) {
    AugmentedLagrangianState state{y, {}, 1};
    const auto r = augmentedLagrangian(problem, state, {.inner = inner, .minimize = {.gradient = 1e-9, .maxSteps = 20000}, .tolerance = 1e-9});
    EXPECT_TRUE(r.converged);
    EXPECT_NEAR(r.value, problem.least(), 1e-8);
    EXPECT_NEAR(state.multiplier[0], sparse.multiplier[0], 1e-6);
  }
}

}  // namespace
}  // namespace fielddeform::numeric
