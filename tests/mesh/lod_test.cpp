#include <fielddeform/core/random.h>
#include <fielddeform/core/rigid.h>
#include <fielddeform/mesh/lod.h>
#include <fielddeform/mesh/measures.h>
#include <fielddeform/mesh/quality.h>
#include <gtest/gtest.h>
#include <tests/support/shapes.h>

#include <limits>
#include <set>

namespace fielddeform::mesh {
namespace {

using namespace fielddeform::test;

void expectOnTheObject(const Mesh& object, const Lod& lod) {
  ASSERT_EQ(lod.vertexOf.size(), lod.mesh.vertexCount());
  for (std::size_t v = 0; v < lod.vertexOf.size(); ++v)
    ASSERT_EQ(lod.mesh.positions()[v], object.positions()[lod.vertexOf[v]]);
}

TEST(Lod, OfASphereIsClosedOnItAndOfTheAskedSize) {
  const Mesh m = sphere(64, 32);
  for (const std::size_t faces : {1000u, 200u, 50u}) {
    const Lod lod = simplify(m, faces);
    expectOnTheObject(m, lod);
    EXPECT_LE(lod.mesh.faceCount(), faces);
    EXPECT_GE(lod.mesh.faceCount(), faces - 2) << "each collapse takes two faces";
    EXPECT_TRUE(lod.message.empty()) << lod.message;
    const MaybeVolume v = volume(lod.mesh, lod.mesh.positions());
    ASSERT_TRUE(v.value.has_value()) << v.reason;
    // An inscribed polyhedron of n like facets lacks about 8.4 / n of the ball; vertices may not be placed freely here.
    EXPECT_GT(*v.value, 4 * std::numbers::pi / 3 * (1 - 2 * 8.4 / static_cast<double>(faces)));
    EXPECT_EQ(countSharpEdges(lod.mesh, lod.mesh.positions()), 0u);
  }
}

TEST(Lod, KeepsAFlatRim) {
  const Mesh m = grid(20, 4);
  const Lod lod = simplify(m, 20);
  expectOnTheObject(m, lod);
  EXPECT_NEAR(area(lod.mesh, lod.mesh.positions()), 1, 1e-12) << "flat: nothing is lost";
  EXPECT_EQ(boundaryLoops(EdgeTable(lod.mesh)).size(), 1u);
}

TEST(Lod, OfAMeshThatIsSmallEnoughIsTheMesh) {
  const Lod lod = simplify(quadCube(), 12);
  EXPECT_EQ(lod.mesh.faceCount(), 12u);
  EXPECT_EQ(lod.mesh.vertexCount(), 8u);
  EXPECT_EQ(*volume(lod.mesh, lod.mesh.positions()).value, 1);
}

TEST(Lod, NonManifoldPlacesAreCutAndSaid) {
  for (const int pages : {3, 4}) {
    const Mesh m = book(pages);
    const Lod lod = simplify(m, 100);
    expectOnTheObject(m, lod);
    EXPECT_EQ(lod.mesh.faceCount(), static_cast<std::size_t>(pages));
    EXPECT_EQ(lod.cutVertices, 2u * (static_cast<std::size_t>(pages) - 1));
    EXPECT_NE(lod.message.find("non-manifold"), std::string::npos);
    EXPECT_EQ(countEdges(EdgeTable(lod.mesh)).nonManifold, 0u);
  }
  // Cubes that touch in a point come apart and stay closed.
  const Mesh two = together(cube(), cube());
  std::vector<Index> corners = two.corners();
  for (Index& v : corners)
    if (v == 8) v = 7;
  const Lod lod = simplify(Mesh(two.positions(), corners), 24);
  EXPECT_EQ(lod.cutVertices, 1u);
  EXPECT_TRUE(countEdges(EdgeTable(lod.mesh)).closed());
}

TEST(Lod, SurfacesThatNoHalfedgesCanHoldComeThroughInParts) {
  std::vector<Vec3> p;
  std::vector<Index> corners;
  for (std::uint64_t i = 0; i < 20; ++i) p.emplace_back(uniform01(1, 3 * i), uniform01(1, 3 * i + 1), uniform01(1, 3 * i + 2));
  for (std::uint64_t i = 0; i < 600; ++i) corners.push_back(static_cast<Index>(splitmix64(2, i) % 20));
  p[3].x() = std::numeric_limits<double>::quiet_NaN();
  const Mesh soup(p, corners);
  const Lod lod = simplify(soup, 1000);
  EXPECT_EQ(lod.mesh.faceCount() + lod.skippedFaces, 200u);
  expectOnTheObject(soup, lod);
  simplify(soup, 3);
  EXPECT_EQ(simplify(Mesh{}, 5).mesh.faceCount(), 0u);
  EXPECT_THROW(simplify(cube(), 0), std::invalid_argument);
}

TEST(Lod, TurnedFacesAreCutOff) {
  std::vector<Index> corners = cube().corners();
  std::swap(corners[0], corners[1]);
  const Lod lod = simplify(Mesh(cubeCorners(), corners), 12);
  EXPECT_EQ(lod.mesh.faceCount(), 12u);
  EXPECT_GT(lod.cutVertices, 0u);
}

TEST(Lod, ChoosesTheSameVerticesAtAnyScale) {
  Mesh m = sphere(40, 20);
  const Lod here = simplify(m, 100);
  for (const double scale : {1024.0, 0x1p-200, 0x1p200}) {
    Mesh scaled = m;
    for (Vec3& p : scaled.mutablePositions()) p *= scale;
    const Lod there = simplify(scaled, 100);
    EXPECT_EQ(here.vertexOf, there.vertexOf);
    EXPECT_EQ(here.mesh.corners(), there.mesh.corners());
  }
}

}  // namespace
}  // namespace fielddeform::mesh
