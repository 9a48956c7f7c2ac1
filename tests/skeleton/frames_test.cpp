#include <fielddeform/numeric/rotation.h>
#include <fielddeform/skeleton/edit.h>
#include <fielddeform/skeleton/frames.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace fielddeform::skeleton {
namespace {

// A line along z of length 4 that deviates by `sag` in x.
Skeleton spine(double sag) {
  Primitive p;
  p.name = "spine";
  p.radius = 1;
  for (int i = 0; i <= 32; ++i) {
    const double t = i / 32.0;
    p.points.push_back({sag * std::sin(3 * t), 0, 4 * t});
  }
  return {{p}, ""};
}

SampledPair frames(const Skeleton& rest, const Skeleton& posed) {
  SampledPair pair;
  pair.set = sampleSkeleton(rest);
  for (std::size_t j = 0; j < pair.set.samples.size(); ++j) {
    pair.rest.push_back(pair.set.position(rest, j));
    pair.posed.push_back(pair.set.position(posed, j));
  }
  fitFrames(pair, rest, posed);
  return pair;
}

TEST(Frames, ASlightCurveDoesNotSpinALineThatIsBentAnotherWay) {
  const Skeleton rest = spine(0.15);
  Bend bend;
  bend.spine = {.axis = Vec3(0, 0, 1), .pivot = Vec3(0, 0, 1.4), .from = 0.35, .to = 1};
  bend.angle = 1.2;
  for (const Vec3& about : {Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(1, 1, 0)}) {
    bend.about = about;
    const std::vector<Edit> edits{{"", bend}};
    const SampledPair pair = frames(rest, applyEdits(rest, edits));
    double greatest = 0;
    for (std::size_t j = 0; j < pair.rest.size(); ++j)
      if (pair.rest[j].z() < 1.3) greatest = std::max(greatest, 2 * pair.rotation[j].vec().norm());
    // The part below the bend does not move; what is left is the share of the evidence in an ambiguous case.
    EXPECT_LT(greatest, 0.06) << about.transpose();
  }
}

TEST(Frames, ARigidTurnOfACurvedLineAboutItselfIsFollowedExactly) {
  const Skeleton rest = spine(0.15);
  const Quat turn(Eigen::AngleAxisd(2.0, Vec3(0.1, 0.2, 1).normalized()));
  Skeleton posed = rest;
  for (Vec3& x : posed.primitives[0].points) x = turn * x + Vec3(1, 2, 3);
  const SampledPair pair = frames(rest, posed);
  for (const Quat& q : pair.rotation) EXPECT_LT(q.angularDistance(turn), 1e-7);
}

// A tube along z from 0 to 4 whose upper end closes in `around` needles.
Skeleton needleTube(Index around) {
  Primitive p;
  p.name = "tube";
  p.type = PrimitiveType::Mesh;
  p.radius = 1;
  constexpr Index kRings = 60;
  for (Index i = 0; i < kRings; ++i) {
    const double z = i < 40 ? 0.1 * i : 3.9 + 0.2 * std::sin(0.0785 * (i - 39)), r = i < 40 ? 0.2 : 0.2 * std::cos(0.0785 * (i - 39));
    for (Index j = 0; j < around; ++j) p.points.push_back({r * std::cos(2 * std::numbers::pi * j / around), r * std::sin(2 * std::numbers::pi * j / around), z});
  }
  p.points.push_back({0, 0, 4.1});
  const Index pole = kRings * around, last = pole - around;
  for (Index j = 0; j < around; ++j) {
    const Index k = (j + 1) % around;
    for (Index at = 0; at < last; at += around) p.faces.push_back({at + j, at + k, at + around + k, at + around + j});
    p.faces.push_back({last + j, last + k, pole});
  }
  return {{p}, ""};
}

TEST(Frames, NeedlesAroundAPoleTurnWithTheRigidPartThatTheyBelongTo) {
  const Skeleton rest = needleTube(200);
  Bend bend;
  bend.spine = {.axis = Vec3(0, 0, 1), .pivot = Vec3(0, 0, 2), .from = 0.3, .to = 0.6};
  bend.angle = 1.5;
  bend.about = Vec3(1, 0, 0);
  const std::vector<Edit> edits{{"", bend}};
  const Skeleton posed = applyEdits(rest, edits);
  const auto &from = rest.primitives[0].points, &to = posed.primitives[0].points;
  Mat3 c = Mat3::Zero();
  for (std::size_t v = 0; v < from.size(); ++v)
    if (from[v].z() > 3.5) c += (from[v] - from.back()) * (to[v] - to.back()).transpose();
  const Quat rigid = numeric::kabschQuaternion(c);
  const SampledPair pair = frames(rest, posed);
  ASSERT_GT(rigid.angularDistance(pair.global), 0.4);
  // The prior weighs 0.02 of a ring's second singular value, and leaves at most as much of the turn about a needle.
  for (std::size_t v = 0; v < from.size(); ++v)
    if (from[v].z() > 3.5) {
      EXPECT_LT(pair.rotation[pair.set.vertexSample[0][v]].angularDistance(rigid), 0.02) << v;
    }
}

TEST(Frames, AStraightLineTurnsByTheSmallestRotation) {
  const Skeleton rest = spine(0);
  const Quat turn = Quat::FromTwoVectors(Vec3(0, 0, 1), Vec3(1, 1, 1).normalized());
  Skeleton posed = rest;
  for (Vec3& x : posed.primitives[0].points) x = turn * x;
  const SampledPair pair = frames(rest, posed);
  for (const Quat& q : pair.rotation) EXPECT_LT(q.angularDistance(turn), 1e-7);
}

}  // namespace
}  // namespace fielddeform::skeleton
