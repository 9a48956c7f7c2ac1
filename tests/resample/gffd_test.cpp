// The tracker and the resampler together, as `bend --resample` runs them.
#include <fielddeform/gffd/deform.h>
#include <fielddeform/mesh/quality.h>
#include <fielddeform/resample/refine.h>
#include <gtest/gtest.h>
#include <tests/support/cases.h>

#include <numbers>

namespace fielddeform::resample {
namespace {

// Twelve triangles: 0.6 x 0.6 x 2 about the z axis.
mesh::Mesh box() {
  std::vector<Vec3> p;
  for (int i = 0; i < 8; ++i) p.emplace_back(i & 1 ? .3 : -.3, i & 2 ? .3 : -.3, i & 4 ? 1 : -1);
  return {p, {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5}};
}

TEST(ResampledGffd, ABoxOfTwelveTrianglesBentByARightAngleMeetsTheIdealBend) {
  const mesh::Mesh mesh = box();
  skeleton::Primitive line;
  line.name = "line";
  line.points = tests::verticalLine(129, 2);
  line.radius = 1;
  skeleton::Skeleton rest{{line}, {}}, posed = rest;
  posed.primitives[0].points = tests::bendMap(line.points, std::numbers::pi / 2);
  const gffd::GffdMap map(gffd::resolve({}, mesh, skeleton::pairSkeletons(rest, posed)));
  Progress silent;
  const Refined r = refine(mesh, map, {}, silent);
  EXPECT_EQ(r.report.reason, StopReason::Done);
  EXPECT_GT(r.report.insertedVertices, 100u);
  const double tolerance = 1e-3 * mesh::objectSize(mesh.positions());
  // On the surface, not only at the vertices: the middle of every triangle and edge against the ideal map of its rest.
  double worst = 0;
  for (std::size_t f = 0; f < r.rest.faceCount(); ++f)
    r.rest.forEachTriangle(f, [&](Index a, Index b, Index c) {
      const auto& p = r.rest.positions();
      const std::vector<Vec3> ideal = tests::bendMap(std::vector<Vec3>{(p[a] + p[b] + p[c]) / 3, (p[a] + p[b]) / 2, p[a]}, std::numbers::pi / 2);
      worst = std::max({worst, (ideal[0] - (r.posed[a] + r.posed[b] + r.posed[c]) / 3).norm(),
                        (ideal[1] - (r.posed[a] + r.posed[b]) / 2).norm(), (ideal[2] - r.posed[a]).norm()});
    });
  EXPECT_LE(worst, tolerance);
  EXPECT_EQ(mesh::countFolds(r.rest, r.rest.positions(), r.posed), 0u);
  EXPECT_TRUE(mesh::countEdges(mesh::EdgeTable(r.rest)).closed());
}

}  // namespace
}  // namespace fielddeform::resample
