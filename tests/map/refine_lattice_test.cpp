#include <fielddeform/core/random.h>
#include <fielddeform/map/lattice_io.h>
#include <fielddeform/map/refine_lattice.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <stdexcept>

namespace fielddeform::map {
namespace {

std::vector<AxisBasis> axes() {
  std::vector<AxisBasis> list;
  for (const int degree : {1, 2, 3})
    for (const int nodes : {degree + 1, degree + 2, 7})
      for (const Border border : {Border::Coincident, Border::Free}) list.push_back(AxisBasis::bspline(nodes, degree, border));
  list.push_back(AxisBasis::withKnots(3, {0, 0, 0, 0, 0.2, 0.2, 1, 3, 3, 3, 3}));
  list.push_back(AxisBasis::withKnots(2, {-1, -0.5, 0, 0.3, 1, 1.5, 4}));
  return list;
}

double valueAt(const AxisBasis& axis, const std::vector<double>& nodes, double u, bool slope = false) {
  const AxisBasis::Values v = axis.evaluate(u);
  double sum = 0;
  for (std::size_t k = 0; k < v.weight.size(); ++k)
    sum += (slope ? v.slope[k] : v.weight[k]) * nodes[static_cast<std::size_t>(v.first) + k];
  return sum;
}

std::vector<double> times(const SparseRows& m, const std::vector<double>& v) {
  std::vector<double> out(m.rows(), 0.0);
  for (std::size_t r = 0; r < m.rows(); ++r)
    for (std::size_t e = m.start[r]; e < m.start[r + 1]; ++e) out[r] += m.value[e] * v[m.column[e]];
  return out;
}

// The functions before and after agree in value and slope, and so do u's own coordinates.
void expectSame(const AxisBasis& before, const AxisRefinement& after, double slopeTolerance = 1e-11) {
  std::vector<double> values, rest, restAfter;
  for (int i = 0; i < before.nodes(); ++i) {
    values.push_back(2 * uniform01(5, static_cast<std::uint64_t>(i)) - 1);
    rest.push_back(before.restNode(i));
  }
  for (int i = 0; i < after.axis.nodes(); ++i) restAfter.push_back(after.axis.restNode(i));
  const auto refinedValues = times(after.matrix, values), refinedRest = times(after.matrix, rest);
  ASSERT_EQ(refinedRest.size(), restAfter.size());
  for (std::size_t i = 0; i < restAfter.size(); ++i) EXPECT_NEAR(refinedRest[i], restAfter[i], 1e-14);
  for (int i = 0; i <= 400; ++i) {
    const double u = i / 400.0;
    EXPECT_NEAR(valueAt(before, values, u), valueAt(after.axis, refinedValues, u), 2e-14) << u;
    EXPECT_NEAR(valueAt(after.axis, restAfter, u), u, 2e-14);
    if (before.degree() > 1) {
      EXPECT_NEAR(valueAt(before, values, u, true), valueAt(after.axis, refinedValues, u, true), slopeTolerance) << u;
    }
  }
}

TEST(RefineLattice, InsertedKnotsChangeNoFunction) {
  for (const AxisBasis& axis : axes()) {
    SCOPED_TRACE(::testing::Message() << "degree " << axis.degree() << ", nodes " << axis.nodes() << ", border " << static_cast<int>(axis.border()));
    const int pieces = static_cast<int>(breaks(axis).size()) - 1;
    std::vector<int> all(static_cast<std::size_t>(pieces));
    std::iota(all.begin(), all.end(), 0);
    const AxisRefinement once = insertKnots(axis, all);
    EXPECT_EQ(once.axis.nodes(), axis.nodes() + pieces);
    expectSame(axis, once);
    const AxisRefinement one = insertKnots(axis, std::span(all).subspan(0, 1));
    EXPECT_EQ(one.axis.nodes(), axis.nodes() + 1);
    expectSame(axis, one);
    const std::vector<int> last{pieces - 1};
    expectSame(axis, insertKnots(axis, last));
    // And again, of what is no longer uniform, down to pieces of 1/16.
    AxisBasis deep = axis;
    for (int round = 0; round < 4; ++round) {
      const std::vector<int> first{0};
      const AxisRefinement next = insertKnots(deep, first);
      expectSame(deep, next, 1e-9);  // slopes grow as the pieces shrink
      deep = next.axis;
    }
  }
}

TEST(RefineLattice, RaisedDegreesChangeNoFunction) {
  for (const int nodes : {2, 3, 5, 9}) {
    const AxisBasis axis = AxisBasis::bernstein(nodes);
    for (const int more : {1, 4, 13}) expectSame(axis, elevate(axis, nodes + more));
  }
}

TEST(RefineLattice, BreaksAreWhereThePiecesMeet) {
  EXPECT_EQ(breaks(AxisBasis::bernstein(5)), (std::vector<double>{0, 1}));
  const auto free = breaks(AxisBasis::bspline(5, 3, Border::Free));
  ASSERT_EQ(free.size(), 3u);
  EXPECT_NEAR(free[1], 0.5, 1e-15);
  // Coincident: the outermost segment ends a sixth of a node spacing from the border.
  const auto at = breaks(AxisBasis::bspline(5, 3, Border::Coincident));
  ASSERT_EQ(at.size(), 7u);
  EXPECT_NEAR(at[1], 0.25 / 6, 1e-15);
  EXPECT_NEAR(at[2], 0.25, 1e-15);
}

TEST(RefineLattice, TheMapIsTheSameEverywhere) {
  Lattice lattice;
  lattice.box.origin = Vec3(-1, 2, 0.5);
  lattice.box.axes << 2, 0.3, 0, 0, 1.5, 0.2, 0.1, 0, 1;
  const std::array<std::array<AxisBasis, 3>, 2> kinds{
      std::array<AxisBasis, 3>{AxisBasis::bspline(5, 3, Border::Coincident), AxisBasis::bspline(6, 3, Border::Free), AxisBasis::bspline(4, 2, Border::Coincident)},
      std::array<AxisBasis, 3>{AxisBasis::bernstein(4), AxisBasis::bernstein(2), AxisBasis::bspline(6, 3, Border::Coincident)}};
  for (const auto& axis : kinds) {
    lattice.axis = axis;
    lattice.displacements.clear();
    for (std::uint64_t i = 0; i < lattice.nodeCount(); ++i)
      lattice.displacements.push_back(Vec3(uniform01(7, 3 * i), uniform01(7, 3 * i + 1), uniform01(7, 3 * i + 2)) - Vec3::Constant(0.5));
    const Lattice fine = refined(lattice), finest = refined(fine);
    EXPECT_GT(fine.nodeCount(), 2 * lattice.nodeCount());
    const LatticeMap before(lattice), after(fine), again(finest);
    for (std::uint64_t i = 0; i < 500; ++i) {
      Vec3 u(uniform01(8, 3 * i), uniform01(8, 3 * i + 1), uniform01(8, 3 * i + 2));
      u = u * 1.4 - Vec3::Constant(0.2);  // some outside, carried along
      const Vec3 x = lattice.box.origin + lattice.box.axes * u;
      EXPECT_LT((before.position(x) - after.position(x)).norm(), 1e-13);
      EXPECT_LT((before.position(x) - again.position(x)).norm(), 1e-13);
      EXPECT_LT((before.jacobian(x) - after.jacobian(x)).norm(), 1e-11);
    }
  }
}

TEST(RefineLattice, FilesKeepEveryBitOfARefinedLattice) {
  Lattice lattice;
  lattice.axis = {AxisBasis::bspline(5, 3, Border::Coincident), AxisBasis::bspline(5, 2, Border::Free), AxisBasis::bernstein(3)};
  lattice.displacements.assign(lattice.nodeCount(), Vec3::Zero());
  lattice.displacements[7] = Vec3(0.25, 0.5, -0.125);
  const Lattice fine = refined(lattice);
  for (const LatticeFormat format : {LatticeFormat::Json, LatticeFormat::Obj}) {
    const Lattice again = parseLattice(formatLattice(fine, format), "again");
    EXPECT_EQ(again.axis, fine.axis);
    ASSERT_EQ(again.displacements.size(), fine.displacements.size());
    // OBJ holds the nodes where they stand: displacements come back to rounding.
    for (std::size_t i = 0; i < fine.displacements.size(); ++i)
      EXPECT_LT((again.displacements[i] - fine.displacements[i]).norm(), format == LatticeFormat::Json ? 1e-300 : 1e-15);
  }
}

TEST(RefineLattice, BadInputIsRefused) {
  const AxisBasis spline = AxisBasis::bspline(5, 3, Border::Coincident), bezier = AxisBasis::bernstein(4);
  const std::vector<int> far{6}, twice{1, 1}, negative{-1};
  for (const auto& pieces : {far, twice, negative}) EXPECT_THROW(insertKnots(spline, pieces), std::invalid_argument);
  EXPECT_THROW(insertKnots(bezier, std::vector<int>{0}), std::invalid_argument);
  EXPECT_THROW(elevate(spline, 9), std::invalid_argument);
  EXPECT_THROW(elevate(bezier, 4), std::invalid_argument);
  Lattice lattice;
  EXPECT_THROW(refined(lattice, 3, elevate(AxisBasis::bernstein(2), 3)), std::invalid_argument);
  EXPECT_THROW(refined(lattice, 0, elevate(bezier, 5)), std::invalid_argument);
  EXPECT_THROW(AxisBasis::coincident(3, {0, 1, 2}, {0, 1}), std::invalid_argument);
  EXPECT_THROW(AxisBasis::coincident(2, {0, 1, 2, 3, 4, 5, 6, 7}, {0, 0.5, 0.9}), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::map
