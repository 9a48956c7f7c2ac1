#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <gtest/gtest.h>
#include <tests/gffd/gffd_testing.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace fielddeform::gffd::tests {
namespace {

using fielddeform::tests::bendMap;
using fielddeform::tests::verticalLine;

skeleton::Skeleton straight(double radius = 0.6) { return lineSkeleton(verticalLine(17, 2), radius); }
skeleton::Skeleton bent(double angle, double radius = 0.6) {
  return lineSkeleton(bendMap(verticalLine(17, 2), angle), radius);
}

std::size_t count(const Deformed& d, Status s) { return countStatuses(d.status)[static_cast<std::size_t>(s)]; }

TEST(GffdMap, AnUneditedSkeletonReturnsTheInputBitForBit) {
  const mesh::Mesh mesh = smallCapsule();
  for (const Predictor p : {Predictor::Auto, Predictor::Mls, Predictor::Axial, Predictor::Warp, Predictor::Gradient}) {
    const Deformed d = track(mesh, straight(), straight(), {.predictor = p});
    EXPECT_EQ(d.position, mesh.positions());
    EXPECT_EQ(count(d, Status::Fixed), mesh.vertexCount());
  }
}

TEST(GffdMap, PointsOutsideTheInfluenceKeepTheirBits) {
  mesh::Mesh mesh = smallCapsule();
  const auto rest = lineSkeleton(verticalLine(9, 0.8), 0.3), posed = lineSkeleton(bendMap(verticalLine(9, 0.8), 0.8, 0.8), 0.3);
  const Deformed d = track(mesh, rest, posed);
  std::size_t fixed = 0;
  for (std::size_t i = 0; i < mesh.vertexCount(); ++i)
    if (d.status[i] == Status::Fixed) {
      ++fixed;
      ASSERT_EQ(d.position[i], mesh.positions()[i]);
    }
  EXPECT_GT(fixed, 100u);
  EXPECT_LT(fixed, mesh.vertexCount());
}

TEST(GffdMap, ARigidEditMovesTheObjectRigidly) {
  const mesh::Mesh mesh = smallCapsule();
  const Quat turn(Eigen::AngleAxisd(2.2, Vec3(1, .5, 2).normalized()));
  const Vec3 shift(.8, .3, .5);
  std::vector<Vec3> curve;
  for (int i = 0; i < 25; ++i) {
    const double z = -1 + i / 12.0;
    curve.emplace_back(.12 * std::sin(3 * z), .08 * std::cos(2 * z), z);
  }
  const skeleton::Skeleton rest = lineSkeleton(curve, .7);
  for (Vec3& p : curve) p = turn * p + shift;
  for (const Predictor predictor : {Predictor::Auto, Predictor::Mls, Predictor::Axial}) {
    const Deformed d = track(mesh, rest, lineSkeleton(curve, .7), {.predictor = predictor});
    for (std::size_t i = 0; i < mesh.vertexCount(); ++i)
      ASSERT_LT((d.position[i] - (turn * mesh.positions()[i] + shift)).norm(), 2.5e-9);  // 1e-9 of the size
    EXPECT_EQ(count(d, Status::Converged), mesh.vertexCount());
  }
}

TEST(GffdMap, ATranslationFarFromTheOriginStaysExact) {
  mesh::Mesh mesh = smallCapsule();
  const Vec3 far(1e4, -2e4, 3e4), shift(.25, .5, -.125);
  std::vector<Vec3> points = mesh.positions();
  for (Vec3& p : points) p += far;
  mesh.setPositions(points);
  auto line = verticalLine(17, 2);
  for (Vec3& p : line) p += far;
  const auto rest = lineSkeleton(line, .6);
  for (Vec3& p : line) p += shift;
  const Deformed d = track(mesh, rest, lineSkeleton(line, .6));
  for (std::size_t i = 0; i < mesh.vertexCount(); ++i) ASSERT_LT((d.position[i] - points[i] - shift).norm(), 1e-10);
}

TEST(GffdMap, EveryVertexKeepsItsFieldValue) {
  const mesh::Mesh mesh = smallCapsule();
  const skeleton::Skeleton rest = straight(), posed = bent(1.5);
  const field::Field before(rest, {}), after(posed, {});
  const Deformed d = track(mesh, rest, posed);
  for (std::size_t i = 0; i < mesh.vertexCount(); ++i) {
    if (d.status[i] != Status::Converged) continue;
    EXPECT_NEAR(after.evaluate(d.position[i]).pseudoDistance, before.evaluate(mesh.positions()[i]).pseudoDistance, 1e-4 * .6);
    EXPECT_LE(d.residual[i], 1e-4 * .6 * (1 + 1e-6));
  }
  EXPECT_GT(count(d, Status::Converged), mesh.vertexCount() / 2);
}

TEST(GffdMap, ThreadsDoNotChangeABit) {
  const auto c = fielddeform::tests::makeCase("branch");
  std::vector<Deformed> results;
  for (const int threads : {1, 2, 7}) {
    const ThreadLimit limit(threads);
    results.push_back(track(c));
  }
  for (const Deformed& d : results) {
    EXPECT_EQ(d.position, results[0].position);
    EXPECT_EQ(d.status, results[0].status);
    EXPECT_EQ(d.residual, results[0].residual);
  }
}

TEST(GffdMap, ScalingByAPowerOfTwoScalesEveryByte) {
  const double scale = 1024;
  for (const char* name : {"bend90", "twist2_180", "cagebend90"}) {
    auto c = fielddeform::tests::makeCase(name);
    const Deformed small = track(c);
    for (Vec3& p : c.mesh.mutablePositions()) p *= scale;
    for (auto* s : {&c.rest, &c.posed})
      for (auto& p : s->primitives) {
        for (Vec3& q : p.points) q *= scale;
        p.radius = *p.radius * scale;
      }
    const Deformed large = track(c);
    for (std::size_t i = 0; i < small.position.size(); ++i) ASSERT_EQ(Vec3(scale * small.position[i]), large.position[i]) << name << ' ' << i;
  }
}

TEST(GffdMap, OneBindingServesSuccessivePosesAndBarePoints) {
  const mesh::Mesh mesh = smallCapsule();
  const ResolvedOptions resolved = resolve({}, mesh, skeleton::pairSkeletons(straight(), bent(.5)));
  const GffdMap map(resolved);
  const auto binding = map.bind(mesh.positions());
  const GffdMap second = map.withPose(bent(1.2));
  std::vector<Vec3> posed(mesh.vertexCount()), direct(10), alone(10);
  Progress silent;
  second.apply(*binding, {.position = posed, .safe = {}, .status = {}, .residual = {}}, silent);
  const std::vector<Vec3> some(mesh.positions().begin() + 100, mesh.positions().begin() + 110);
  second.apply(*second.bind(some), {.position = direct, .safe = {}, .status = {}, .residual = {}}, silent);
  // A point's result does not depend on its company.
  for (int i = 0; i < 10; ++i) EXPECT_EQ(direct[i], posed[100 + i]);
  const GffdMap fresh(resolve({.predictor = second.resolved().options.predictor, .falloff = second.resolved().options.falloff},
                              mesh, skeleton::pairSkeletons(straight(), bent(1.2))));
  fresh.apply(*fresh.bind(some), {.position = alone, .safe = {}, .status = {}, .residual = {}}, silent);
  EXPECT_EQ(alone, direct);
}

TEST(GffdMap, ForeignBindingsAndWrongSizesAreRefused) {
  const mesh::Mesh mesh = smallCapsule();
  const GffdMap a(resolve({}, mesh, skeleton::pairSkeletons(straight(), bent(.5))));
  const GffdMap b(resolve({}, mesh, skeleton::pairSkeletons(straight(.5), bent(.5, .5))));
  std::vector<Vec3> out(mesh.vertexCount()), few(3);
  Progress silent;
  EXPECT_THROW(a.apply(*b.bind(mesh.positions()), {.position = out, .safe = {}, .status = {}, .residual = {}}, silent), std::invalid_argument);
  EXPECT_THROW(a.apply(*a.bind(mesh.positions()), {.position = few, .safe = {}, .status = {}, .residual = {}}, silent), std::invalid_argument);
}

TEST(GffdMap, NonFinitePointsComeBackInvalidAndAsTheyWere) {
  mesh::Mesh mesh = smallCapsule();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  mesh.mutablePositions()[5] = Vec3(nan, 1, 2);
  mesh.mutablePositions()[6] = Vec3(0, std::numeric_limits<double>::infinity(), 0);
  const Deformed d = track(mesh, straight(), bent(1));
  EXPECT_EQ(count(d, Status::Invalid), 2u);
  EXPECT_EQ(d.status[5], Status::Invalid);
  EXPECT_TRUE(std::isnan(d.position[5][0]) && d.position[5][1] == 1);
  for (std::size_t i = 7; i < mesh.vertexCount(); ++i) ASSERT_TRUE(d.position[i].allFinite());
}

TEST(GffdMap, JacobiansOfATwistAreRotations) {
  // Inside a line turned by its roll alone, space turns about the axis.
  skeleton::Skeleton rest = straight(), posed = straight();
  rest.primitives[0].roll.assign(17, 0.0);
  posed.primitives[0].roll.assign(17, 0.7);
  const GffdMap map(resolve({.predictor = Predictor::Axial, .falloff = Falloff::Off}, {}, skeleton::pairSkeletons(rest, posed)));
  const std::vector<Vec3> points{{.2, .1, .3}, {.1, -.3, -.4}};
  const auto binding = map.bind(points);
  std::vector<Mat3> j(2);
  map.jacobians(*binding, j);
  const Mat3 expected = Eigen::AngleAxisd(0.7, Vec3::UnitZ()).toRotationMatrix();
  for (const Mat3& m : j) EXPECT_LT((m - expected).norm(), 1e-6);
}

TEST(GffdMap, ATwistByRollHasTheRightHandedSense) {
  skeleton::Skeleton rest = straight(), posed = straight();
  rest.primitives[0].roll.assign(17, 0.0);
  posed.primitives[0].roll.resize(17);
  for (int i = 0; i < 17; ++i) posed.primitives[0].roll[i] = std::numbers::pi * i / 16;
  const mesh::Mesh mesh = smallCapsule();
  const Deformed d = track(mesh, rest, posed);
  std::vector<Vec3> ideal = fielddeform::tests::twistMap(mesh.positions(), std::numbers::pi);
  for (Vec3& p : ideal) p = Vec3(-p.y(), p.x(), p.z());  // the roll starts at zero at the lower end, the map in the middle
  EXPECT_LT(meanDistance(d.position, ideal), 5e-3);
  EXPECT_EQ(d.folds, 0u);
}

TEST(GffdMap, CancellingLeavesByException) {
  const mesh::Mesh mesh = smallCapsule();
  const GffdMap map(resolve({}, mesh, skeleton::pairSkeletons(straight(), bent(1))));
  const auto binding = map.bind(mesh.positions());
  Progress progress;
  progress.cancel();
  EXPECT_THROW(deform(mesh, map, *binding, progress), Cancelled);
}

TEST(GffdMap, MeanMidpointValuesAreTheEndsMean) {
  const mesh::Mesh mesh = smallCapsule();
  const GffdMap mean(resolve({.midpointValue = MidpointValue::Mean}, mesh, skeleton::pairSkeletons(straight(), bent(1))));
  const GffdMap sampled(resolve({}, mesh, skeleton::pairSkeletons(straight(), bent(1))));
  // Two points at the same distance from the line: their midpoint lies nearer, but the mean value is theirs.
  const std::vector<Vec3> ends{{.3, 0, 0}, {0, .3, 0}};
  const std::vector<std::array<Index, 2>> pairs{{0, 1}};
  Progress silent;
  std::vector<Vec3> a(1), b(1);
  mean.apply(*mean.bindMidpoints(*mean.bind(ends), ends, pairs), {.position = a, .safe = {}, .status = {}, .residual = {}}, silent);
  sampled.apply(*sampled.bindMidpoints(*sampled.bind(ends), ends, pairs), {.position = b, .safe = {}, .status = {}, .residual = {}}, silent);
  const field::Field posed(bent(1), {});
  EXPECT_NEAR(posed.evaluate(b[0]).pseudoDistance, .3 / std::sqrt(2), 1e-4);
  EXPECT_NEAR(posed.evaluate(a[0]).pseudoDistance, .3, 1e-4);
}

TEST(GffdOptions, OutOfRangeValuesAreNamed) {
  const mesh::Mesh mesh = smallCapsule();
  const auto pair = skeleton::pairSkeletons(straight(), bent(1));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(resolve({.tolerance = nan}, mesh, pair), std::invalid_argument);
  EXPECT_THROW(resolve({.falloffBand = 1.5}, mesh, pair), std::invalid_argument);
  EXPECT_THROW(resolve({.substeps = 0}, mesh, pair), std::invalid_argument);
  EXPECT_THROW(resolve({}, mesh, skeleton::pairSkeletons({}, bent(1))), std::invalid_argument);
  ResolvedOptions unresolved;
  unresolved.skeletons = pair;
  EXPECT_THROW(GffdMap{unresolved}, std::invalid_argument);
}

TEST(GffdOptions, TheAutomaticRadiusIsTwiceTheGreatestDistance) {
  skeleton::Skeleton rest = straight(), posed = bent(1);
  rest.primitives[0].radius.reset();
  posed.primitives[0].radius.reset();
  const mesh::Mesh mesh = smallCapsule(0);
  const ResolvedOptions r = resolve({}, mesh, skeleton::pairSkeletons(rest, posed));
  EXPECT_TRUE(r.radiusWasAutomatic);
  EXPECT_NEAR(r.referenceRadius, 2 * .25, 1e-12);  // a capsule of radius 1/4 around the line
  EXPECT_EQ(resolve({.radius = .4}, mesh, skeleton::pairSkeletons(rest, posed)).referenceRadius, .4);
}

}  // namespace
}  // namespace fielddeform::gffd::tests
