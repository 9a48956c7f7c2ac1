#include <fielddeform/mesh/topology.h>
#include <gtest/gtest.h>
#include <tests/support/shapes.h>

#include <algorithm>
#include <limits>
#include <map>
#include <set>

namespace fielddeform::mesh {
namespace {

using namespace fielddeform::test;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// Edges by brute force: (low, high) -> corners.
std::map<std::array<Index, 2>, std::vector<Index>> bruteEdges(const Mesh& m) {
  std::map<std::array<Index, 2>, std::vector<Index>> edges;
  for (std::size_t f = 0; f < m.faceCount(); ++f) {
    const auto face = m.face(f);
    if (face.size() < 3) continue;
    for (std::size_t k = 0; k < face.size(); ++k) {
      const Index a = face[k], b = face[(k + 1) % face.size()];
      if (a != b) edges[{std::min(a, b), std::max(a, b)}].push_back(static_cast<Index>(m.faceBegin(f) + k));
    }
  }
  return edges;
}

TEST(EdgeTable, AgreesWithBruteForceOnMixedAndDegenerateFaces) {
  std::vector<Index> corners{0, 1, 2, 2, 1, 3, 4, 0, 0, 5, 1, 0, 1, 2, 7, 6, 6, 6, 5};
  const Mesh m(std::vector<Vec3>(8, Vec3::Zero()), corners, {0, 3, 7, 10, 13, 15, 18, 19});
  const EdgeTable table(m);
  const auto brute = bruteEdges(m);
  ASSERT_EQ(table.size(), brute.size());
  std::size_t e = 0;
  for (const auto& [ends, uses] : brute) {
    EXPECT_EQ(table.vertices(e), ends);
    EXPECT_TRUE(std::ranges::equal(table.uses(e), uses));
    EXPECT_EQ(table.find(ends[1], ends[0]), e);
    for (const Index c : uses) {
      EXPECT_EQ(table.ofCorner(c), e);
      EXPECT_EQ(table.isForward(c), corners[c] == ends[0]);
    }
    ++e;
  }
  EXPECT_EQ(table.find(0, 7), kNoIndex);
  EXPECT_EQ(table.find(3, 3), kNoIndex);
  EXPECT_EQ(table.find(100, 3), kNoIndex);
  EXPECT_EQ(table.ofCorner(7), kNoIndex) << "a vertex to itself";
  EXPECT_EQ(table.faceOf(6), 1u);
}

TEST(EdgeTable, OfNothingIsEmpty) {
  EXPECT_EQ(EdgeTable(Mesh{}).size(), 0u);
  EXPECT_EQ(EdgeTable(Mesh(std::vector<Vec3>(3), {})).size(), 0u);
  EXPECT_FALSE(countEdges(EdgeTable(Mesh{})).closed());
  EXPECT_TRUE(boundaryLoops(EdgeTable(Mesh{})).empty());
}

TEST(Topology, ClosedSurfacesHaveNoBoundary) {
  for (const Mesh& m : {cube(), quadCube(), sphere(12, 7)}) {
    const EdgeTable table(m);
    const EdgeCounts n = countEdges(table);
    EXPECT_TRUE(n.closed());
    EXPECT_TRUE(n.oriented());
    EXPECT_EQ(m.vertexCount() + m.faceCount(), n.edges + 2) << "Euler";
    EXPECT_TRUE(boundaryLoops(table).empty());
    EXPECT_TRUE(nonManifoldVertices(m, table).empty());
    EXPECT_EQ(components(table, m.faceCount()).count(), 1u);
  }
}

TEST(Topology, GridHasOneLoopOfItsRim) {
  const auto loops = boundaryLoops(EdgeTable(grid(5)));
  ASSERT_EQ(loops.size(), 1u);
  EXPECT_EQ(loops[0].size(), 20u);
  EXPECT_EQ(std::set<Index>(loops[0].begin(), loops[0].end()).size(), 20u);
}

TEST(Topology, HolesThatTouchInAVertexAreTwoLoops) {
  // A 4 by 4 grid of quads without the two inner squares that meet at the middle vertex.
  const Mesh all = grid(4, 4);
  std::vector<Index> corners, offsets{0};
  for (std::size_t f = 0; f < all.faceCount(); ++f) {
    if (f == 5 || f == 10) continue;
    corners.insert(corners.end(), all.face(f).begin(), all.face(f).end());
    offsets.push_back(static_cast<Index>(corners.size()));
  }
  const Mesh m(all.positions(), corners, offsets);
  const EdgeTable table(m);
  const auto loops = boundaryLoops(table);
  ASSERT_EQ(loops.size(), 3u);
  std::multiset<std::size_t> lengths;
  for (const auto& l : loops) lengths.insert(l.size());
  EXPECT_EQ(lengths, (std::multiset<std::size_t>{4, 4, 16}));
  EXPECT_EQ(nonManifoldVertices(m, table), std::vector<Index>{12});
}

TEST(Topology, BookIsNonManifoldAndItsOddEdgesFormLoops) {
  const EdgeTable three{book(3)};
  const EdgeCounts n = countEdges(three);
  EXPECT_EQ(n.nonManifold, 1u);
  EXPECT_EQ(n.boundary, 6u);
  EXPECT_EQ(n.open, 7u) << "three uses are odd";
  EXPECT_EQ(n.inconsistent, 1u) << "all three pages run the same way";
  EXPECT_EQ(boundaryLoops(three).size(), 2u);
  EXPECT_EQ(boundaryLoops(EdgeTable(book(4))).size(), 2u) << "four pages leave two loops of four edges";
}

TEST(Topology, OneTurnedFaceIsInconsistentAlongItsEdges) {
  Mesh m = cube();
  std::vector<Index> corners = m.corners();
  std::swap(corners[0], corners[1]);
  const EdgeCounts n = countEdges(EdgeTable(Mesh(m.positions(), corners)));
  EXPECT_TRUE(n.closed());
  EXPECT_EQ(n.inconsistent, 3u);
}

TEST(Topology, ComponentsAreNumberedByTheirFirstFaceAndCountTheirOwnEdges) {
  const Mesh m = together(together(grid(2), cube()), grid(1));
  const Components c = components(EdgeTable(m), m.faceCount());
  ASSERT_EQ(c.count(), 3u);
  EXPECT_EQ(c.ofFace.front(), 0u);
  EXPECT_EQ(c.ofFace[8], 1u);
  EXPECT_EQ(c.ofFace.back(), 2u);
  EXPECT_EQ(c.edges[0].boundary, 8u);
  EXPECT_TRUE(c.edges[1].closed());
  EXPECT_EQ(c.edges[2].edges, 5u);
}

TEST(Topology, CubesThatTouchInAPointHaveANonManifoldVertex) {
  Mesh m = together(cube(), cube());
  std::vector<Index> corners = m.corners();
  for (Index& v : corners)
    if (v == 8) v = 7;
  const Mesh joined(m.positions(), corners);
  const EdgeTable table(joined);
  EXPECT_EQ(nonManifoldVertices(joined, table), std::vector<Index>{7});
  EXPECT_EQ(isolatedVertices(joined), std::vector<Index>{8});
  EXPECT_EQ(components(table, joined.faceCount()).count(), 2u);
}

TEST(Defects, AreFoundAndNamed) {
  const std::vector<Vec3> p{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0.5, 0, 0}, {-0.0, 0, 0}, {kNan, 0, 0}, {kNan, 0, 0}, {1, 0, 0}};
  const Mesh m(p, {0, 1, 2, 0, 0, 1, 0, 1, 3, 2, 0, 1, 2, 1, 0, 5, 1, 2, 0, 1, 0, 3, 1, 2},
               {0, 3, 6, 9, 12, 15, 18, 20, 24});
  EXPECT_EQ(degenerateFaces(m, m.positions()), (std::vector<Index>{1, 2, 6}));
  EXPECT_EQ(duplicateFaces(m), (std::vector<Index>{3, 4}));
  EXPECT_EQ(duplicatePoints(p), (std::vector<Index>{4, 7})) << "-0 is 0; NaN equals nothing";
  EXPECT_EQ(isolatedVertices(m), (std::vector<Index>{4, 6, 7}));
}

TEST(Defects, DegenerateIsRelativeToTheFacesOwnSize) {
  for (const double scale : {1e-30, 1.0, 1e30}) {
    const Mesh thin({{0, 0, 0}, {scale, 0, 0}, {scale, 1e-9 * scale, 0}}, {0, 1, 2});
    EXPECT_TRUE(degenerateFaces(thin, thin.positions()).empty()) << scale;
    const Mesh flat({{0, 0, 0}, {scale, 0, 0}, {scale, 1e-13 * scale, 0}}, {0, 1, 2});
    EXPECT_EQ(degenerateFaces(flat, flat.positions()).size(), 1u) << scale;
  }
}

}  // namespace
}  // namespace fielddeform::mesh
