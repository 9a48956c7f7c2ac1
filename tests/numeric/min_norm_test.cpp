#include <fielddeform/core/parallel.h>
#include <fielddeform/core/random.h>
#include <fielddeform/numeric/min_norm.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace fielddeform::numeric {
namespace {

struct Sparse {
  std::size_t columns = 0;
  std::vector<std::size_t> start{0};
  std::vector<Index> column;
  std::vector<double> value;

  SparseRowsView view() const { return {columns, start, column, value}; }
};

Sparse sparse(const Eigen::MatrixXd& a) {
  Sparse s;
  s.columns = static_cast<std::size_t>(a.cols());
  for (Eigen::Index r = 0; r < a.rows(); ++r) {
    for (Eigen::Index c = 0; c < a.cols(); ++c)
      if (a(r, c) != 0) s.column.push_back(static_cast<Index>(c)), s.value.push_back(a(r, c));
    s.start.push_back(s.column.size());
  }
  return s;
}

// A product of random factors has their inner size as its rank; every third entry of the factors is 0.
Eigen::MatrixXd randomMatrix(std::uint64_t seed, int rows, int columns, int rank) {
  Eigen::MatrixXd left(rows, rank), right(rank, columns);
  std::uint64_t i = 0;
  for (auto* m : {&left, &right})
    for (Eigen::Index k = 0; k < m->size(); ++k, ++i)
      m->data()[k] = splitmix64(seed + 9, i) % 3 == 0 ? 0 : 2 * uniform01(seed, i) - 1;
  return left * right;
}

std::vector<Vec3> randomRight(std::uint64_t seed, int rows) {
  std::vector<Vec3> b;
  for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(rows); ++i)
    b.push_back(2 * Vec3(uniform01(seed, 3 * i), uniform01(seed, 3 * i + 1), uniform01(seed, 3 * i + 2)) - Vec3::Ones());
  return b;
}

Eigen::MatrixXd matrix(Points p) {
  Eigen::MatrixXd m(static_cast<Eigen::Index>(p.size()), 3);
  for (Eigen::Index i = 0; i < m.rows(); ++i) m.row(i) = p[static_cast<std::size_t>(i)].transpose();
  return m;
}

// The oracle: singular values, those below 1e-10 of the largest taken as 0.
Eigen::MatrixXd pseudoInverse(const Eigen::MatrixXd& a) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(a, Eigen::ComputeThinU | Eigen::ComputeThinV);
  Eigen::VectorXd s = svd.singularValues();
  const double cut = 1e-10 * s[0];
  for (double& x : s) x = x > cut ? 1 / x : 0;
  return svd.matrixV() * s.asDiagonal() * svd.matrixU().transpose();
}

struct Shape { int rows, columns, rank; };
const Shape kShapes[] = {{1, 7, 1}, {5, 20, 5}, {20, 20, 20}, {30, 8, 8}, {12, 15, 6}, {40, 12, 5}, {9, 9, 1}};

TEST(MinNorm, IsThePseudoInverseForEveryShapeAndRank) {
  for (const Shape& s : kShapes) {
    const Eigen::MatrixXd a = randomMatrix(1, s.rows, s.columns, s.rank);
    const Sparse rows = sparse(a);
    const auto b = randomRight(2, s.rows);
    const Eigen::MatrixXd expected = pseudoInverse(a) * matrix(b);
    for (const MinNormMethod method : {MinNormMethod::Dense, MinNormMethod::Lsqr}) {
      MinNormOptions options;
      if (method == MinNormMethod::Lsqr) options.denseWork = options.fallbackWork = 0;
      MinNormReport report;
      const auto x = minNormLeastSquares(rows.view(), b, {}, options, &report);
      EXPECT_EQ(report.method, method);
      EXPECT_TRUE(report.converged);
      if (method == MinNormMethod::Dense) {
        EXPECT_EQ(report.rank, static_cast<std::size_t>(s.rank));
      }
      // Conditions of these matrices reach 1e4; its square times rounding for the iteration.
      EXPECT_LT((matrix(x) - expected).norm(), 1e-8 * expected.norm()) << s.rows << " by " << s.columns;
    }
  }
}

TEST(MinNorm, FixedRowsHoldAndTheRestIsLeastWithinThem) {
  for (const Shape& s : kShapes) {
    const Eigen::MatrixXd a = randomMatrix(3, s.rows, s.columns, s.rank), c = randomMatrix(4, 4, s.columns, 2);
    const Sparse rows = sparse(a), fixed = sparse(c);
    const auto b = randomRight(5, s.rows);
    const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(s.columns, s.columns);
    const Eigen::MatrixXd within = identity - pseudoInverse(c) * c;
    const Eigen::MatrixXd expected = pseudoInverse(a * within) * matrix(b);
    const auto x = matrix(minNormLeastSquares(rows.view(), b, fixed.view()));
    EXPECT_LT((c * x).norm(), 1e-12 * (1 + x.norm()));
    EXPECT_LT((x - expected).norm(), 1e-8 * (1e-3 + expected.norm())) << s.rows << " by " << s.columns;
    MinNormOptions iterate;
    iterate.denseWork = iterate.fallbackWork = 0;
    iterate.maxIterations = 100000;
    const auto y = matrix(minNormLeastSquares(rows.view(), b, fixed.view(), iterate));
    EXPECT_LT((c * y).norm(), 1e-5 * (1e-3 + y.norm()));  // they weigh 1e4, and squares count
  }
}

TEST(MinNorm, AgreesWithItselfOnAnyNumberOfThreads) {
  const Eigen::MatrixXd a = randomMatrix(6, 120, 150, 120);
  const Sparse rows = sparse(a);
  const auto b = randomRight(7, 120);
  for (const double denseWork : {1e9, 0.0}) {
    MinNormOptions options;
    options.denseWork = options.fallbackWork = denseWork;
    options.maxIterations = 50;
    std::vector<std::vector<Vec3>> x;
    for (const int threads : {1, 2, 7}) {
      const ThreadLimit limit(threads);
      x.push_back(minNormLeastSquares(rows.view(), b, {}, options));
    }
    EXPECT_EQ(x[0], x[1]);
    EXPECT_EQ(x[0], x[2]);
  }
}

TEST(MinNorm, PowersOfTwoScaleEveryBit) {
  const Eigen::MatrixXd a = randomMatrix(8, 30, 40, 25);
  const Sparse rows = sparse(a);
  const auto b = randomRight(9, 30);
  auto scaled = b;
  for (Vec3& v : scaled) v *= 1024;
  for (const double denseWork : {1e9, 0.0}) {
    MinNormOptions options;
    options.denseWork = options.fallbackWork = denseWork;
    const auto x = minNormLeastSquares(rows.view(), b, {}, options), y = minNormLeastSquares(rows.view(), scaled, {}, options);
    for (std::size_t i = 0; i < x.size(); ++i) EXPECT_EQ(Vec3(1024 * x[i]), y[i]);
  }
}

TEST(MinNorm, TheDenseMethodTakesOverWhatTheIterationCannotEnd) {
  const Eigen::MatrixXd a = randomMatrix(13, 40, 60, 40);
  const Sparse rows = sparse(a);
  const auto b = randomRight(14, 40);
  MinNormOptions options;
  options.denseWork = 0;
  options.maxIterations = 3;
  MinNormReport report;
  const auto x = minNormLeastSquares(rows.view(), b, {}, options, &report);
  EXPECT_EQ(report.method, MinNormMethod::Dense);
  EXPECT_EQ(report.iterations, 3);
  EXPECT_TRUE(report.converged);
  EXPECT_LT((a * matrix(x) - matrix(b)).norm(), 1e-10);
  options.fallbackWork = 0;
  minNormLeastSquares(rows.view(), b, {}, options, &report);
  EXPECT_FALSE(report.converged);
}

TEST(MinNorm, DampingIsTikhonovs) {
  const Eigen::MatrixXd a = randomMatrix(15, 30, 20, 12);
  const Sparse rows = sparse(a);
  const auto b = randomRight(16, 30);
  MinNormOptions options;
  options.damping = 0.1;
  const auto x = minNormLeastSquares(rows.view(), b, {}, options);
  const double weight = 0.1 * a.rowwise().norm().maxCoeff();
  const Eigen::MatrixXd normal = a.transpose() * a + weight * weight * Eigen::MatrixXd::Identity(20, 20);
  EXPECT_LT((matrix(x) - normal.ldlt().solve(a.transpose() * matrix(b))).norm(), 1e-10);
}

TEST(MinNorm, EmptyAndZeroSystemsMoveNothing) {
  const std::vector<Vec3> zero(3, Vec3::Zero()), one(3, Vec3::Ones());
  const Sparse none = sparse(Eigen::MatrixXd::Zero(3, 5));
  EXPECT_EQ(minNormLeastSquares(none.view(), one, {}), std::vector<Vec3>(5, Vec3::Zero()));
  const Sparse some = sparse(randomMatrix(10, 3, 5, 3));
  for (const double denseWork : {1e9, 0.0}) {
    MinNormOptions options;
    options.denseWork = options.fallbackWork = denseWork;
    EXPECT_EQ(minNormLeastSquares(some.view(), zero, {}, options), std::vector<Vec3>(5, Vec3::Zero()));
    // Everything held: no freedom, nothing moves.
    const Sparse all = sparse(Eigen::MatrixXd::Identity(5, 5));
    for (const Vec3& v : minNormLeastSquares(some.view(), one, all.view(), options)) EXPECT_LT(v.norm(), 1e-7);
  }
  SparseRowsView empty;
  empty.columns = 4;
  EXPECT_EQ(minNormLeastSquares(empty, {}, {}).size(), 4u);
}

TEST(MinNorm, BadInputIsRefused) {
  const Sparse a = sparse(randomMatrix(11, 3, 5, 3));
  auto b = randomRight(12, 3);
  EXPECT_THROW(minNormLeastSquares(a.view(), Points(b.data(), 2), {}), std::invalid_argument);
  EXPECT_THROW(minNormLeastSquares(a.view(), b, sparse(randomMatrix(1, 2, 4, 2)).view()), std::invalid_argument);
  EXPECT_THROW(minNormLeastSquares(a.view(), b, {}, {.rankTolerance = 0}), std::invalid_argument);
  b[1].y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(minNormLeastSquares(a.view(), b, {}), std::invalid_argument);
  Sparse wrong = a;
  wrong.column[0] = 5;
  b[1].y() = 0;
  EXPECT_THROW(minNormLeastSquares(wrong.view(), b, {}), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::numeric
