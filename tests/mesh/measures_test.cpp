#include <fielddeform/core/parallel.h>
#include <fielddeform/core/random.h>
#include <fielddeform/core/rigid.h>
#include <fielddeform/mesh/summary.h>
#include <gtest/gtest.h>
#include <tests/support/shapes.h>

#include <bit>
#include <limits>

namespace fielddeform::mesh {
namespace {

using namespace fielddeform::test;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
const Rigid kMotion{Quat(0.5, 0.1, -0.7, 0.5).normalized(), {3, -2, 5}};

TEST(Volume, OfTheCubeIsExactAndPositiveOutward) {
  EXPECT_EQ(volume(cube(), cube().positions()).value, 1.0);
  EXPECT_EQ(volume(quadCube(), quadCube().positions()).value, 1.0);
  const auto mirrored = moved(cube(), [](const Vec3& p) { return Vec3(-p.x(), p.y(), p.z()); });
  EXPECT_EQ(volume(cube(), mirrored).value, -1.0) << "inside out is negative";
}

TEST(Volume, ConvergesToTheSphereWithTheSquareOfTheStep) {
  const auto error = [](int n) {
    const Mesh m = sphere(2 * n, n);
    return 4 * std::numbers::pi / 3 - volume(m, m.positions()).value.value();
  };
  EXPECT_NEAR(error(20) / error(40), 4, 0.1);
}

TEST(Volume, IsInvariantUnderRigidMotionFarFromTheOrigin) {
  const Mesh m = sphere(60, 30);
  const double here = *volume(m, m.positions()).value;
  const auto there = moved(m, [](const Vec3& p) { return Vec3(kMotion(p) + Vec3(1e4, -2e4, 3e4)); });
  // Coordinates of 3e4 hold 4e-12; uncentred sums would lose 1e-3.
  EXPECT_NEAR(*volume(m, there).value, here, 1e-11);
}

TEST(Volume, DoesNotExistForOpenOrInconsistentSurfacesAndSaysWhy) {
  const MaybeVolume open = volume(grid(3), grid(3).positions());
  EXPECT_FALSE(open.value);
  EXPECT_EQ(open.reason, "12 boundary edges");
  std::vector<Index> corners = cube().corners();
  std::swap(corners[0], corners[1]);
  EXPECT_EQ(volume(Mesh(cubeCorners(), corners), cubeCorners()).reason, "3 inconsistently oriented edges");
  corners = cube().corners();
  corners.insert(corners.end(), corners.begin(), corners.begin() + 3);
  EXPECT_EQ(volume(Mesh(cubeCorners(), corners), cubeCorners()).reason, "3 open non-manifold edges");
  EXPECT_EQ(volume(Mesh{}, {}).reason, "no faces");
  auto p = cubeCorners();
  p[3].y() = kNan;
  EXPECT_EQ(volume(cube(), p).reason, "4 faces with non-finite coordinates");
}

TEST(Volume, ExistsForClosedNonManifoldSurfaces) {
  // Two cubes that share an edge: its four uses cancel, so the volume is theirs.
  Mesh m = together(cube(), Mesh(moved(cube(), [](const Vec3& p) { return Vec3(p + Vec3(1, 1, 0)); }), cube().corners()));
  std::vector<Index> corners = m.corners();
  for (Index& v : corners) v = v == 8 ? 3 : v == 12 ? 7 : v;
  const Mesh joined(m.positions(), corners);
  EXPECT_EQ(countEdges(EdgeTable(joined)).nonManifold, 1u);
  EXPECT_EQ(volume(joined, joined.positions()).value, 2.0);
}

TEST(Volume, AsWrittenIsThatOfRoundedCoordinates) {
  Mesh m(moved(sphere(24, 12), kMotion), sphere(24, 12).triangles());
  EXPECT_EQ(volumeAsWritten(m, m.positions(), countEdges(EdgeTable(m))).value, volume(m, m.positions()).value);
  m.setPositionType(ScalarType::Float32);
  const auto written = asWritten(m, m.positions());
  EXPECT_NE(written[5], m.positions()[5]);
  for (std::size_t i = 0; i < written.size(); ++i)  // the low 29 bits of a double are beyond a float
    for (int k = 0; k < 3; ++k) ASSERT_EQ(std::bit_cast<std::uint64_t>(written[i][k]) & 0x1FFFFFFF, 0u) << i << ' ' << k;
  // Both are centred on their own box, so their sums differ by rounding alone.
  EXPECT_NEAR(*volumeAsWritten(m, m.positions(), countEdges(EdgeTable(m))).value, *volume(m, written).value, 1e-14);
  EXPECT_NE(*volume(m, written).value, *volume(m, m.positions()).value);
}

TEST(Measures, ScaleExactlyWithPowersOfTwoAndSurviveExtremeSizes) {
  const Mesh m(moved(sphere(20, 10), kMotion), sphere(20, 10).triangles());
  const SurfaceMoments here = surfaceMoments(m, m.positions());
  const double v = *volume(m, m.positions()).value;
  for (const int e : {10, -10, 300, -300}) {
    const auto scaled = moved(m, [&](const Vec3& p) { return Vec3(p * std::ldexp(1.0, e)); });
    const SurfaceMoments there = surfaceMoments(m, scaled);
    EXPECT_EQ(there.area, std::ldexp(here.area, 2 * e));
    EXPECT_EQ(there.centroid, here.centroid * std::ldexp(1.0, e));
    EXPECT_EQ(there.covariance(0, 1), std::ldexp(here.covariance(0, 1), 2 * e));
    EXPECT_EQ(*volume(m, scaled).value, std::ldexp(v, 3 * e));
  }
  const auto huge = moved(m, [](const Vec3& p) { return Vec3(p * 1e306); });
  EXPECT_EQ(volume(m, huge).reason, "too large for a double");
}

TEST(Measures, HaveTheSameBitsOnAnyThreadCount) {
  const Mesh m = sphere(160, 80);
  const auto rough = moved(m, [](const Vec3& p) { return Vec3(p * (1 + 0.3 * uniform01(1, std::uint64_t(1e6 * (p.x() + 2 * p.z() + 4))))); });
  const auto all = [&](int threads) {
    ThreadLimit limit(threads);
    const SurfaceMoments s = surfaceMoments(m, rough);
    return std::vector<double>{s.area, s.centroid.x(), s.covariance(1, 2), *volume(m, rough).value};
  };
  EXPECT_EQ(all(1), all(2));
  EXPECT_EQ(all(1), all(7));
}

TEST(SurfaceMoments, OfABoxShellMatchTheClosedForm) {
  // Box 2 x 1 x 1 about (1, .5, .5): the x variance of its surface is (sides: 4 faces of area 2, var 4/12; ends: 2 of
  // area 1 at distance 1) = (8 * 1/3 + 2 * 1) / 10.
  const auto p = moved(cube(), [](const Vec3& x) { return Vec3(2 * x.x(), x.y(), x.z()); });
  const SurfaceMoments s = surfaceMoments(cube(), p);
  EXPECT_NEAR(s.area, 10, 1e-14);
  EXPECT_NEAR((s.centroid - Vec3(1, 0.5, 0.5)).norm(), 0, 1e-15);
  EXPECT_NEAR(s.covariance(0, 0), (8.0 / 3 + 2) / 10, 1e-15);
  EXPECT_NEAR(s.covariance(0, 1), 0, 1e-15);
}

TEST(SurfaceMoments, OfPointsWithoutAreaAreTheirMean) {
  const Mesh cloud({{0, 0, 0}, {2, 0, 0}, {kNan, 0, 0}}, std::vector<Index>{});
  const SurfaceMoments s = surfaceMoments(cloud, cloud.positions());
  EXPECT_EQ(s.area, 0);
  EXPECT_EQ(s.centroid, Vec3(1, 0, 0));
  EXPECT_EQ(s.covariance(0, 0), 1);
  EXPECT_EQ(surfaceMoments(Mesh{}, {}).area, 0);
  EXPECT_THROW(surfaceMoments(cloud, {}), std::invalid_argument);
}

TEST(Summary, OfAMixedMeshCountsEverythingAndAddsUp) {
  Mesh m = together(together(quadCube(), grid(2)), book(3));
  std::vector<Vec3> p = m.positions();
  p.emplace_back(kNan, 1, 1);
  m = Mesh(p, m.corners(), m.offsets());
  m.attributes().push_back({"quality", Element::Vertex, 1, Interpolation::Linear, makeData(ScalarType::UInt8, p.size()), {}, {}});
  const Summary s = summarize(m);
  EXPECT_EQ(s.faces, 6u + 8u + 3u);
  EXPECT_EQ(s.triangles + s.quads + s.polygons, s.faces);
  EXPECT_EQ(s.edges, 12u + 16u + 7u);
  EXPECT_EQ(s.boundaryEdges, 8u + 6u);
  EXPECT_EQ(s.boundaryLoops, 1u + 2u);
  ASSERT_EQ(s.components.size(), 3u);
  EXPECT_NEAR(s.components[0].volume.value.value(), 1.0, 1e-15);
  EXPECT_EQ(s.components[1].volume.reason, "8 boundary edges");
  EXPECT_NEAR(s.components[0].area + s.components[1].area + s.components[2].area, s.moments.area, 1e-14);
  EXPECT_FALSE(s.closed || s.manifold || s.oriented || s.volume.value);
  EXPECT_EQ(s.defects.invalidPoints, 1u);
  EXPECT_EQ(s.defects.isolatedVertices, 1u);
  EXPECT_EQ(s.defects.nonManifoldEdges, 1u);
  EXPECT_GT(s.defects.duplicatePoints, 0u);
  ASSERT_EQ(s.attributes.size(), 1u);
  EXPECT_EQ(s.attributes[0].type, ScalarType::UInt8);
  EXPECT_TRUE(s.bounds.min().allFinite());
  EXPECT_NEAR(s.minAngle, std::numbers::pi / 4, 1e-15);
}

TEST(Summary, OfNothingIsAllZero) {
  const Summary s = summarize(Mesh{});
  EXPECT_EQ(s.vertices + s.faces + s.edges + s.boundaryLoops + s.components.size(), 0u);
  EXPECT_FALSE(s.closed);
  EXPECT_TRUE(s.bounds.isEmpty());
  const double inf = std::numeric_limits<double>::infinity();
  const Summary bad = summarize(Mesh({{kNan, 0, 0}, {0, inf, 0}, {0, 0, -inf}}, {0, 1, 2}));
  EXPECT_EQ(bad.defects.invalidPoints, 3u);
  EXPECT_EQ(bad.moments.area, 0);
  EXPECT_TRUE(bad.moments.centroid.allFinite() && bad.moments.covariance.allFinite());
  EXPECT_TRUE(std::isfinite(bad.medianEdge + bad.minAngle + bad.size));
}

}  // namespace
}  // namespace fielddeform::mesh
