#include <fielddeform/map/wires.h>
#include <gtest/gtest.h>

#include <numbers>
#include <stdexcept>

#include "classic.h"

namespace fielddeform::map {
namespace {

using namespace test;
using std::numbers::pi;

skeleton::Skeleton shifted(skeleton::Skeleton s, std::size_t primitive, const Vec3& by) {
  for (Vec3& p : s.primitives[primitive].points) p += by * (1 + p.z());
  return s;
}

skeleton::Skeleton two(double apart, double radius = 0.8) {
  skeleton::Skeleton s = spine(33, radius);
  s.primitives.push_back(line("other", straight(Vec3(apart, 0, -1), Vec3(apart, 0, 1), 33), radius));
  return s;
}

// With everything at once: bent, twisted, scaled.
skeleton::Skeleton contorted(skeleton::Skeleton s) {
  for (auto& p : s.primitives) {
    p.pointRadius.clear();
    for (std::size_t i = 0; i < p.points.size(); ++i) {
      Vec3& x = p.points[i];
      p.pointRadius.push_back(*p.radius * (1 + 0.4 * std::sin(x.z())));
      p.roll.push_back(1.5 * x.z());
      x += 0.3 * Vec3(std::sin(2 * x.z()), x.z() * x.z(), 0.4 * x.z());
    }
  }
  return s;
}

TEST(Wires, UneditedWiresAreTheIdentityBitForBit) { expectIdentity(WireMap(motionBetween(two(0.5), two(0.5)))); }

TEST(Wires, PointsOnAWireGoWhereItGoes) {
  const skeleton::Skeleton rest = spine(33, 0.8), posed = contorted(rest);
  const WireMap map(motionBetween(rest, posed));
  for (std::size_t i = 0; i < 33; ++i)
    EXPECT_LT((map.position(rest.primitives[0].points[i]) - posed.primitives[0].points[i]).norm(), 1e-13);
}

TEST(Wires, BeyondTheRadiusSpaceStaysBitForBit) {
  const WireMap map(motionBetween(spine(33, 0.8), contorted(spine(33, 0.8))));
  for (const Vec3& x : cloud(2, 200, 2)) {
    const Vec3 end(0, 0, std::clamp(x.z(), -1.0, 1.0));
    EXPECT_EQ(map.position(x) == x, (x - end).norm() >= 0.8) << x.transpose();
  }
}

TEST(Wires, ATranslationFallsOffAsTheDensitySays) {
  const skeleton::Skeleton rest = spine(33, 0.8);
  skeleton::Skeleton posed = rest;
  for (Vec3& p : posed.primitives[0].points) p += Vec3(0.1, 0.2, 0.3);
  const WireMap map(motionBetween(rest, posed));
  for (double u = 0; u < 1; u += 0.09) {
    const double f = (1 - u * u) * (1 - u * u);
    EXPECT_LT((map.position(Vec3(0, 0.8 * u, 0.3)) - Vec3(0, 0.8 * u, 0.3) - f * Vec3(0.1, 0.2, 0.3)).norm(), 1e-14);
  }
}

TEST(Wires, TheScaleGrowsOffsetsAndTheTwistTurnsThem) {
  const skeleton::Skeleton rest = spine(33, 0.8);
  skeleton::Skeleton grown = rest, turned = rest;
  grown.primitives[0].radius = 1.6;
  turned.primitives[0].roll.assign(33, 1.0);
  const double f = std::pow(1 - 0.25, 2);  // at half the radius
  EXPECT_LT((WireMap(motionBetween(rest, grown)).position(Vec3(0.4, 0, 0)) - Vec3(0.4 * (1 + f), 0, 0)).norm(), 1e-14);
  EXPECT_LT((WireMap(motionBetween(rest, turned)).position(Vec3(0.4, 0, 0)) - Vec3(0.4 * std::cos(f), 0.4 * std::sin(f), 0)).norm(), 1e-14);
}

TEST(Wires, DisplacementsOfWiresAddUp) {
  const skeleton::Skeleton rest = two(0.5);
  const skeleton::Skeleton first = shifted(rest, 0, Vec3(0, 0.3, 0)), second = shifted(rest, 1, Vec3(0.2, 0, 0.1));
  const skeleton::Skeleton both = shifted(first, 1, Vec3(0.2, 0, 0.1));
  const WireOptions sum{.blend = std::nullopt};
  const WireMap a(motionBetween(rest, first), sum), b(motionBetween(rest, second), sum), ab(motionBetween(rest, both), sum);
  for (const Vec3& x : cloud(3, 200))
    EXPECT_LT((ab.displacement(x) - (a.displacement(x) + b.displacement(x))).norm(), 1e-14);
}

TEST(Wires, WiresOutOfEachOthersReachAddUpWithAnyBlend) {
  const skeleton::Skeleton rest = two(2), both = shifted(shifted(rest, 0, Vec3(0, 0.3, 0)), 1, Vec3(0.2, 0, 0.1));
  const WireMap blended(motionBetween(rest, both), {.blend = 2}), sum(motionBetween(rest, both), {.blend = std::nullopt});
  for (const Vec3& x : cloud(3, 200, 2)) EXPECT_EQ(blended.position(x), sum.position(x));
}

TEST(Wires, WiresThatSayTheSameSayItOnce) {
  const skeleton::Skeleton one = spine(33, 0.8), same = two(0);
  const WireMap single(motionBetween(one, contorted(one)));
  for (const double m : {0.0, 1.0, 3.0}) {
    const WireMap map(motionBetween(same, contorted(same)), {.blend = m});
    for (const Vec3& x : cloud(4, 100)) EXPECT_LT((map.position(x) - single.position(x)).norm(), 1e-14);
  }
}

TEST(Wires, AGreaterPowerFavoursTheGreaterDisplacement) {
  const skeleton::Skeleton rest = two(0.5), both = shifted(shifted(rest, 0, Vec3(0, 0.3, 0)), 1, Vec3(0, 0.1, 0));
  const Vec3 x(0.25, 0, 0.5);
  double last = 0;
  for (const double m : {0.0, 1.0, 4.0, 50.0}) {
    const double now = WireMap(motionBetween(rest, both), {.blend = m}).displacement(x).y();
    EXPECT_GT(now, last);
    last = now;
  }
  EXPECT_NEAR(last, WireMap(motionBetween(rest, both)).displacementBy(0, x).y(), 1e-9);
}

TEST(Wires, LocalInfluenceFavoursTheNearestWireInItsOwnRadii) {
  const skeleton::Skeleton rest = two(0.5), both = shifted(shifted(rest, 0, Vec3(0, 0.1, 0)), 1, Vec3(0, 0.3, 0));
  const Vec3 x(0.1, 0, 0.5);  // nearer to the first, which moves less
  double last = 1;
  for (const double k : {0.0, 1.0, 4.0, 60.0}) {
    const WireMap map(motionBetween(rest, both), {.blend = 1, .local = k});
    EXPECT_LT(map.displacement(x).y(), last);
    last = map.displacement(x).y();
    expectJacobians(map, {x, Vec3(0.3, 0.1, -0.2), Vec3(0.25, -0.2, 0.4)}, 1e-6);
  }
  EXPECT_NEAR(last, WireMap(motionBetween(rest, both)).displacementBy(0, x).y(), 1e-6);
  // A plain mean (m = 0) no longer jumps where a reach begins.
  const WireMap mean(motionBetween(rest, both), {.blend = 0, .local = 1});
  EXPECT_LT((mean.displacement(Vec3(-0.3 - 1e-7, 0, 0)) - mean.displacement(Vec3(-0.3 + 1e-7, 0, 0))).norm(), 1e-6);
  EXPECT_THROW(WireMap(motionBetween(rest, both), {.local = -1}), std::invalid_argument);
}

TEST(Wires, ADomainCurveBoundsTheReachOnItsSide) {
  skeleton::Skeleton rest = spine(33, 0.8);
  rest.primitives.push_back(line("spine.domain", straight(Vec3(0.3, 0, -1), Vec3(0.3, 0, 1), 9), 0.8));
  const skeleton::Skeleton posed = shifted(rest, 0, Vec3(0, 0.3, 0));
  const WireMap map(motionBetween(rest, posed));
  EXPECT_EQ(map.wireCount(), 1u);
  EXPECT_EQ(map.position(Vec3(0.31, 0, 0.2)), Vec3(0.31, 0, 0.2));
  EXPECT_NE(map.position(Vec3(0.29, 0, 0.2)), Vec3(0.29, 0, 0.2));
  EXPECT_NE(map.position(Vec3(-0.7, 0, 0.2)), Vec3(-0.7, 0, 0.2));
  rest.primitives[1].name = "nobody.domain";
  EXPECT_THROW(WireMap(motionBetween(rest, rest)), std::invalid_argument);
}

TEST(Wires, JacobiansAgreeWithCentralDifferences) {
  skeleton::Skeleton rest = two(0.5);
  rest.primitives.push_back(line("spine.domain", straight(Vec3(-0.6, 0, -1), Vec3(-0.5, 0.2, 1), 9), 0.8));
  skeleton::Skeleton posed = contorted(rest);
  posed.primitives[2] = rest.primitives[2];
  std::vector<Vec3> points;
  for (const Vec3& x : cloud(5, 150, 0.9))
    if (std::abs(x.z()) < 0.85 && x.head<2>().norm() > 0.03) points.push_back(x);
  for (const auto& blend : {std::optional<double>(), std::optional<double>(0.0), std::optional<double>(1.0), std::optional<double>(2.5)}) {
    const WireMap map(motionBetween(rest, posed), {.blend = blend});
    std::vector<Vec3> inside;
    for (const Vec3& x : points) {
      // With the plain mean the map jumps where a wire's reach begins.
      const bool edge = map.displacementBy(0, x).norm() < 1e-3 || map.displacementBy(1, x).norm() < 1e-3;
      if (!edge) inside.push_back(x);
    }
    EXPECT_GT(inside.size(), 30u);
    expectJacobians(map, inside, 3e-5);
  }
}

TEST(Wires, TangentsTurnedByAQuarterAndMore) {
  const skeleton::Skeleton rest = spine(33, 0.8);
  for (const double angle : {1e-3, 0.0101, pi / 2, 2.5, pi}) {
    skeleton::Skeleton posed = rest;
    const Mat3 turn = Eigen::AngleAxisd(angle, Vec3::UnitX()).toRotationMatrix();
    for (Vec3& p : posed.primitives[0].points) p = turn * p;
    const WireMap map(motionBetween(rest, posed));
    for (const Vec3& x : cloud(5, 30, 0.5)) EXPECT_TRUE(map.position(x).allFinite());
    if (angle > 3) continue;
    expectJacobians(map, cloud(6, 20, 0.4), 1e-5);
    // Right at the wire the whole turn arrives.
    EXPECT_LT((map.jacobian(Vec3(0, 0, 0.3)) - turn).norm(), 1e-6);
  }
}

TEST(Wires, RefusesWhatIsNoLineOrNoPower) {
  skeleton::Skeleton points = spine();
  points.primitives[0].type = skeleton::PrimitiveType::Points;
  EXPECT_THROW(WireMap(motionBetween(points, points)), std::invalid_argument);
  EXPECT_THROW(WireMap(motionBetween(spine(), spine()), {.blend = -1}), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::map
