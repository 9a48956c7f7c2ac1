#include <fielddeform/core/random.h>
#include <fielddeform/core/rigid.h>
#include <fielddeform/skeleton/interpolate.h>
#include <gtest/gtest.h>

#include <cstring>

namespace fielddeform::skeleton {
namespace {

Primitive curve(std::string name, std::uint64_t seed, std::size_t count = 8) {
  Primitive p;
  p.name = std::move(name);
  p.radius = 1;
  for (std::size_t i = 0; i < count; ++i)
    p.points.push_back(Vec3(uniform01(seed, 3 * i), uniform01(seed, 3 * i + 1), uniform01(seed, 3 * i + 2)));
  return p;
}

bool sameBits(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(Vec3)) == 0;
}

TEST(Interpolate, EndsAreExact) {
  const SkeletonPair pair = pairSkeletons({{curve("a", 1), curve("b", 2)}, "{}"}, {{curve("b", 3), curve("c", 4)}, ""});
  const Skeleton start = interpolatePose(pair, 0), end = interpolatePose(pair, 1);
  ASSERT_EQ(start.primitives.size(), 2u);
  EXPECT_TRUE(sameBits(start.primitives[1].points, pair.rest.primitives[1].points));
  EXPECT_EQ(start.extras, "{}");
  ASSERT_EQ(end.primitives.size(), 2u);
  EXPECT_TRUE(sameBits(end.primitives[0].points, pair.posed.primitives[0].points));
}

TEST(Interpolate, ARigidMotionStaysRigidAllTheWay) {
  const Rigid motion{Quat(Eigen::AngleAxisd(2.5, Vec3(1, 2, 3).normalized())), Vec3(4, 5, -6)};
  Skeleton rest{{curve("a", 1)}, {}}, posed = rest;
  for (Vec3& x : posed.primitives[0].points) x = motion(x);
  const SkeletonPair pair = pairSkeletons(rest, posed);
  for (const double t : {0.1, 0.5, 0.9}) {
    const auto points = interpolatePose(pair, t).primitives[0].points;
    const Rigid expected = screwPower(motion, t);
    // The best rotation is exact to a few roundings of coordinates of size 10.
    for (std::size_t i = 0; i < points.size(); ++i) EXPECT_LT((points[i] - expected(rest.primitives[0].points[i])).norm(), 2e-14);
  }
}

TEST(Interpolate, AStretchGrowsLinearly) {
  // The corners of a box: its principal axes are the coordinate axes, so the best rotation is the identity.
  Skeleton rest{{curve("a", 1)}, {}};
  for (int i = 0; i < 8; ++i) rest.primitives[0].points[i] = Vec3(i & 1, 2 * (i >> 1 & 1), 3 * (i >> 2));
  Skeleton posed = rest;
  for (Vec3& x : posed.primitives[0].points) x.z() *= 3;
  const auto points = interpolatePose(pairSkeletons(rest, posed), 0.5).primitives[0].points;
  const auto z = [](const std::vector<Vec3>& p, std::size_t i) { return p[i].z() - p[0].z(); };
  for (std::size_t i = 0; i < points.size(); ++i) EXPECT_NEAR(z(points, i), 2 * z(rest.primitives[0].points, i), 1e-14);
}

TEST(Interpolate, UnmovedPrimitivesKeepTheirBits) {
  Skeleton rest{{curve("a", 1), curve("b", 2)}, {}}, posed = rest;
  posed.primitives[1].points[0] += Vec3(1, 0, 0);
  const Skeleton half = interpolatePose(pairSkeletons(rest, posed), 0.5);
  EXPECT_TRUE(sameBits(half.primitives[0].points, rest.primitives[0].points));
  EXPECT_FALSE(sameBits(half.primitives[1].points, rest.primitives[1].points));
}

TEST(Interpolate, ValuesGrowAndPrimitivesFade) {
  Skeleton rest{{curve("a", 1), curve("gone", 2)}, {}}, posed{{curve("new", 5), curve("a", 1)}, {}};
  posed.primitives[1].radius = 3;
  posed.primitives[1].pointRadius.assign(8, 2.0);
  posed.primitives[1].roll.assign(8, 1.0);
  posed.primitives[1].weight = 0;
  const Skeleton pose = interpolatePose(pairSkeletons(rest, posed), 0.25);
  ASSERT_EQ(pose.primitives.size(), 3u);
  EXPECT_EQ(pose.primitives[0].weight, 0.25);
  EXPECT_EQ(pose.primitives[1].radius, 1.5);
  EXPECT_EQ(pose.primitives[1].pointRadius[3], 1.25);
  EXPECT_EQ(pose.primitives[1].roll[3], 0.25);
  EXPECT_EQ(pose.primitives[1].weight, 0.75);
  EXPECT_EQ(pose.primitives[2].name, "gone");
  EXPECT_EQ(pose.primitives[2].weight, 0.75);
  EXPECT_NO_THROW(validate(pose));
}

TEST(Interpolate, NamesStayUniqueWhenPairsCross) {
  const std::vector<NamedPair> crossed = {{"a", "b"}};
  const SkeletonPair pair = pairSkeletons({{curve("a", 1), curve("b", 2)}, {}}, {{curve("b", 3)}, {}}, crossed);
  const Skeleton pose = interpolatePose(pair, 0.5);
  EXPECT_NO_THROW(validate(pose));
  EXPECT_EQ(pose.primitives[1].name, "b.removed");
  EXPECT_THROW(interpolatePose(pair, -0.1), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::skeleton
