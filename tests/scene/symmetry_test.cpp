#include <fielddeform/scene/symmetry.h>
#include <gtest/gtest.h>

namespace fielddeform::scene {
namespace {

using skeleton::PairKind;
using skeleton::Primitive;
using skeleton::Skeleton;

Primitive line(std::string name, std::vector<Vec3> points) {
  Primitive p;
  p.name = std::move(name);
  p.points = std::move(points);
  return p;
}

Primitive pointSet(std::string name, std::vector<Vec3> points) {
  Primitive p = line(std::move(name), std::move(points));
  p.type = skeleton::PrimitiveType::Points;
  return p;
}

const MirrorPlane kMiddle{.axis = 0, .at = 1};  // x = 1

// Two arms that are each other's image in x = 1.
Skeleton arms() {
  return {{line("left", {{0, 0, 0}, {-1, 0, 0}, {-2, 0.5, 0}}), line("right", {{2, 0, 0}, {3, 0, 0}, {4, 0.5, 0}})}, ""};
}

TEST(Symmetry, TheOtherArmFollows) {
  Skeleton posed = arms();
  posed.primitives[0].points[2] += Vec3(0.25, 1, -0.5);
  const auto pair = mirrorEdits(pairSkeletons(arms(), posed), kMiddle);
  EXPECT_EQ(pair.posed.primitives[0].points, posed.primitives[0].points);
  EXPECT_EQ(pair.posed.primitives[1].points[2], Vec3(4 - 0.25, 1.5, -0.5));
  EXPECT_EQ(pair.posed.primitives[1].points[1], Vec3(3, 0, 0));
}

TEST(Symmetry, PointsListedInReverseAreMatchedByPlace) {
  Skeleton rest = arms();
  std::swap(rest.primitives[1].points[0], rest.primitives[1].points[2]);
  Skeleton posed = rest;
  posed.primitives[0].points[2].z() = 1;
  posed.primitives[0].roll = {0.1, 0.2, 0.3};
  const auto pair = mirrorEdits(pairSkeletons(rest, posed), kMiddle);
  EXPECT_EQ(pair.posed.primitives[1].points[0], Vec3(4, 0.5, 1));
  // The mirrored turn about the mirrored tangent has the other sign; this tangent is reversed, too.
  EXPECT_EQ(pair.posed.primitives[1].roll, (std::vector<double>{0.3, 0.2, 0.1}));
}

TEST(Symmetry, TwoEditsMeetInTheMiddle) {
  Skeleton posed = arms();
  posed.primitives[0].points[2].y() += 1;
  posed.primitives[1].points[2].y() += 3;
  const auto pair = mirrorEdits(pairSkeletons(arms(), posed), kMiddle);
  EXPECT_EQ(pair.posed.primitives[0].points[2].y(), 2.5);
  EXPECT_EQ(pair.posed.primitives[1].points[2].y(), 2.5);
}

TEST(Symmetry, APointOnThePlaneStaysOnIt) {
  Skeleton rest{{line("spine", {{1, 0, 0}, {1, 1, 0}})}, ""};
  Skeleton posed = rest;
  posed.primitives[0].points[1] = {1.5, 2, 3};
  const auto pair = mirrorEdits(pairSkeletons(rest, posed), kMiddle);
  EXPECT_EQ(pair.posed.primitives[0].points[1], Vec3(1, 2, 3));
}

TEST(Symmetry, TwistAndTaperOfALineAcrossThePlaneReachItsOtherEnd) {
  Skeleton rest{{line("spine", {{-1, 0, 0}, {0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}})}, ""};
  rest.primitives[0].radius = 1;
  Skeleton posed = rest;
  posed.primitives[0].roll = {0, 0, 0, 0.5, 1};
  posed.primitives[0].pointRadius = {1, 1, 1, 0.75, 0.5};
  const auto pair = mirrorEdits(pairSkeletons(rest, posed), kMiddle);
  // A turn about the mirror's normal looks the same in the mirror.
  EXPECT_EQ(pair.posed.primitives[0].roll, (std::vector<double>{1, 0.5, 0, 0.5, 1}));
  EXPECT_EQ(pair.posed.primitives[0].pointRadius, (std::vector<double>{0.5, 0.75, 1, 0.75, 0.5}));
  EXPECT_EQ(pair.posed.primitives[0].points, rest.primitives[0].points);
}

TEST(Symmetry, ATwistAlongThePlaneCancelsAndATaperStays) {
  Skeleton rest{{line("spine", {{1, 0, 0}, {1, 1, 0}})}, ""};
  rest.primitives[0].radius = 1;
  Skeleton posed = rest;
  posed.primitives[0].roll = {0, 1};
  posed.primitives[0].pointRadius = {1, 0.5};
  const auto pair = mirrorEdits(pairSkeletons(rest, posed), kMiddle);
  EXPECT_EQ(pair.posed.primitives[0].roll, (std::vector<double>{0, 0}));
  EXPECT_EQ(pair.posed.primitives[0].pointRadius, (std::vector<double>{1, 0.5}));
}

TEST(Symmetry, BendAndStretchOfALineAcrossThePlaneReachItsOtherEnd) {
  Skeleton rest{{line("spine", {{-1, 0, 0}, {1, 0, 0}, {3, 0, 0}})}, ""};
  Skeleton posed = rest;
  posed.primitives[0].points[2] = {4, 1, 0};
  const auto pair = mirrorEdits(pairSkeletons(rest, posed), kMiddle);
  EXPECT_EQ(pair.posed.primitives[0].points, (std::vector<Vec3>{{-2, 1, 0}, {1, 0, 0}, {4, 1, 0}}));
}

TEST(Symmetry, AnEditedPrimitiveWithoutPartnerGetsATwin) {
  Skeleton rest{{line("arm", {{0, 0, 0}, {-1, 0, 0}}), line("still", {{0, 5, 0}, {-1, 5, 0}})}, ""};
  Skeleton posed = rest;
  posed.primitives[0].points[1] = {-1, 1, 0};
  const auto pair = mirrorEdits(pairSkeletons(rest, posed), kMiddle);
  ASSERT_EQ(pair.rest.primitives.size(), 3u);  // "still" was not edited: nothing to mirror
  const Primitive* twin = pair.posed.find("arm.mirror");
  ASSERT_NE(twin, nullptr);
  EXPECT_EQ(twin->points[1], Vec3(3, 1, 0));
  EXPECT_EQ(pair.rest.find("arm.mirror")->points[1], Vec3(3, 0, 0));
}

TEST(Symmetry, AddedAndRemovedPrimitivesAreMirrored) {
  Skeleton posed = arms();
  posed.primitives.erase(posed.primitives.begin());
  posed.primitives.push_back(pointSet("bump", {{0, 1, 0}}));
  posed.primitives.back().rotation = Quat(Eigen::AngleAxisd(0.3, Vec3::UnitX()));
  const auto pair = mirrorEdits(pairSkeletons(arms(), posed), kMiddle);
  EXPECT_EQ(pair.posed.find("right"), nullptr);
  ASSERT_NE(pair.posed.find("bump.mirror"), nullptr);
  EXPECT_EQ(pair.posed.find("bump.mirror")->points[0], Vec3(2, 1, 0));
  // A turn about the mirror's normal looks the same in the mirror.
  EXPECT_TRUE(pair.posed.find("bump.mirror")->rotation->isApprox(*posed.primitives.back().rotation, 1e-15));
  for (const auto& p : pair.pairs) EXPECT_NE(p.kind, PairKind::Matched);
}

TEST(Symmetry, ValuesFollow) {
  Skeleton posed = arms();
  posed.primitives[0].weight = 2;
  posed.primitives[0].radius = 0.5;
  const auto pair = mirrorEdits(pairSkeletons(arms(), posed), kMiddle);
  EXPECT_EQ(pair.posed.primitives[1].weight, 2);
  EXPECT_EQ(pair.posed.primitives[1].radius, 0.5);
}

TEST(Symmetry, WithoutEditsNothingChanges) {
  const auto pair = mirrorEdits(pairSkeletons(arms(), arms()), kMiddle);
  for (std::size_t i = 0; i < 2; ++i) EXPECT_EQ(pair.posed.primitives[i].points, arms().primitives[i].points);
  EXPECT_EQ(pair.rest.primitives.size(), 2u);
}

TEST(Symmetry, RefusesAnAxisThatIsNone) {
  EXPECT_THROW(mirrorEdits(pairSkeletons(arms(), arms()), {.axis = 3, .at = 0}), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::scene
