#include <fielddeform/core/angle.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/core/random.h>
#include <fielddeform/mesh/io.h>
#include <fielddeform/skeleton/fit.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <limits>

namespace fielddeform::skeleton {
namespace {

// A tube along `axis(s)`, s in [0, 1], of a radius, open at both ends.
mesh::Mesh tube(const std::function<Vec3(double)>& axis, double radius, int rings = 60, int sides = 24) {
  std::vector<Vec3> x;
  std::vector<Index> corners;
  for (int i = 0; i <= rings; ++i)
    for (int k = 0; k < sides; ++k) {
      const double a = 2 * kPi * k / sides;
      x.push_back(axis(static_cast<double>(i) / rings) + radius * Vec3(std::cos(a), std::sin(a), 0));
    }
  const auto at = [&](int i, int k) { return static_cast<Index>(i * sides + k % sides); };
  for (int i = 0; i < rings; ++i)
    for (int k = 0; k < sides; ++k)
      for (const Index v : {at(i, k), at(i, k + 1), at(i + 1, k + 1), at(i, k), at(i + 1, k + 1), at(i + 1, k)}) corners.push_back(v);
  return {std::move(x), std::move(corners)};
}

mesh::Mesh box(const Vec3& size) {
  std::vector<Vec3> x;
  for (int i = 0; i < 8; ++i) x.push_back(Vec3(i & 1, i >> 1 & 1, i >> 2).cwiseProduct(size));
  return {std::move(x), {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5}};
}

const std::vector<Vec3>& spineOf(const SpineFit& fit) { return fit.skeleton.primitives[0].points; }

TEST(FitSpine, TwelveTrianglesGiveTheStraightMiddle) {
  const SpineFit fit = fitSpine(box(Vec3(1, 1, 5)));
  EXPECT_LT((fit.axis - Vec3::UnitZ()).norm(), 1e-14);
  // Equal sides across: a tie, so x.
  EXPECT_LT((fit.about - Vec3::UnitX()).norm(), 1e-14);
  for (std::size_t i = 0; i < 33; ++i) EXPECT_LT((spineOf(fit)[i] - Vec3(0.5, 0.5, 5 * static_cast<double>(i) / 32)).norm(), 1e-13);
  EXPECT_NEAR(*fit.skeleton.primitives[0].radius, 1.25 * std::sqrt(0.5), 1e-13);
}

// The slices of a leaning tube have their centroids on its axis.
TEST(FitSpine, FollowsTheCentroidsOfSlices) {
  const auto axis = [](double s) { return Vec3(0.4 * s * s, 0.1 * s, 3 * s); };
  SpineFitOptions options;
  options.axis = Vec3(0, 0, 7);
  options.smoothing = 0.02;
  const SpineFit fit = fitSpine(tube(axis, 0.2), options);
  for (std::size_t i = 2; i + 2 < 33; ++i) {
    const Vec3 ideal = axis(spineOf(fit)[i].z() / 3);
    // Shear of the tube's wall within a slice moves the area's centroid by about radius^2 times the curvature.
    EXPECT_LT((spineOf(fit)[i] - ideal).norm(), 4e-3) << i;
  }
  EXPECT_NEAR(spineOf(fit).front().z(), 0, 1e-14);
  EXPECT_NEAR(spineOf(fit).back().z(), 3, 1e-14);
  options.shape = SpineShape::Straight;
  const SpineFit straight = fitSpine(tube(axis, 0.2), options);
  for (const Vec3& x : spineOf(straight)) EXPECT_LT((x - straight.centroid).cross(Vec3::UnitZ()).norm(), 1e-14);
}

TEST(FitSpine, IsMonotoneWithEvenSteps) {
  const SpineFit fit = fitSpine(tube([](double s) { return Vec3(std::sin(9 * s), std::cos(5 * s), 4 * s); }, 0.5));
  const double step = fit.axis.dot(spineOf(fit)[1] - spineOf(fit)[0]);
  EXPECT_GT(step, 0);
  for (std::size_t i = 1; i < spineOf(fit).size(); ++i) EXPECT_NEAR(fit.axis.dot(spineOf(fit)[i] - spineOf(fit)[i - 1]), step, 1e-13);
}

TEST(FitSpine, RefiningAFaceChangesNothing) {
  // Exact integrals: twelve triangles and their 4-to-1 refinement have the same slices.
  const mesh::Mesh coarse = box(Vec3(2, 1, 5));
  std::vector<Vec3> x = coarse.positions();
  std::vector<Index> corners;
  const std::vector<Index> old = coarse.corners();
  for (std::size_t t = 0; t < old.size(); t += 3) {
    Index m[3];
    for (int k = 0; k < 3; ++k) {
      m[k] = static_cast<Index>(x.size());
      x.push_back(0.5 * (x[old[t + k]] + x[old[t + (k + 1) % 3]]));
    }
    for (const Index v : {old[t], m[0], m[2], m[0], old[t + 1], m[1], m[2], m[1], old[t + 2], m[0], m[1], m[2]}) corners.push_back(v);
  }
  SpineFitOptions options;
  options.axis = Vec3(1, 2, 3);
  const SpineFit a = fitSpine(coarse, options), b = fitSpine(mesh::Mesh(x, corners), options);
  for (std::size_t i = 0; i < 33; ++i) EXPECT_LT((spineOf(a)[i] - spineOf(b)[i]).norm(), 1e-13);
}

TEST(FitSpine, RadiusReachesEveryVertex) {
  const mesh::Mesh m = tube([](double s) { return Vec3(s * s, 0, 3 * s); }, 0.3);
  const SpineFit fit = fitSpine(m);
  double greatest = 0;  // by brute force over segments
  for (const Vec3& x : m.positions()) {
    double least = 1e300;
    for (std::size_t i = 1; i < spineOf(fit).size(); ++i) {
      const Vec3 a = spineOf(fit)[i - 1], d = spineOf(fit)[i] - a;
      const double t = std::clamp((x - a).dot(d) / d.squaredNorm(), 0.0, 1.0);
      least = std::min(least, (x - a - t * d).norm());
    }
    greatest = std::max(greatest, least);
  }
  EXPECT_NEAR(*fit.skeleton.primitives[0].radius, 1.25 * greatest, 1e-14);
}

TEST(FitSpine, FlatOpenSeveralAndPointOnlyMeshesWork) {
  // A flat strip in z = 0, two components with a gap, an isolated vertex beyond them.
  std::vector<Vec3> x = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {5, 0, 0}, {6, 0, 0}, {6, 1, 0}, {5, 1, 0}, {9, 0.5, 0}};
  const mesh::Mesh strip(x, {0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7});
  const SpineFit fit = fitSpine(strip);
  EXPECT_GT(fit.axis.x(), 0.99);
  for (const Vec3& p : spineOf(fit)) EXPECT_NEAR(p.z(), 0, 1e-15);
  EXPECT_NEAR(spineOf(fit).back().x(), 9, 1e-12);
  const SpineFit cloud = fitSpine(mesh::Mesh(x, {}));
  EXPECT_EQ(spineOf(cloud).size(), 33u);
  // Non-finite vertices and their faces are left out.
  x.push_back(Vec3(std::numeric_limits<double>::quiet_NaN(), 0, 0));
  const SpineFit skipped = fitSpine(mesh::Mesh(x, {0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7, 0, 1, 9}));
  EXPECT_EQ(spineOf(skipped), spineOf(fit));
  // Vertices on the spine itself still get a radius.
  EXPECT_GT(*fitSpine(mesh::Mesh({{0, 0, 0}, {1, 0, 0}}, {})).skeleton.primitives[0].radius, 0);
}

TEST(FitSpine, RefusesWhatHasNoExtent) {
  EXPECT_THROW(fitSpine(mesh::Mesh()), std::invalid_argument);
  EXPECT_THROW(fitSpine(mesh::Mesh({{1, 2, 3}}, {})), std::invalid_argument);
  EXPECT_THROW(fitSpine(mesh::Mesh({{1, 2, 3}, {1, 2, 3}}, {})), std::invalid_argument);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(fitSpine(mesh::Mesh({{nan, 0, 0}, {nan, 1, 0}}, {})), std::invalid_argument);
  SpineFitOptions flat, zero, few;
  flat.axis = Vec3::UnitZ();
  zero.axis = Vec3::Zero();
  few.points = 1;
  const mesh::Mesh triangle({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2});
  for (const SpineFitOptions& o : {flat, zero, few}) EXPECT_THROW(fitSpine(triangle, o), std::invalid_argument);
}

TEST(FitSpine, ScalesExactlyAndIgnoresThreads) {
  mesh::Mesh m = tube([](double s) { return Vec3(s * s, std::sin(3 * s), 3 * s); }, 0.3, 900, 100);
  const SpineFit one = [&] { ThreadLimit limit(1); return fitSpine(m); }();
  EXPECT_EQ(spineOf(fitSpine(m)), spineOf(one));
  for (Vec3& x : m.mutablePositions()) x *= 1024;
  const SpineFit large = fitSpine(m);
  for (std::size_t i = 0; i < 33; ++i) EXPECT_EQ(spineOf(large)[i], 1024 * spineOf(one)[i]);
  EXPECT_EQ(*large.skeleton.primitives[0].radius, 1024 * *one.skeleton.primitives[0].radius);
}

// A bend carries the object without folds only if the spine itself turns gently.
TEST(FitSpineReal, TurnsGentlyOnScans) {
  const char* folder = std::getenv("FIELDDEFORM_TEST_MESHES");
  if (!folder) GTEST_SKIP() << "FIELDDEFORM_TEST_MESHES is not set";
  std::size_t meshes = 0;
  for (const auto& file : std::filesystem::directory_iterator(folder)) {
    if (!mesh::formatFromExtension(file.path())) continue;
    const mesh::Mesh m = mesh::readMesh(file.path());
    const SpineFit fit = fitSpine(m);
    const std::vector<Vec3>& p = spineOf(fit);
    for (std::size_t i = 1; i < p.size(); ++i) EXPECT_GT(fit.axis.dot(p[i] - p[i - 1]), 0);
    for (std::size_t i = 2; i < p.size(); ++i)
      EXPECT_GT((p[i] - p[i - 1]).normalized().dot((p[i - 1] - p[i - 2]).normalized()), std::cos(radiansFromDegrees(10))) << file.path();
    EXPECT_LT(*fit.skeleton.primitives[0].radius, 0.5 * mesh::objectSize(m.positions())) << file.path();
    ++meshes;
  }
  EXPECT_GT(meshes, 0u);
}

TEST(FitPoints, SpreadEvenlyOverTheSurface) {
  const mesh::Mesh m = box(Vec3(1, 1, 1));
  const Skeleton s = fitPoints(m, {.points = 100, .seed = 0, .name = "points"});
  const std::vector<Vec3>& p = s.primitives[0].points;
  ASSERT_EQ(p.size(), 100u);
  double nearest = 1e300;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const Vec3 wall = p[i].cwiseMin(Vec3::Ones() - p[i]);
    EXPECT_NEAR(wall.minCoeff(), 0, 1e-15);
    for (std::size_t k = 0; k < i; ++k) nearest = std::min(nearest, (p[i] - p[k]).norm());
  }
  // 100 discs on an area of 6 at the densest packing are 0.26 apart; farthest-first reaches at least half the optimum.
  EXPECT_GT(nearest, 0.13);
  EXPECT_LT(nearest, 0.27);
  EXPECT_EQ(p, fitPoints(m, {.points = 100, .seed = 0, .name = "points"}).primitives[0].points);
  EXPECT_NE(p, fitPoints(m, {.points = 100, .seed = 1, .name = "points"}).primitives[0].points);
}

TEST(FitPoints, WorkOnVerticesAloneAndStopWhenThereAreNoMorePlaces) {
  const std::vector<Vec3> x = {{0, 0, 0}, {1, 0, 0}, {1, 0, 0}, {0, 0, 3}};
  EXPECT_EQ(fitPoints(mesh::Mesh(x, {}), {.points = 10, .seed = 0, .name = "p"}).primitives[0].points.size(), 3u);
  EXPECT_EQ(fitPoints(mesh::Mesh({{4, 5, 6}}, {})).primitives[0].points.size(), 1u);
  EXPECT_THROW(fitPoints(mesh::Mesh()), std::invalid_argument);
  EXPECT_THROW(fitPoints(mesh::Mesh(x, {}), {.points = 0, .seed = 0, .name = "p"}), std::invalid_argument);
}

TEST(FitLod, StandsOnTheObjectsVertices) {
  const mesh::Mesh m = tube([](double s) { return Vec3(s * s, 0, 3 * s); }, 0.3);
  const Skeleton s = fitLod(m, {.faces = 120, .name = "model"}).skeleton;
  const Primitive& p = s.primitives[0];
  EXPECT_EQ(p.name, "model");
  EXPECT_LE(p.faces.size(), 120u);
  EXPECT_FALSE(p.closed);
  for (const Vec3& x : p.points) EXPECT_NE(std::find(m.positions().begin(), m.positions().end(), x), m.positions().end());
  EXPECT_GT(*p.radius, 0);
  const Primitive solid = fitLod(box(Vec3(1, 2, 3))).skeleton.primitives[0];
  EXPECT_TRUE(solid.closed);
  EXPECT_EQ(solid.faces.size(), 12u);
  EXPECT_THROW(fitLod(m, {.faces = 0, .name = "x"}), std::invalid_argument);
  EXPECT_THROW(fitLod(mesh::Mesh({{1, 2, 3}, {4, 5, 6}}, {})), std::invalid_argument);
}

TEST(FitRadius, GreatestDistanceKnowsEveryType) {
  Primitive points, line, sheet;
  points.name = "p", line.name = "l", sheet.name = "s";
  points.type = PrimitiveType::Points;
  points.points = {{0, 0, 0}};
  line.points = {{10, 0, 0}, {10, 2, 0}};
  sheet.type = PrimitiveType::Mesh;
  sheet.points = {{20, 0, 0}, {22, 0, 0}, {22, 2, 0}, {20, 2, 0}};
  sheet.faces = {{0, 1, 2, 3}};
  const Skeleton s{{points, line, sheet}, {}};
  const auto distance = [&](const Vec3& x) { return greatestDistance(std::vector<Vec3>{x}, s); };
  EXPECT_DOUBLE_EQ(distance(Vec3(0, 0, 2)), 2);
  EXPECT_DOUBLE_EQ(distance(Vec3(10, 1, 3)), 3);
  EXPECT_DOUBLE_EQ(distance(Vec3(20.5, 1.5, -4)), 4);
  EXPECT_EQ(greatestDistance({}, s), 0);
}

}  // namespace
}  // namespace fielddeform::skeleton
