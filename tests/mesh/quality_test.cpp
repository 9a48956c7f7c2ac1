#include <fielddeform/core/random.h>
#include <fielddeform/core/rigid.h>
#include <fielddeform/mesh/quality.h>
#include <gtest/gtest.h>
#include <tests/support/shapes.h>

#include <limits>

namespace fielddeform::mesh {
namespace {

using namespace fielddeform::test;
const Rigid kMotion{Quat(0.5, 0.1, -0.7, 0.5).normalized(), {3, -2, 5}};

/// Folds the part x > 0.5 of the grid back over the rest by an angle about the line x = 0.5.
std::vector<Vec3> foldedGrid(const Mesh& m, double angle) {
  return moved(m, [&](const Vec3& p) {
    const double x = p.x() - 0.5;
    return x <= 0 ? p : Vec3(0.5 + x * std::cos(angle), p.y(), x * std::sin(angle));
  });
}

TEST(Folds, AreCountedPerEdgeOfTheCrease) {
  const Mesh m = grid(8);
  EXPECT_EQ(countFolds(m, m.positions(), foldedGrid(m, 0.9 * std::numbers::pi)), 8u);
  EXPECT_EQ(countFolds(m, m.positions(), foldedGrid(m, 0.5 * std::numbers::pi)), 0u) << "a crease is not a fold";
  EXPECT_EQ(countSharpEdges(m, foldedGrid(m, 0.9 * std::numbers::pi)), 8u);
  // What was folded in rest is no fold of the deformation.
  const auto rest = foldedGrid(m, 0.9 * std::numbers::pi);
  EXPECT_EQ(countFolds(m, rest, moved(Mesh(rest, m.corners()), kMotion)), 0u);
}

TEST(Folds, AreFoundWithoutLookingAtEveryEdge) {
  // countFolds skips what is certainly smooth, compareQuality does not. Smooth where x < 0.4, torn beyond; some faces turned.
  const Mesh m = grid(20);
  std::vector<Index> corners = m.corners();
  for (std::size_t t = 0; t < corners.size() / 3; t += 17) std::swap(corners[3 * t], corners[3 * t + 1]);
  corners.insert(corners.end(), {0, 1, 30, 0, 1, 31});  // an edge of more than two triangles
  const Mesh mixed(m.positions(), corners);
  for (const double noise : {0.0, 0.02, 0.05, 0.2}) {
    std::uint64_t k = 0;
    const auto posed = moved(m, [&](const Vec3& p) {
      const double much = p.x() < 0.4 ? 0.01 * noise : noise;
      const auto random = [&] { return much * (uniform01(7, k++) - 0.5); };
      return Vec3(p.x() + random(), p.y() + random(), p.z() + random());
    });
    const std::size_t folds = compareQuality(mixed, mixed.positions(), posed).folds;
    EXPECT_EQ(countFolds(mixed, mixed.positions(), posed), folds) << noise;
    if (noise > 0.1) {
      EXPECT_GT(folds, 10u);
    }
  }
}

TEST(Folds, OfAQuadAcrossItsDiagonalAreSeen) {
  const Mesh quad({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {0, 1, 2, 3}, {0, 4});
  auto posed = quad.positions();
  posed[3] = {1, 0.1, 0.1};
  EXPECT_EQ(countFolds(quad, quad.positions(), posed), 1u);
}

TEST(Folds, DoNotDependOnTheNeighboursOrientation) {
  const Mesh m = grid(8);
  std::vector<Index> corners = m.corners();
  for (std::size_t t = 0; t < corners.size() / 3; t += 2) std::swap(corners[3 * t], corners[3 * t + 1]);
  const Mesh mixed(m.positions(), corners);
  EXPECT_EQ(countFolds(mixed, m.positions(), foldedGrid(m, 0.9 * std::numbers::pi)), 8u);
}

TEST(Folds, AreFoundWhereTheTwoSidesAreTurnedAgainstEachOther) {
  // Folded shut along the very seam, all normals point the same way.
  const Mesh m = grid(8);
  std::vector<Index> corners = m.corners();
  for (std::size_t t = 0; t < corners.size(); t += 3) {
    const double x = (m.positions()[corners[t]] + m.positions()[corners[t + 1]] + m.positions()[corners[t + 2]]).x() / 3;
    if (x > 0.5) std::swap(corners[t], corners[t + 1]);
  }
  const Mesh seamed(m.positions(), corners);
  const auto shut = foldedGrid(m, std::numbers::pi);
  ASSERT_EQ(compareQuality(seamed, m.positions(), shut).folds, 8u);
  EXPECT_EQ(countFolds(seamed, m.positions(), shut), 8u);
}

TEST(Folds, AreTheSameFromKnownEdges) {
  const Mesh m = grid(8);
  const EdgeTable edges(m);
  const auto folded = foldedGrid(m, 0.9 * std::numbers::pi);
  EXPECT_EQ(countFolds(m, edges, m.positions(), folded), 8u);
  EXPECT_EQ(countSharpEdges(m, edges, folded), 8u);
  EXPECT_EQ(countSharpEdges(m, edges, m.positions()), 0u);
  const Mesh quad({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {0, 1, 2, 3}, {0, 4});
  auto posed = quad.positions();
  posed[3] = {1, 0.1, 0.1};
  EXPECT_EQ(countFolds(quad, EdgeTable(quad), quad.positions(), posed), 1u) << "across the diagonal, which is none of the edges";
  EXPECT_THROW(countFolds(m, edges, m.positions(), posed), std::invalid_argument);
}

TEST(Folds, CosinesNearTheBoundAreDecidedExactly) {
  // Two triangles about the y axis: the cosine is that of the angle between them.
  const Mesh m({{0, 0, 0}, {0, 1, 0}, {1, 0.5, 0}, {-1, 0.5, 0}}, {0, 2, 1, 0, 1, 3});
  const double bound = std::acos(kFoldTo);
  for (const double off : {1e-12, 1e-9, 1e-7, 1e-5, 1e-3})
    for (const double sign : {-1.0, 1.0}) {
      auto posed = m.positions();
      const double angle = bound + sign * off;
      posed[3] = {-std::cos(angle), 0.5, std::sin(angle)};
      EXPECT_EQ(compareQuality(m, m.positions(), posed).folds, sign > 0 ? 1u : 0u) << off;
      EXPECT_EQ(countSharpEdges(m, posed), sign > 0 ? 1u : 0u) << off;
    }
}

TEST(Folds, LeaveDegenerateAndNonFiniteTrianglesAside) {
  const Mesh m = grid(2);
  auto posed = foldedGrid(m, 3.0);
  for (Vec3& p : posed) p.y() = 0;
  EXPECT_EQ(countFolds(m, m.positions(), posed), 0u);
  const QualityReport q = compareQuality(m, m.positions(), posed);
  EXPECT_EQ(q.collapsed, m.faceCount());
  EXPECT_EQ(q.degenerateRest, 0u);
  posed = foldedGrid(m, 3.0);
  posed[0].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(compareQuality(m, m.positions(), posed).folds, 1u);
  EXPECT_EQ(countFolds(m, m.positions(), posed), 1u) << "of two, one has a triangle with the vertex";
}

TEST(Quality, RigidMotionChangesNothing) {
  const Mesh m = sphere(20, 10);
  const QualityReport q = compareQuality(m, m.positions(), moved(m, kMotion));
  EXPECT_EQ(q.folds + q.sharpPosed + q.sharpRest + q.collapsed, 0u);
  EXPECT_NEAR(q.minAnglePosed, q.minAngleRest, 1e-13);
  EXPECT_NEAR(q.stretch.max, 1, 1e-13);  // coordinates of 6 hold 4e-16, edges are 0.1 long
  EXPECT_NEAR(q.stretch.min, 1, 1e-13);
  EXPECT_EQ(q.stretch.edges + q.stretch.unmeasured, EdgeTable(m).size());
}

TEST(Quality, SmallestAngleOfKnownTriangles) {
  const Mesh equilateral({{0, 0, 0}, {1, 0, 0}, {0.5, std::sqrt(0.75), 0}}, {0, 1, 2});
  EXPECT_NEAR(smallestAngle(equilateral, equilateral.positions()), std::numbers::pi / 3, 1e-15);
  const Mesh sliver({{0, 0, 0}, {1, 0, 0}, {1, 1e-9, 0}}, {0, 1, 2});
  EXPECT_NEAR(smallestAngle(sliver, sliver.positions()) / 1e-9, 1, 1e-12) << "no cancellation in small angles";
  EXPECT_EQ(smallestAngle(Mesh{}, {}), 0);
}

TEST(Stretch, PercentileIsTheSmallestRatioThat99PercentDoNotExceed) {
  // A strip of 200 separate triangles; one edge each is stretched by 1 + t / 1000.
  std::vector<Vec3> rest, posed;
  std::vector<Index> c;
  for (Index t = 0; t < 200; ++t) {
    for (const Vec3& p : {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 0, 0)}) {
      rest.push_back(p + Vec3(0, 10.0 * t, 0));
      posed.push_back((1 + t / 1000.0) * p + Vec3(0, 10.0 * t, 0));
      c.push_back(static_cast<Index>(c.size()));
    }
  }
  const Mesh m(rest, c);
  const StretchReport s = edgeStretch(EdgeTable(m), rest, posed);
  EXPECT_EQ(s.unmeasured, 200u) << "one edge of each triangle has no length at rest";
  EXPECT_EQ(s.edges, 400u);
  EXPECT_NEAR(s.max, 1.199, 1e-12);
  EXPECT_NEAR(s.p99, 1 + 197 / 1000.0, 1e-12) << "396 of 400 do not exceed it";
}

TEST(Flipped, RigidAndAffineMapsFlipNothing) {
  const Mesh m = sphere(20, 10);
  const std::vector<Mat3> turned(m.vertexCount(), kMotion.rotation.toRotationMatrix());
  EXPECT_EQ(countFlipped(m, m.positions(), moved(m, kMotion), turned), 0u);
  EXPECT_EQ(countFlipped(m, m.positions(), moved(m, kMotion)), 0u);
  Mat3 shear;
  shear << 1, 5, 0, 0, 1, 0, 0.2, 0, 0.1;
  const auto sheared = moved(m, [&](const Vec3& p) { return Vec3(shear * p); });
  EXPECT_EQ(countFlipped(m, m.positions(), sheared, std::vector<Mat3>(m.vertexCount(), shear)), 0u);
}

TEST(Flipped, FindsTrianglesTurnedOverByAStrayVertex) {
  const Mesh m = grid(8);
  auto posed = moved(m, kMotion);
  posed[40] = kMotion(m.positions()[40] + Vec3(0.2, 0.01, 0));  // the middle vertex, beyond its neighbours
  const Mat3 r = kMotion.rotation.toRotationMatrix();
  std::size_t expected = 0;
  for (std::size_t f = 0; f < m.faceCount(); ++f) {
    const auto t = m.face(f);
    const Vec3 n = (posed[t[1]] - posed[t[0]]).cross(posed[t[2]] - posed[t[0]]);
    expected += n.dot(r * Vec3::UnitZ()) < 0;
  }
  ASSERT_GT(expected, 0u);
  EXPECT_EQ(countFlipped(m, m.positions(), posed, std::vector<Mat3>(m.vertexCount(), r)), expected);
  EXPECT_EQ(countFlipped(m, m.positions(), posed), expected);
}

TEST(Flipped, AMapThatTurnsSpaceInsideOutFlipsEverything) {
  const Mesh m = sphere(8, 4);
  const auto inside = moved(m, [](const Vec3& p) { return Vec3(-p); });
  const std::size_t triangles = m.triangles().size() / 3;
  EXPECT_EQ(countFlipped(m, m.positions(), inside, std::vector<Mat3>(m.vertexCount(), -Mat3::Identity())), triangles);
}

}  // namespace
}  // namespace fielddeform::mesh
