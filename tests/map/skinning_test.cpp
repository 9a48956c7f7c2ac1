#include <fielddeform/map/influence.h>
#include <fielddeform/map/skinning.h>
#include <gtest/gtest.h>

#include <numbers>
#include <stdexcept>

#include "classic.h"

namespace fielddeform::map {
namespace {

using namespace test;
using skeleton::Potential;
using std::numbers::pi;

SkeletonMotion twisted(double angle, int n = 65) {
  return edited(spine(n), {{"", skeleton::Twist{{.axis = Vec3(0, 0, 1), .pivot = Vec3::Zero()}, angle}}});
}

SkeletonMotion bent() {
  return edited(spine(9), {{"", skeleton::Bend{.spine = {.axis = Vec3(0, 0, 1), .pivot = Vec3::Zero()}, .angle = 1.5, .about = Vec3(0, 1, 0)}}});
}

// Two bones in a row, the upper one turned half round about their line: the candy wrapper.
SkeletonMotion candyWrapper(double angle) {
  skeleton::Skeleton rest;
  rest.primitives.push_back(line("lower", {Vec3(0, 0, -1), Vec3(0, 0, 0)}));
  rest.primitives.push_back(line("upper", {Vec3(0, 0, 0), Vec3(0, 0, 1)}));
  skeleton::Skeleton posed = rest;
  posed.primitives[1].roll = {angle, angle};
  return motionBetween(rest, posed);
}

const std::vector<SkinBlend> kBoth{SkinBlend::Linear, SkinBlend::DualQuaternion};

TEST(Skinning, AnUneditedSkeletonIsTheIdentityBitForBit) {
  for (const SkinBlend blend : kBoth) expectIdentity(SkinningMap(edited(spine(), {}), {.blend = blend}));
}

TEST(Skinning, WeightsAreAPartitionOfUnity) {
  for (const Potential potential : {Potential::Exponential, Potential::Gaussian, Potential::Metaball, Potential::SoftObject}) {
    const SkinningMap map(bent(), {.potential = potential});
    for (const Vec3& x : cloud(1, 100, 0.5)) {
      double sum = 0;
      for (const double w : map.weights(x)) {
        EXPECT_GE(w, 0);
        sum += w;
      }
      EXPECT_NEAR(sum, 1, 1e-14);
    }
  }
}

TEST(Skinning, FarAwayTheUnclippedPotentialsStillHaveWeights) {
  for (const Potential potential : {Potential::Exponential, Potential::Gaussian}) {
    const SkinningMap map(bent(), {.potential = potential});
    double sum = 0;
    for (const double w : map.weights(Vec3(1e4, 0, 2e4))) sum += w;
    EXPECT_NEAR(sum, 1, 1e-14);
  }
  const SkinningMap clipped(bent(), {.potential = Potential::Metaball});
  EXPECT_EQ(clipped.position(Vec3(5, 0, 0)), Vec3(5, 0, 0));
}

TEST(Skinning, RigidMotionsOfTheSkeletonAreExact) {
  const skeleton::Skeleton bentLine = skeleton::applyEdits(spine(), std::vector<skeleton::Edit>{{"", skeleton::Bend{.spine = {.axis = Vec3(0, 0, 1), .pivot = Vec3::Zero()}, .angle = 1.5, .about = Vec3(0, 1, 0)}}});
  const SkeletonMotion motion = motionBetween(bentLine, rigidlyMoved(bentLine, someMotion()));
  for (const SkinBlend blend : kBoth) {
    const SkinningMap map(motion, {.blend = blend});
    for (const Vec3& x : cloud(2, 100, 2)) EXPECT_LT((map.position(x) - someMotion()(x)).norm(), 1e-12);
  }
}

TEST(Skinning, JacobiansAgreeWithCentralDifferences) {
  const SkeletonMotion taper = edited(spine(9), {{"", skeleton::Taper{{.axis = Vec3(0, 0, 1), .pivot = Vec3::Zero()}, 0.5}}});
  for (const Potential potential : {Potential::Exponential, Potential::Gaussian, Potential::SoftObject})
    for (const SkinBlend blend : kBoth)
      for (const SkeletonMotion& motion : {bent(), twisted(2, 9), taper})
        // Distances to bones have a second derivative that jumps where the foot comes to an end: 1e-5 of a jump is seen.
        expectJacobians(SkinningMap(motion, {.blend = blend, .potential = potential}), cloud(4, 40, 0.6), 2e-4);
}

TEST(Skinning, CuttingBonesInTwoChangesLittle) {
  const SkinningMap coarse(bent(), {});
  const SkeletonMotion fine = edited(spine(129), {{"", skeleton::Bend{.spine = {.axis = Vec3(0, 0, 1), .pivot = Vec3::Zero()}, .angle = 1.5, .about = Vec3(0, 1, 0)}}});
  const SkinningMap map(fine, {});
  for (const Vec3& x : cloud(5, 100, 0.6)) EXPECT_LT((map.position(x) - coarse.position(x)).norm(), 0.02);
}

TEST(Skinning, DualQuaternionsKeepDistancesUnderATwistWhileLinearBlendingCollapses) {
  const SkinningMap linear(candyWrapper(pi), {}), dual(candyWrapper(pi), {.blend = SkinBlend::DualQuaternion});
  const Vec3 rim(0.25, 0, 0);  // half way between the bones: the mean of x and its half turn is the axis
  EXPECT_LT(linear.position(rim).head<2>().norm(), 1e-12);
  EXPECT_NEAR(dual.position(rim).head<2>().norm(), 0.25, 1e-12);
  for (const Vec3& x : cloud(6, 100, 0.5)) {
    // A turn about the axis by any share keeps distance and height.
    EXPECT_NEAR(dual.position(x).head<2>().norm(), x.head<2>().norm(), 1e-12);
    EXPECT_NEAR(dual.position(x).z(), x.z(), 1e-12);
    EXPECT_LE(linear.position(x).head<2>().norm(), x.head<2>().norm() + 1e-12);
  }
}

TEST(Skinning, LinearBlendingIsLinearInTheMotions) {
  // At an angle a between the bones, the middle of the joint shrinks by cos(a / 2).
  for (const double angle : {0.5, 1.0, 2.0}) {
    const SkinningMap map(candyWrapper(angle), {});
    EXPECT_NEAR(map.position(Vec3(0.25, 0, 0)).head<2>().norm(), 0.25 * std::cos(angle / 2), 1e-12);
  }
}

TEST(Skinning, ATwistOfMoreThanAFullTurnGoesTheWholeWay) {
  const SkinningMap map(twisted(4 * pi), {.blend = SkinBlend::DualQuaternion});
  for (double s = -0.8; s < 0.8; s += 0.1) {
    // Twice round over a length of 2: at s the section has turned by 2 pi s. Weights are even on both sides but near the ends.
    const Vec3 x = map.position(Vec3(0.02, 0, s)), expected(0.02 * std::cos(2 * pi * s), 0.02 * std::sin(2 * pi * s), s);
    EXPECT_LT((x - expected).norm(), 0.02);
  }
}

TEST(Skinning, RefusesASkeletonWithoutBonesOrCorrespondence) {
  EXPECT_THROW(SkinningMap(std::vector<Bone>{}, {}), std::invalid_argument);
  skeleton::Skeleton rest = spine(), posed = spine(9);
  EXPECT_THROW(motionBetween(rest, posed), std::invalid_argument);
  posed.primitives[0].name = "other";
  EXPECT_THROW(motionBetween(rest, posed), std::invalid_argument);
}

TEST(ZonedMap, DiesOutSmoothlyWithinTheInfluence) {
  const SkeletonMotion motion = twisted(2);
  const auto inner = std::make_shared<SkinningMap>(motion, SkinOptions{.blend = SkinBlend::DualQuaternion});
  const auto field = std::make_shared<field::Field>(motion.rest);
  const ZonedMap map(inner, field, 0.5);
  EXPECT_EQ(image(map, Vec3(1.2, 0, 0)), Vec3(1.2, 0, 0));
  EXPECT_EQ(image(map, Vec3(0.3, 0.1, 0.2)), inner->position(Vec3(0.3, 0.1, 0.2)));  // s = 0.68 >= 0.5: the inner zone
  std::vector<Vec3> points;
  for (const Vec3& x : cloud(8, 60, 0.7))
    if (std::abs(x.head<2>().norm() - 0.5) > 0.01) points.push_back(x);
  expectJacobians(map, points, 2e-4);
  EXPECT_THROW(ZonedMap(inner, field, 1.5), std::invalid_argument);
  expectIdentity(ZonedMap(std::make_shared<SkinningMap>(edited(spine(), {}), SkinOptions{}), field, 0.5));
}

}  // namespace
}  // namespace fielddeform::map
