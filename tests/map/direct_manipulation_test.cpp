#include <fielddeform/core/error.h>
#include <fielddeform/map/direct_manipulation.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "lattices.h"

namespace fielddeform::map {
namespace {

using test::cloud;
using test::randomPoint;

Lattice spline(int x, int y, int z, Border border = Border::Coincident) {
  Lattice l;
  l.box = test::skewBox();
  l.axis = {AxisBasis::bspline(x, 3, border), AxisBasis::bspline(y, 3, border), AxisBasis::bspline(z, 3, border)};
  return l;
}

Lattice bezier(int x, int y, int z) {
  Lattice l;
  l.box = test::skewBox();
  l.axis = {AxisBasis::bernstein(x), AxisBasis::bernstein(y), AxisBasis::bernstein(z)};
  return l;
}

Targets pointTargets(const std::vector<Vec3>& rest, std::uint64_t seed, double size = 0.3) {
  Targets t;
  for (std::size_t i = 0; i < rest.size(); ++i) t.points.push_back({rest[i], rest[i] + size * randomPoint(seed, i), 1});
  return t;
}

Eigen::MatrixXd dense(const SparseRows& rows) {
  Eigen::MatrixXd m = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(rows.rows()), static_cast<Eigen::Index>(rows.columns));
  for (std::size_t r = 0; r < rows.rows(); ++r)
    for (std::size_t e = rows.start[r]; e < rows.start[r + 1]; ++e)
      m(static_cast<Eigen::Index>(r), rows.column[e]) = rows.value[e];
  return m;
}

Eigen::MatrixXd matrix(Points p) {
  Eigen::MatrixXd m(static_cast<Eigen::Index>(p.size()), 3);
  for (Eigen::Index i = 0; i < m.rows(); ++i) m.row(i) = p[static_cast<std::size_t>(i)].transpose();
  return m;
}

Eigen::MatrixXd wanted(const Targets& t) {
  Eigen::MatrixXd m(static_cast<Eigen::Index>(t.points.size()), 3);
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    const PointTarget& p = t.points[static_cast<std::size_t>(i)];
    m.row(i) = (p.image - p.rest).transpose();
  }
  return m;
}

// By singular values, cut at 1e-10 of the largest.
Eigen::MatrixXd pseudoInverse(const Eigen::MatrixXd& a) {
  const Eigen::BDCSVD<Eigen::MatrixXd> svd(a, Eigen::ComputeThinU | Eigen::ComputeThinV);
  Eigen::VectorXd s = svd.singularValues();
  const double cut = 1e-10 * s[0];
  for (double& x : s) x = x > cut ? 1 / x : 0;
  return svd.matrixV() * s.asDiagonal() * svd.matrixU().transpose();
}

SparseRows basisAt(const LinearMap& map, const Targets& t) {
  std::vector<Vec3> at;
  for (const PointTarget& p : t.points) at.push_back(p.rest);
  return map.basis(*map.bind(at));
}

void expectPartition(const ManipulationReport& r) {
  EXPECT_EQ(r.met + r.unmet + r.outside, r.points.size() + r.directions.size());
}

TEST(DirectManipulation, OneTargetFollowsTheClosedForm) {
  for (const Lattice& lattice : {spline(6, 5, 4), spline(7, 7, 7, Border::Free), bezier(4, 3, 5)}) {
    const LatticeMap map(lattice);
    for (std::uint64_t i = 0; i < 20; ++i) {
      Targets t = pointTargets({0.9 * randomPoint(1, i)}, i);
      const Manipulated m = moveTargets(map, t);
      const Eigen::MatrixXd b = dense(basisAt(map, t));
      const Eigen::MatrixXd expected = b.transpose() * wanted(t) / b.squaredNorm();  // eq. (4)
      EXPECT_LT((matrix(m.displacements) - expected).norm(), 1e-14);
      EXPECT_EQ(m.report.met, 1u);
      EXPECT_TRUE(m.report.advice.empty());
      EXPECT_NEAR(m.report.change, expected.norm(), 1e-14);
      // The map itself carries the point there.
      EXPECT_LT((dynamic_cast<const LatticeMap&>(*map.withDisplacements(m.displacements)).position(t.points[0].rest) - t.points[0].image).norm(), 1e-14);
    }
  }
}

TEST(DirectManipulation, SeveralTargetsFollowThePseudoInverseWhateverTheirNumber) {
  const LatticeMap map(bezier(3, 3, 3));  // 27 nodes
  for (const std::size_t count : {2u, 10u, 27u, 60u}) {
    const Targets t = pointTargets(cloud(3, count), 4);
    const Manipulated m = moveTargets(map, t);
    const Eigen::MatrixXd b = dense(basisAt(map, t)), expected = pseudoInverse(b) * wanted(t);
    // Near 27 targets the condition is about 1e4, and the nodes move by as much.
    EXPECT_LT((matrix(m.displacements) - expected).norm(), 1e-9 * (1 + expected.norm())) << count;
    expectPartition(m.report);
    EXPECT_EQ(m.report.solver.rank, std::min<std::size_t>(count, 27));
    if (count <= 27) {
      EXPECT_EQ(m.report.met, count);
    } else {
      EXPECT_EQ(m.report.unmet, count);
      EXPECT_NEAR(m.report.largestMiss, (b * expected - wanted(t)).rowwise().norm().maxCoeff(), 1e-10);
      EXPECT_NE(m.report.advice.find("a lattice of more nodes"), std::string::npos) << m.report.advice;
    }
  }
}

TEST(DirectManipulation, RepeatedAndContradictingTargetsAreAveraged) {
  const LatticeMap map(spline(6, 6, 6));
  Targets t = pointTargets({Vec3(0.1, 0.2, 0.3), Vec3(0.1, 0.2, 0.3)}, 5);
  t.points[0].weight = 3;
  const Manipulated m = moveTargets(map, t);
  EXPECT_EQ(m.report.solver.rank, 1u);
  EXPECT_EQ(m.report.unmet, 2u);
  // Weights enter squared: the mean is 9 to 1.
  const Vec3 mean = (9 * t.points[0].image + t.points[1].image) / 10;
  EXPECT_LT((t.points[0].image - m.report.points[0].miss - mean).norm(), 1e-14);
}

// (BS)^+ written out with every control of the paper: S sends the copies of a border control to the one that they follow.
TEST(DirectManipulation, CoincidentBordersAreThePapersS) {
  const int n = 5, controls = n + 4;
  const AxisBasis axis = AxisBasis::bspline(n, 3, Border::Coincident);
  Lattice lattice;
  lattice.axis = {axis, AxisBasis::bernstein(2), AxisBasis::bernstein(2)};
  const LatticeMap map(lattice);
  Targets t = pointTargets({Vec3(0.05, 0, 0), Vec3(0.31, 0, 0), Vec3(0.77, 0, 0)}, 6);
  Eigen::MatrixXd b = Eigen::MatrixXd::Zero(3, controls), s = Eigen::MatrixXd::Zero(controls, controls);
  std::vector<double> rest;
  for (int c = 0; c < controls; ++c) {
    const int node = std::min(std::max(c - 2, 0), n - 1);
    s(c, node + 2) = 1;
    rest.push_back(axis.restNode(node));
  }
  for (int r = 0; r < 3; ++r) {
    // The parameter by bisection; uniform cubics over knots 0, 1, 2, ...
    double low = 3, high = controls;
    const auto u = [&](double at) {
      double sum = 0;
      for (int c = 0; c < controls; ++c) sum += test::deBoor(axis.knots(), c, 3, at) * rest[static_cast<std::size_t>(c)];
      return sum;
    };
    for (int i = 0; i < 100; ++i) (u(0.5 * (low + high)) < t.points[static_cast<std::size_t>(r)].rest.x() ? low : high) = 0.5 * (low + high);
    for (int c = 0; c < controls; ++c) b(r, c) = test::deBoor(axis.knots(), c, 3, low);
  }
  const Eigen::MatrixXd change = pseudoInverse(b * s) * wanted(t);
  const Manipulated m = moveTargets(map, t);
  for (int i = 0; i < n; ++i)
    EXPECT_LT((m.displacements[static_cast<std::size_t>(i)].transpose() - change.row(i + 2)).norm(), 1e-12);
  // The copies themselves have no column: they do not move in the paper's solution, they follow.
  for (const int c : {0, 1, controls - 2, controls - 1}) EXPECT_LT(change.row(c).norm(), 1e-15);
}

TEST(DirectManipulation, CostsWeighNodes) {
  Lattice lattice = spline(5, 5, 5);
  const LatticeMap map(lattice);
  const Targets t = pointTargets(cloud(7, 12), 8);
  ManipulationOptions options;
  options.nodeCost = borderMultiplicity(lattice);
  EXPECT_EQ(options.nodeCost.at(0), 27);
  EXPECT_EQ(options.nodeCost.at(lattice.index(2, 0, 2)), 3);
  EXPECT_EQ(options.nodeCost.at(lattice.index(2, 2, 2)), 1);
  const Manipulated m = moveTargets(map, t, options);
  const Eigen::MatrixXd b = dense(basisAt(map, t));
  Eigen::VectorXd inverse(b.cols());
  for (Eigen::Index i = 0; i < b.cols(); ++i) inverse[i] = 1 / options.nodeCost[static_cast<std::size_t>(i)];
  // The least sum c |d|^2: d = C^-1 B^T (B C^-1 B^T)^-1 dq.
  const Eigen::MatrixXd scaled = inverse.asDiagonal() * b.transpose();
  EXPECT_LT((matrix(m.displacements) - scaled * (b * scaled).ldlt().solve(wanted(t))).norm(), 1e-11);
  EXPECT_EQ(m.report.met, 12u);
}

TEST(DirectManipulation, TheChangeStartsFromTheMapsOwnDisplacements) {
  const Lattice lattice = test::shaken(spline(6, 6, 6), 9, 0.1);
  const LatticeMap map(lattice);
  Targets t;
  for (const Vec3& p : cloud(10, 8)) t.points.push_back({p, map.position(p), 1});
  const Manipulated still = moveTargets(map, t);  // all met already
  EXPECT_LT((matrix(still.displacements) - matrix(lattice.displacements)).norm(), 1e-13);
  t.points[0].image += Vec3(0.1, 0, 0);
  const Manipulated m = moveTargets(map, t);
  EXPECT_EQ(m.report.met, 8u);
  // Nodes that no target reaches keep their bits.
  const SparseRows rows = basisAt(map, t);
  std::vector<bool> reached(lattice.nodeCount(), false);
  for (const Index c : rows.column) reached[c] = true;
  for (std::size_t i = 0; i < reached.size(); ++i)
    if (!reached[i]) {
      EXPECT_EQ(m.displacements[i], lattice.displacements[i]);
    }
}

TEST(DirectManipulation, PinsHold) {
  const Lattice lattice = test::shaken(spline(8, 8, 8), 11, 0.05);
  const LatticeMap map(lattice);
  Targets t = pointTargets(cloud(12, 5), 13);
  t.pinnedNodes = {lattice.index(3, 3, 3), lattice.index(4, 3, 3), 0};
  for (std::uint64_t i = 0; i < 6; ++i) t.pinnedPoints.push_back(t.points[0].rest + 0.5 * randomPoint(14, i));
  t.pinnedPoints.push_back(t.pinnedPoints[0]);  // twice is once
  const Manipulated m = moveTargets(map, t);
  EXPECT_EQ(m.report.met, 5u);
  for (const Index n : t.pinnedNodes) EXPECT_EQ(m.displacements[n], lattice.displacements[n]);
  const auto after = map.withDisplacements(m.displacements);
  for (const Vec3& p : t.pinnedPoints)
    EXPECT_LT((dynamic_cast<const LatticeMap&>(*after).position(p) - map.position(p)).norm(), 1e-13);
  EXPECT_LT(m.report.largestPinShift, 1e-13);
  // A pin wins against a target at the same place.
  Targets both = pointTargets({Vec3(0.2, 0.1, 0)}, 15);
  both.points.push_back({Vec3(-0.9, -0.9, -0.9), Vec3(-0.9, -0.9, -0.8), 1});
  both.pinnedPoints = {Vec3(0.2, 0.1, 0)};
  const Manipulated won = moveTargets(map, both);
  EXPECT_EQ(won.report.points[0].outcome, TargetOutcome::Unmet);
  EXPECT_EQ(won.report.points[1].outcome, TargetOutcome::Met);
  EXPECT_LT(won.report.largestPinShift, 1e-13);
}

TEST(DirectManipulation, EveryNodePinnedHasNoSolution) {
  const LatticeMap map(bezier(2, 2, 2));
  Targets t = pointTargets({Vec3(0, 0, 0)}, 16);
  for (Index i = 0; i < 8; ++i) t.pinnedNodes.push_back(i);
  EXPECT_THROW(moveTargets(map, t), InfeasibleError);
}

TEST(DirectManipulation, DirectionsAreRowsOfTheDerivative) {
  for (const Lattice& lattice : {test::shaken(spline(7, 6, 5), 17, 0.1), test::shaken(bezier(4, 4, 3), 18, 0.1)}) {
    const LatticeMap map(lattice);
    Targets t = pointTargets({Vec3(0.3, 0.2, 0.1), Vec3(-0.5, 0.4, 0.6)}, 19, 0.1);
    for (const Vec3& at : {Vec3(0.3, 0.2, 0.1), Vec3(-0.2, -0.7, 0.9), Vec3(2.5, 0, 0)})  // the last outside the box
      t.directions.push_back({at, Vec3(0, 0, 2), Vec3(0.5, -0.3, 1.8), 1});
    const Manipulated m = moveTargets(map, t);
    EXPECT_EQ(m.report.met, 5u);
    expectPartition(m.report);
    const auto after = map.withDisplacements(m.displacements);
    const auto& moved = dynamic_cast<const LatticeMap&>(*after);
    for (const DirectionTarget& d : t.directions) {
      EXPECT_LT((moved.jacobian(d.rest) * d.direction - d.image).norm(), 1e-11);
      const double h = 1e-5;
      const Vec3 difference = (moved.position(d.rest + h * d.direction) - moved.position(d.rest - h * d.direction)) / (2 * h);
      EXPECT_LT((difference - d.image).norm(), 1e-8);  // h^2 times third derivatives
    }
  }
}

TEST(DirectManipulation, OutsideIsSaidOnlyWhereNoNodeReaches) {
  Lattice lattice = spline(5, 5, 5);
  Targets t = pointTargets({Vec3(0, 0, 0), Vec3(30, 0, 0)}, 20);
  EXPECT_EQ(moveTargets(LatticeMap(lattice), t).report.met, 2u);  // carried along outside
  lattice.outside = Outside::Keep;
  t.directions.push_back({Vec3(0, 40, 0), Vec3(1, 0, 0), Vec3(1, 1, 0), 1});
  const ManipulationReport r = moveTargets(LatticeMap(lattice), t).report;
  EXPECT_EQ(r.met, 1u);
  EXPECT_EQ(r.outside, 2u);
  EXPECT_EQ(r.points[1].outcome, TargetOutcome::Outside);
  EXPECT_EQ(r.directions[0].outcome, TargetOutcome::Outside);
  EXPECT_NE(r.advice.find("outside the lattice"), std::string::npos);
  expectPartition(r);
}

TEST(DirectManipulation, TheIterationAgreesWithTheFactorisation) {
  const LatticeMap map(spline(12, 12, 12));
  const Targets t = pointTargets(cloud(21, 60), 22);
  ManipulationOptions iterate;
  iterate.solver.denseWork = iterate.solver.fallbackWork = 0;
  const Manipulated exact = moveTargets(map, t), close = moveTargets(map, t, iterate);
  EXPECT_EQ(close.report.solver.method, numeric::MinNormMethod::Lsqr);
  EXPECT_TRUE(close.report.solver.converged);
  EXPECT_EQ(close.report.met, 60u);
  EXPECT_LT((matrix(exact.displacements) - matrix(close.displacements)).norm(), 1e-9);
}

TEST(DirectManipulation, ScalesWithTheModel) {
  Lattice lattice = spline(6, 6, 6);
  const Targets t = pointTargets(cloud(23, 10), 24);
  const Manipulated m = moveTargets(LatticeMap(lattice), t);
  lattice.box.origin *= 4096;
  lattice.box.axes *= 4096;
  Targets large = t;
  for (PointTarget& p : large.points) p.rest *= 4096, p.image *= 4096;
  const Manipulated big = moveTargets(LatticeMap(lattice), large);
  for (std::size_t i = 0; i < m.displacements.size(); ++i) EXPECT_EQ(Vec3(4096 * m.displacements[i]), big.displacements[i]);
}

TEST(DirectManipulation, AffectedVerticesAreThoseThatTheChangedNodesCarry) {
  const Lattice lattice = spline(9, 9, 9);
  const LatticeMap map(lattice);
  std::vector<Vec3> points = cloud(25, 500);
  points.push_back(Vec3(0.5, 0.5, 0.5));
  const auto binding = map.bind(points);
  const Targets t = pointTargets({points.back()}, 26);
  const Manipulated m = moveTargets(map, t);
  const std::vector<float> share = affectedRegion(map, *binding, map.displacements(), m.displacements);
  EXPECT_EQ(share.back(), 1);  // all nodes about the target moved
  const auto after = map.withDisplacements(m.displacements);
  int untouched = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_GE(share[i], 0);
    EXPECT_LE(share[i], 1);
    if (share[i] == 0) {
      ++untouched;
      EXPECT_EQ(dynamic_cast<const LatticeMap&>(*after).position(points[i]), points[i]);
    }
  }
  EXPECT_GT(untouched, 0);
}

TEST(DirectManipulation, BadInputIsRefused) {
  const LatticeMap map(bezier(3, 3, 3));
  const double bad = std::numeric_limits<double>::quiet_NaN();
  Targets t = pointTargets({Vec3(0, 0, 0)}, 27);
  t.points[0].image.x() = bad;
  EXPECT_THROW(moveTargets(map, t), std::invalid_argument);
  t = pointTargets({Vec3(0, 0, 0)}, 27);
  t.points[0].weight = 0;
  EXPECT_THROW(moveTargets(map, t), std::invalid_argument);
  t.points[0].weight = 1;
  t.pinnedNodes = {27};
  EXPECT_THROW(moveTargets(map, t), std::invalid_argument);
  t.pinnedNodes.clear();
  t.pinnedPoints = {Vec3(bad, 0, 0)};
  EXPECT_THROW(moveTargets(map, t), std::invalid_argument);
  t.pinnedPoints.clear();
  t.directions.push_back({Vec3(0, 0, 0), Vec3::Zero(), Vec3(1, 0, 0), 1});
  EXPECT_THROW(moveTargets(map, t), std::invalid_argument);
  t.directions.clear();
  ManipulationOptions options;
  options.nodeCost = {1, 2};
  EXPECT_THROW(moveTargets(map, t, options), std::invalid_argument);
  options.nodeCost.clear();
  options.tolerance = bad;
  EXPECT_THROW(moveTargets(map, t, options), std::invalid_argument);
  EXPECT_EQ(moveTargets(map, {}).report.movedNodes, 0u);
}

}  // namespace
}  // namespace fielddeform::map
