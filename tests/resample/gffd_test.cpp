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

TEST(ResampledGffd, StartsWhereTrackingEndedToTheSameBits) {
  const mesh::Mesh mesh = box();
  skeleton::Primitive line;
  line.name = "line";
  line.points = tests::verticalLine(33, 2);
  line.radius = 1;
  skeleton::Skeleton rest{{line}, {}}, posed = rest;
  posed.primitives[0].points = tests::bendMap(line.points, 1);
  const gffd::GffdMap map(gffd::resolve({}, mesh, skeleton::pairSkeletons(rest, posed)));
  Progress silent;
  gffd::Deformed tracked = gffd::deform(mesh, map, *map.bind(mesh.positions()), silent, true);
  ASSERT_EQ(tracked.safe.size(), mesh.vertexCount());
  const Refined anew = refine(mesh, tracked.map, {}, silent);
  const Refined onward = refine(mesh, tracked.map, Start{std::move(tracked.position), std::move(tracked.safe), std::move(tracked.status), std::move(tracked.residual)}, {}, silent);
  ASSERT_GT(anew.report.insertedVertices, 100u);
  EXPECT_EQ(onward.posed, anew.posed);
  EXPECT_EQ(onward.safe, anew.safe);
  EXPECT_EQ(onward.status, anew.status);
  EXPECT_EQ(onward.residual, anew.residual);
  EXPECT_EQ(onward.rest.positions(), anew.rest.positions());
}

TEST(ResampledGffd, InTheFaithfulModeInsertedVerticesInheritTheMeanOfTheirEndsFieldValues) {
  const mesh::Mesh mesh = box();
  skeleton::Primitive line;
  line.name = "line";
  line.points = {{0, 0, -0.5}, {0, 0, 0.5}};
  line.radius = 2;
  skeleton::Skeleton rest{{line}, {}}, posed = rest;
  posed.primitives[0].points = {{0, 0, -3}, {0, 0, 3}};
  const auto run = [&](gffd::MidpointValue value, std::unique_ptr<gffd::GffdMap>& map) {
    gffd::Options options{.predictor = gffd::Predictor::Mls};
    options.midpointValue = value;
    map = std::make_unique<gffd::GffdMap>(gffd::resolve(options, mesh, skeleton::pairSkeletons(rest, posed)));
    Progress silent;
    return refine(mesh, *map, {.by = Criterion::Stretch}, silent);
  };
  std::unique_ptr<gffd::GffdMap> mean, sampled;
  const Refined a = run(gffd::MidpointValue::Mean, mean), b = run(gffd::MidpointValue::Sampled, sampled);
  EXPECT_TRUE(mean->midpointsInherit());
  EXPECT_FALSE(sampled->midpointsInherit());
  ASSERT_GT(a.report.insertedVertices, 0u);
  EXPECT_EQ(a.report.reason, StopReason::Done);
  EXPECT_NE(a.posed, b.posed);
  // The first round's vertices, by hand.
  std::vector<std::array<Index, 2>> ends;
  for (const auto& e : a.parents)
    if (e[1] < mesh.vertexCount()) ends.push_back(e);
  std::vector<Vec3> image(ends.size());
  Progress silent;
  const auto binding = mean->bind(mesh.positions());
  mean->apply(*mean->bindMidpoints(*binding, mesh.positions(), ends), {image, {}, {}, {}}, silent);
  for (std::size_t i = 0; i < ends.size(); ++i) EXPECT_EQ(image[i], a.posed[mesh.vertexCount() + i]);
}

}  // namespace
}  // namespace fielddeform::resample
