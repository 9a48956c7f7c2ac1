// The grid path against the exact one.
#include <fielddeform/core/detail/simd.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/core/random.h>
#include <fielddeform/gffd/detail/cells.h>
#include <fielddeform/gffd/detail/grid_kernel.h>
#include <gtest/gtest.h>
#include <tests/gffd/gffd_testing.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <tuple>

namespace fielddeform::gffd::tests {
namespace {

using fielddeform::tests::bendMap;
using fielddeform::tests::Case;
using fielddeform::tests::makeCase;
using fielddeform::tests::verticalLine;

struct Tracks {
  std::vector<Vec3> position, safe;
  std::vector<Status> status;
  std::vector<float> residual;
  EvaluationCounts counts;
  bool operator==(const Tracks& o) const {
    return position == o.position && safe == o.safe && status == o.status && residual == o.residual;
  }
};

Tracks tracksOf(const GffdMap& map, Points points) {
  const std::size_t n = points.size();
  Tracks r{std::vector<Vec3>(n), std::vector<Vec3>(n), std::vector<Status>(n), std::vector<float>(n), {}};
  Progress silent;
  r.counts = map.applyCounted(*map.bind(points), {.position = r.position, .safe = r.safe, .status = r.status, .residual = r.residual}, silent);
  return r;
}

GffdMap mapOf(const Case& c, Options options) { return GffdMap(resolve(options, c.mesh, skeleton::pairSkeletons(c.rest, c.posed))); }

std::size_t of(const Tracks& r, Status s) { return countStatuses(r.status)[static_cast<std::size_t>(s)]; }

TEST(GridKernel, ReproducesCubicsAndConstants) {
  const auto f = [](double x, double y, double z) { return 0.3 + x * (1 - y * (0.5 + z)) + 0.25 * x * x * x * y * y - 0.1 * z * z * z * x * x; };
  double cell[detail::kCoefficients];
  double* at = cell;
  for (int i = -1; i < 3; ++i)
    for (int j = -1; j < 3; ++j)
      for (int k = -1; k < 3; ++k) {
        *at++ = f(i, j, k);
        *at++ = f(j, k, i);
        *at++ = 0.7;
      }
  detail::cubicFromNodes(cell);
  double u[16], v[16], w[16], x[24], y[24], z[24];
  for (int p = 0; p < 16; ++p) {
    u[p] = p / 16.0;
    v[p] = std::fmod(p * 0.37, 1);
    w[p] = std::fmod(p * 0.73, 1);
  }
  detail::cubicAt(cell, 13, u, v, w, x, y, z);
  for (int p = 0; p < 13; ++p) {
    EXPECT_NEAR(x[p], f(u[p], v[p], w[p]), 1e-14);  // rounding of some 60 sums of order one
    EXPECT_NEAR(y[p], f(v[p], w[p], u[p]), 1e-14);
    EXPECT_EQ(z[p], 0.7);
  }
}

TEST(CellOrder, HoldsEveryTakenPointOnceInItsCell) {
  const Case c = makeCase("bend90");
  const auto frame = detail::CellFrame::of(c.rest);
  ASSERT_TRUE(frame);
  const auto& points = c.mesh.positions();
  const auto take = [](std::size_t i) { return i % 3 != 0; };
  const detail::CellOrder order = detail::orderByCell(*frame, points, take);
  std::vector<int> seen(points.size(), 0);
  std::set<std::tuple<int, int, int>> cells;
  for (const auto& run : order.runs) {
    EXPECT_TRUE(cells.insert({run.cell.x, run.cell.y, run.cell.z}).second);
    ASSERT_LT(run.begin, run.end);
    for (std::uint32_t k = run.begin; k < run.end; ++k) {
      const std::uint32_t i = order.order[k];
      if (k > run.begin) {
        ASSERT_LT(order.order[k - 1], i);
      }
      ++seen[i];
      const Vec3 u = (points[i] - frame->node(run.cell)) / frame->side;
      ASSERT_GE(u.minCoeff(), -1e-9);
      ASSERT_LE(u.maxCoeff(), 1 + 1e-9);
    }
  }
  for (std::size_t i = 0; i < points.size(); ++i) ASSERT_EQ(seen[i], take(i) ? 1 : 0);
  EXPECT_EQ(detail::countCells(*frame, points, take, points.size()), cells.size());
}

// Interpolation is checked to 5e-5 R at five points a cell; between them it is mostly within twice that, and at kinks
// of the predictor (coarse lines, branches) up to four times.
constexpr double kInterpolation = 2e-4;

class GridCases : public testing::TestWithParam<const char*> {};

TEST_P(GridCases, PredictsAsTheExactPathAndKeepsEveryValue) {
  const Case c = makeCase(GetParam());
  for (const Predictor predictor : {Predictor::Mls, Predictor::Axial}) {
    const Options options{.predictor = predictor, .guard = false};
    Options exactly = options, grid = options;
    exactly.evaluation = Evaluation::Exact;
    grid.evaluation = Evaluation::Grid;
    const GffdMap map = mapOf(c, grid);
    ASSERT_TRUE(map.usesGrid());
    std::vector<Vec3> points;
    for (std::size_t i = 0; i < c.mesh.vertexCount(); i += 3) points.push_back(c.mesh.positions()[i]);
    const Tracks a = tracksOf(mapOf(c, exactly), points), b = tracksOf(map, points);
    EXPECT_EQ(b.counts.grid + b.counts.exact, map.countMovable(*map.bind(points)));
    EXPECT_GT(b.counts.grid, points.size() / 6) << GetParam() << ' ' << toString(predictor);
    const double r = map.resolved().referenceRadius;
    EXPECT_LT(greatestDistance(a.safe, b.safe), kInterpolation * r) << GetParam() << ' ' << toString(predictor) << ' ' << r;
    EXPECT_LT(meanDistance(a.safe, b.safe), 1e-5 * r);
    EXPECT_EQ(of(b, Status::Converged), of(a, Status::Converged)) << GetParam() << ' ' << toString(predictor);
    for (std::size_t i = 0; i < b.position.size(); ++i)
      if (b.status[i] == Status::Converged) {
        ASSERT_LE(b.residual[i], 1.0001e-4 * r);
      }
    // Where the posed field has a kink the exact map itself jumps; nearly everywhere the two are as near as predicted.
    std::vector<double> apart(a.position.size());
    for (std::size_t i = 0; i < apart.size(); ++i) apart[i] = (a.position[i] - b.position[i]).norm();
    std::sort(apart.begin(), apart.end());
    EXPECT_LT(apart[apart.size() * 99 / 100], kInterpolation * r) << GetParam() << ' ' << toString(predictor);
  }
}

INSTANTIATE_TEST_SUITE_P(All, GridCases,
                         testing::Values("bend90", "bend180", "twist4_180", "twist2_180", "stretch2", "branch"),
                         [](const auto& i) { return std::string(i.param); });

TEST(Grid, EveryInstructionSetAndThreadCountWritesTheSameBytes) {
  using fielddeform::detail::SimdLevel;
  for (const char* name : {"bend90", "twist2_180"}) {
    const Case c = makeCase(name);
    const GffdMap map = mapOf(c, {.predictor = Predictor::Mls, .evaluation = Evaluation::Grid});
    const Tracks first = tracksOf(map, c.mesh.positions());
    for (const SimdLevel level : {SimdLevel::Baseline, SimdLevel::Avx2, SimdLevel::Avx512}) {
      if (level > fielddeform::detail::supportedSimdLevel()) continue;
      const fielddeform::detail::SimdLimit limit(level);
      EXPECT_TRUE(tracksOf(mapOf(c, map.resolved().options), c.mesh.positions()) == first) << name << ' ' << toString(level);
    }
    for (const int threads : {1, 2, 7}) {
      const ThreadLimit limit(threads);
      EXPECT_TRUE(tracksOf(mapOf(c, map.resolved().options), c.mesh.positions()) == first) << name << ' ' << threads;
    }
  }
}

TEST(Grid, APointsResultDoesNotDependOnItsCompany) {
  for (const char* name : {"bend180", "twist4_180"}) {
    const Case c = makeCase(name);
    const GffdMap map = mapOf(c, {.evaluation = Evaluation::Grid});
    const Tracks all = tracksOf(map, c.mesh.positions());
    std::vector<Vec3> some;
    std::vector<std::size_t> index;
    for (std::size_t i = 0; i < all.position.size(); ++i)
      if (splitmix64(1, i) % 29 == 0) some.push_back(c.mesh.positions()[i]), index.push_back(i);
    std::reverse(some.begin(), some.end());
    std::reverse(index.begin(), index.end());
    // By a map that knows no cell yet, and by one that knows all.
    for (const GffdMap& m : {GffdMap(map.resolved()), map}) {
      const Tracks part = tracksOf(m, some);
      for (std::size_t k = 0; k < some.size(); ++k) {
        ASSERT_EQ(part.position[k], all.position[index[k]]);
        ASSERT_EQ(part.safe[k], all.safe[index[k]]);
        ASSERT_EQ(part.residual[k], all.residual[index[k]]);
      }
    }
  }
}

TEST(Grid, ScalingByAPowerOfTwoScalesEveryByte) {
  for (const char* name : {"bend90", "twist2_180"}) {
    Case c = makeCase(name);
    const Tracks small = tracksOf(mapOf(c, {.evaluation = Evaluation::Grid}), c.mesh.positions());
    for (Vec3& p : c.mesh.mutablePositions()) p *= 1024;
    for (auto* s : {&c.rest, &c.posed})
      for (auto& p : s->primitives) {
        for (Vec3& q : p.points) q *= 1024;
        p.radius = *p.radius * 1024;
      }
    const Tracks large = tracksOf(mapOf(c, {.evaluation = Evaluation::Grid}), c.mesh.positions());
    for (std::size_t i = 0; i < small.position.size(); ++i) ASSERT_EQ(Vec3(1024 * small.position[i]), large.position[i]) << name << ' ' << i;
  }
}

TEST(Grid, IdentityAndRigidEditsAreRecognisedFirst) {
  Case c = makeCase("bend90");
  c.posed = c.rest;
  const GffdMap still = mapOf(c, {.evaluation = Evaluation::Grid});
  EXPECT_FALSE(still.usesGrid());
  EXPECT_EQ(tracksOf(still, c.mesh.positions()).position, c.mesh.positions());
  for (const char* name : {"trans", "rottrans"}) {
    const Case rigid = makeCase(name);
    const GffdMap map = mapOf(rigid, {.evaluation = Evaluation::Grid});
    EXPECT_FALSE(map.usesGrid());
    EXPECT_LT(greatestDistance(tracksOf(map, rigid.mesh.positions()).position, rigid.ideal), 1e-9);
  }
}

TEST(Grid, PointsOutsideTheInfluenceKeepTheirBitsAndAFalloffIsExactToRounding) {
  const mesh::Mesh mesh = fielddeform::tests::makeCapsule({.around = 60, .along = 120});
  const auto rest = lineSkeleton(verticalLine(9, 0.8), 0.4), posed = lineSkeleton(bendMap(verticalLine(9, 0.8), 0.8, 0.8), 0.4);
  Options options{.predictor = Predictor::Axial, .evaluation = Evaluation::Grid, .guard = false};
  const auto pair = skeleton::pairSkeletons(rest, posed);
  const GffdMap grid(resolve(options, mesh, pair));
  options.evaluation = Evaluation::Exact;
  const GffdMap exact(resolve(options, mesh, pair));
  ASSERT_TRUE(grid.hasFalloff() && grid.usesGrid());
  const Tracks a = tracksOf(exact, mesh.positions()), b = tracksOf(grid, mesh.positions());
  const auto weight = grid.falloffWeights(*grid.bind(mesh.positions()));
  std::size_t fixed = 0, faded = 0;
  for (std::size_t i = 0; i < mesh.vertexCount(); ++i) {
    if (b.status[i] == Status::Fixed) {
      ++fixed;
      ASSERT_EQ(b.position[i], mesh.positions()[i]);
    } else if (weight[i] < 1) {
      ++faded;
      ASSERT_LT((b.safe[i] - a.safe[i]).norm(), 1e-12);
      ASSERT_LT((b.position[i] - a.position[i]).norm(), 1e-12);  // the same mathematics in another order
    }
  }
  EXPECT_GT(fixed, 100u);
  EXPECT_GT(faded, 100u);
}

TEST(Grid, NonFinitePointsComeBackInvalidAndAsTheyWere) {
  const Case c = makeCase("bend90");
  const GffdMap map = mapOf(c, {.evaluation = Evaluation::Grid});
  std::vector<Vec3> points(c.mesh.positions().begin(), c.mesh.positions().begin() + 40);
  const Tracks before = tracksOf(map, points);
  points[7][1] = std::numeric_limits<double>::quiet_NaN();
  points[9][0] = std::numeric_limits<double>::infinity();
  const Tracks r = tracksOf(map, points);
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (i == 7 || i == 9) {
      EXPECT_EQ(r.status[i], Status::Invalid);
    } else {
      EXPECT_EQ(r.position[i], before.position[i]);
    }
  }
  EXPECT_TRUE(std::isnan(r.position[7][1]));
}

TEST(Grid, AutoTakesItWhereThereAreManyVerticesACell) {
  const auto pair = skeleton::pairSkeletons(lineSkeleton(verticalLine(17, 2), .6), lineSkeleton(bendMap(verticalLine(17, 2), 1), .6));
  const mesh::Mesh few = fielddeform::tests::makeCapsule({.around = 96, .along = 100});
  const mesh::Mesh many = fielddeform::tests::makeCapsule({.around = 200, .along = 250});
  const Options options{.predictor = Predictor::Axial, .falloff = Falloff::Off};
  EXPECT_EQ(resolve(options, few, pair).options.evaluation, Evaluation::Exact);
  EXPECT_EQ(resolve(options, many, pair).options.evaluation, Evaluation::Grid);
}

}  // namespace
}  // namespace fielddeform::gffd::tests
