#include <fielddeform/skeleton/edit.h>
#include <fielddeform/skeleton/frames.h>
#include <gtest/gtest.h>

#include <cmath>

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
