#include <fielddeform/map/casteljau_skeleton.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "classic.h"

namespace fielddeform::map {
namespace {

using namespace test;

std::vector<Vec3> applied(const SpaceMap& map, Points points, std::vector<Status>* status = nullptr) {
  std::vector<Vec3> out(points.size());
  std::vector<Status> s(points.size());
  Progress silent;
  map.apply(*map.bind(points), {.position = out, .safe = {}, .status = s, .residual = {}}, silent);
  if (status) *status = s;
  return out;
}

/// A ring about z that is not flat: its frames miss their start after one round.
skeleton::Primitive ring(int n, double wave, double radius = 0.5) {
  std::vector<Vec3> points;
  for (int i = 0; i < n; ++i) {
    const double a = 2 * std::acos(-1.0) * i / n;
    points.emplace_back(std::cos(a), std::sin(a), wave * std::sin(2 * a));
  }
  skeleton::Primitive p = line("ring", points, radius);
  p.closed = true;
  return p;
}

std::vector<Vec3> nearRing(std::size_t n) {
  std::vector<Vec3> out;
  for (const Vec3& p : cloud(21, n)) {
    const double a = 3.14 * p.x();
    out.push_back((1 + 0.2 * p.y()) * Vec3(std::cos(a), std::sin(a), 0) + Vec3(0, 0, 0.2 * p.z()));
  }
  return out;
}

TEST(CasteljauLines, ClosedLinesGiveClosedCurvesWithoutASeam) {
  skeleton::Skeleton rest;
  rest.primitives.push_back(ring(24, 0.2));
  // Unedited: every bit. Rigidly moved: rigidly.
  const std::vector<Vec3> near = nearRing(300);
  EXPECT_EQ(applied(casteljauAlong(motionBetween(rest, rest)), near), near);
  const CasteljauMap rigid = casteljauAlong(motionBetween(rest, rigidlyMoved(rest, someMotion())));
  std::vector<Status> status;
  const std::vector<Vec3> moved = applied(rigid, near, &status);
  EXPECT_EQ(countStatuses(status)[static_cast<std::size_t>(Status::Converged)], near.size());
  for (std::size_t i = 0; i < near.size(); ++i) EXPECT_LT((moved[i] - someMotion()(near[i])).norm(), 1e-12);
  // A ring pulled to an oval out of its plane: C1 at the first point as anywhere else.
  skeleton::Skeleton posed = rest;
  for (Vec3& p : posed.primitives[0].points) p = Vec3(1.3 * p.x(), 0.8 * p.y() + 0.1, p.z() + 0.2 * p.x() * p.x());
  const CasteljauMap oval = casteljauAlong(motionBetween(rest, posed));
  for (const double across : {-0.15, 0.1}) {
    const std::vector<Vec3> sides{Vec3(1 + across, 1e-9, 0.05), Vec3(1 + across, -1e-9, 0.05)};
    const std::vector<Vec3> out = applied(oval, sides);
    EXPECT_LT((out[0] - out[1]).norm(), 1e-8);
    std::vector<Mat3> j(2);
    oval.jacobians(*oval.bind(sides), j);
    EXPECT_LT((j[0] - j[1]).norm(), 1e-6);
    EXPECT_GT((j[0] - Mat3::Identity()).norm(), 0.1);
  }
  const CasteljauPair loop = curvesAlong(rest.primitives[0].points, posed.primitives[0].points, {}, {}, true);
  for (const CasteljauCurve* c : {&loop.rest, &loop.posed}) {
    EXPECT_EQ(c->pieces.size(), 24u);
    EXPECT_EQ(c->pieces.front().points.front(), c->pieces.back().points.back());
    EXPECT_EQ(c->pieces.front().s[0].front(), c->pieces.back().s[0].back());
  }
  EXPECT_THROW(curvesAlong(std::vector<Vec3>(2, Vec3::UnitX()), std::vector<Vec3>(2, Vec3::UnitX()), {}, {}, true), std::invalid_argument);
}

/// Two lines side by side, far enough for each to have its own way.
skeleton::Skeleton twoLines() {
  skeleton::Skeleton s;
  s.primitives.push_back(line("left", straight(Vec3(-1, 0, -1), Vec3(-1, 0, 1), 9), 0.5));
  s.primitives.push_back(line("right", straight(Vec3(1, 0, -1), Vec3(1, 0, 1), 9), 0.5));
  return s;
}

TEST(CasteljauLines, SeveralLinesShareSpaceAndOneHasItForItself) {
  const skeleton::Skeleton rest = twoLines();
  const std::vector<Vec3> points = cloud(4, 300, 1.2);
  EXPECT_EQ(applied(*casteljauBy(motionBetween(rest, rest)), points), points);
  const auto rigid = casteljauBy(motionBetween(rest, rigidlyMoved(rest, someMotion())));
  for (const Vec3& p : points) EXPECT_LT((image(*rigid, p) - someMotion()(p)).norm(), 1e-12);
  // The right one bent: near each line what that line does, to the other's share exp(-4 * 2 / 0.5) or so.
  skeleton::Skeleton posed = rest;
  for (Vec3& p : posed.primitives[1].points) p.x() += 0.3 * p.z() * p.z();
  const SkeletonMotion motion = motionBetween(rest, posed);
  const CasteljauLines both(motion);
  const CasteljauMap right = casteljauAlong(motion, 1);
  for (const double z : {-0.7, 0.0, 0.6}) {
    EXPECT_LT((image(both, Vec3(1, 0, z)) - image(right, Vec3(1, 0, z))).norm(), 1e-5);
    EXPECT_LT((image(both, Vec3(-1, 0.05, z)) - Vec3(-1, 0.05, z)).norm(), 1e-5);
  }
  std::vector<Vec3> some = cloud(14, 30, 0.8);
  expectJacobians(both, some, 1e-6);
}

TEST(CasteljauLines, RefusesWhatIsNoLineAndSaysWhich) {
  skeleton::Skeleton s = twoLines();
  skeleton::Primitive cloud;
  cloud.name = "dots";
  cloud.type = skeleton::PrimitiveType::Points;
  cloud.points = {Vec3::Zero(), Vec3::UnitX()};
  cloud.radius = 1;
  s.primitives.push_back(cloud);
  try {
    casteljauBy(motionBetween(s, s));
    ADD_FAILURE();
  } catch (const std::invalid_argument& problem) {
    EXPECT_NE(std::string(problem.what()).find("'dots'"), std::string::npos) << problem.what();
  }
  EXPECT_THROW(CasteljauLines(motionBetween(twoLines(), twoLines()), 0), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::map
