#include <fielddeform/map/direct_manipulation.h>
#include <fielddeform/map/extended_lattice.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "classic.h"

namespace fielddeform::map {
namespace {

using namespace test;

ExtendedLattice box() { return boxLattice({Vec3(-1, -1, -1), Vec3(2, 2, 2).asDiagonal()}, {2, 1, 2}); }
ExtendedLattice tube() {
  return cylinderLattice({.origin = Vec3(0, 0, -1), .axis = Vec3(0, 0, 2), .inner = 0.3, .outer = 1, .cells = {1, 8, 2}});
}

std::vector<Vec3> randomMoves(std::size_t n, double size) {
  std::vector<Vec3> d;
  for (std::size_t i = 0; i < n; ++i) d.push_back(randomPoint(11, i, size));
  return d;
}

// Points inside the tube, a little away from the faces of its cells.
std::vector<Vec3> inTheTube() {
  std::vector<Vec3> out;
  for (const Vec3& x : cloud(5, 400))
    if (const double r = x.head<2>().norm(); r > 0.32 && r < 0.97 && std::abs(x.z()) > 1e-3) out.push_back(x);
  return out;
}

TEST(ExtendedLattice, NoDisplacementIsTheIdentityBitForBit) {
  expectIdentity(ExtendedLatticeMap(box()));
  expectIdentity(ExtendedLatticeMap(tube()));
}

TEST(ExtendedLattice, PointsAreFoundInTheirCellsAndNowhereElse) {
  const ExtendedLatticeMap map(tube());
  for (const Vec3& x : cloud(3, 300, 1.3)) {
    const double r = x.head<2>().norm();
    const bool inside = r > 0.3 && r < 1 && std::abs(x.z()) < 1;
    if (std::abs(r - 0.3) < 1e-4 || std::abs(r - 1) < 1e-4) continue;  // cubics, not circles
    EXPECT_EQ(map.locate(x).cell != kNoIndex, inside) << x.transpose();
  }
}

TEST(ExtendedLattice, AffineMotionsOfTheNodesAreExact) {
  Mat3 m;
  m << 1.2, 0.1, 0, 0.3, 0.8, -0.2, 0, 0.4, 1.1;
  for (ExtendedLattice lattice : {box(), tube()}) {
    for (const Vec3& p : lattice.nodes) lattice.displacements.push_back(m * p + Vec3(1, 2, 3) - p);
    const ExtendedLatticeMap map(lattice);
    for (const Vec3& x : inTheTube()) {
      EXPECT_LT((image(map, x) - (m * x + Vec3(1, 2, 3))).norm(), 1e-11);
    }
  }
}

TEST(ExtendedLattice, JacobiansAgreeWithCentralDifferences) {
  ExtendedLattice lattice = tube();
  lattice.displacements = randomMoves(lattice.nodes.size(), 0.05);
  std::vector<Vec3> points = inTheTube();
  points.resize(40);
  expectJacobians(ExtendedLatticeMap(lattice), points, 1e-6);
}

TEST(ExtendedLattice, SharedNodesJoinTheCellsWithoutAGap) {
  ExtendedLattice lattice = box();
  lattice.displacements = randomMoves(lattice.nodes.size(), 0.2);
  const ExtendedLatticeMap map(lattice);
  for (const Vec3& p : cloud(6, 50, 0.9)) {
    const Vec3 a(-1e-12, p.y(), p.z()), b(1e-12, p.y(), p.z());
    EXPECT_LT((image(map, a) - image(map, b)).norm(), 1e-10);
  }
}

TEST(ExtendedLattice, JoinedSmoothlyTheWholeMapIsC1) {
  for (ExtendedLattice lattice : {box(), tube()}) {
    EXPECT_FALSE(jointsOf(lattice).empty());
    lattice.displacements = randomMoves(lattice.nodes.size(), 0.1);
    const auto jump = [&](const ExtendedLattice& l) {
      const ExtendedLatticeMap map(l);
      double worst = 0;
      for (const Vec3& p : inTheTube()) {
        std::vector<Mat3> j(2);
        const std::vector<Vec3> sides{Vec3(p.x(), p.y(), 1e-9), Vec3(p.x(), p.y(), -1e-9)};
        map.jacobians(*map.bind(sides), j);
        worst = std::max(worst, (j[0] - j[1]).norm());
      }
      return worst;
    };
    EXPECT_GT(jump(lattice), 0.1);
    double residual = 1;
    const std::vector<Vec3> before = lattice.displacements;
    lattice.displacements = joinSmoothly(lattice, {}, &residual);
    EXPECT_LT(residual, 1e-12);
    EXPECT_LT(jump(lattice), 1e-6);  // 2e-9 apart, and second derivatives up to a hundred
    // The least change is across the joints' own directions: doing it again changes nothing.
    const std::vector<Vec3> again = joinSmoothly(lattice);
    double change = 0;
    for (std::size_t i = 0; i < again.size(); ++i) change = std::max(change, (again[i] - lattice.displacements[i]).norm());
    EXPECT_LT(change, 1e-12);
  }
}

TEST(ExtendedLattice, CellsOfDifferentLengthsJoinSmoothlyToo) {
  ExtendedLattice lattice = box();
  for (Vec3& p : lattice.nodes)
    if (p.x() > 0) p.x() *= 2;
  for (const Joint& joint : jointsOf(lattice)) {
    const bool across = std::abs(lattice.nodes[joint.face].x() - lattice.nodes[joint.in].x()) > 0.1;
    EXPECT_NEAR(joint.ratio, across ? 2 : 1, 1e-12);
  }
  lattice.displacements = randomMoves(lattice.nodes.size(), 0.1);
  lattice.displacements = joinSmoothly(lattice);
  const ExtendedLatticeMap map(lattice);
  for (const Vec3& p : cloud(6, 50, 0.9)) {
    std::vector<Mat3> j(2);
    const std::vector<Vec3> sides{Vec3(1e-9, p.y(), p.z()), Vec3(-1e-9, p.y(), p.z())};
    map.jacobians(*map.bind(sides), j);
    EXPECT_LT((j[0] - j[1]).norm(), 1e-6);
  }
}

TEST(ExtendedLattice, PinnedNodesKeepTheirDisplacement) {
  ExtendedLattice lattice = box();
  lattice.displacements = randomMoves(lattice.nodes.size(), 0.1);
  const std::vector<Index> pinned{0, 7, 20, 33};
  const std::vector<Vec3> joined = joinSmoothly(lattice, pinned);
  for (const Index n : pinned) EXPECT_EQ(joined[n], lattice.displacements[n]);
}

TEST(ExtendedLattice, PointsMoveByDirectManipulation) {
  const ExtendedLatticeMap map(tube());
  Targets targets;
  targets.points.push_back({Vec3(0.6, 0.1, 0.2), Vec3(0.8, 0.2, 0.2)});
  targets.points.push_back({Vec3(-0.5, 0.3, -0.4), Vec3(-0.5, 0.3, -0.4)});
  const Manipulated moved = moveTargets(map, targets);
  EXPECT_EQ(moved.report.met, 2u);
  const auto after = map.withDisplacements(moved.displacements);
  EXPECT_LT((image(*after, Vec3(0.6, 0.1, 0.2)) - Vec3(0.8, 0.2, 0.2)).norm(), 1e-9);
}

TEST(ExtendedLattice, GatherIsTheTransposeOfCombine) {
  const ExtendedLatticeMap map(tube());
  const std::vector<Vec3> points = inTheTube(), nodes = randomMoves(map.nodeCount(), 1);
  const auto binding = map.bind(points);
  std::vector<Vec3> combined(points.size()), gathered(map.nodeCount()), values = cloud(9, points.size());
  map.combine(*binding, nodes, combined);
  map.gather(*binding, values, gathered);
  double a = 0, b = 0;
  for (std::size_t i = 0; i < points.size(); ++i) a += combined[i].dot(values[i]);
  for (std::size_t i = 0; i < nodes.size(); ++i) b += gathered[i].dot(nodes[i]);
  EXPECT_NEAR(a, b, 1e-11 * std::abs(a));
  const SparseRows rows = map.basis(*binding);
  double sum = 0;
  for (std::size_t k = rows.start[0]; k < rows.start[1]; ++k) sum += rows.value[k];
  EXPECT_NEAR(sum, 1, 1e-14);
}

TEST(ExtendedLattice, RefusesWhatIsNoLattice) {
  EXPECT_THROW(ExtendedLatticeMap(ExtendedLattice{}), std::invalid_argument);
  ExtendedLattice broken = box();
  broken.cells[0][5] = 100000;
  EXPECT_THROW(ExtendedLatticeMap{broken}, std::invalid_argument);
  broken = box();
  broken.nodes[3].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(ExtendedLatticeMap{broken}, std::invalid_argument);
  EXPECT_THROW(boxLattice({}, {0, 1, 1}), std::invalid_argument);
  EXPECT_THROW(cylinderLattice({.cells = {1, 2, 1}}), std::invalid_argument);
  EXPECT_THROW(cylinderLattice({.inner = 2}), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::map
