// Poses of one rest side, one after the other: what is kept of it changes no bit.
#include <fielddeform/map/axial.h>
#include <fielddeform/map/barr_fit.h>
#include <fielddeform/map/casteljau_skeleton.h>
#include <fielddeform/map/influence.h>
#include <fielddeform/map/rbf_warp.h>
#include <fielddeform/map/skinning.h>
#include <fielddeform/map/wires.h>
#include <gtest/gtest.h>

#include <functional>

#include "classic.h"

namespace fielddeform::map {
namespace {

using namespace test;
using Maker = std::function<std::shared_ptr<const SpaceMap>(const SkeletonMotion&)>;

skeleton::Skeleton lines(double radius) {
  skeleton::Skeleton s = spine(17, radius);
  s.primitives.push_back(line("other", straight(Vec3(0.6, -0.2, -1), Vec3(0.5, 0.3, 1), 9), radius));
  return s;
}

skeleton::Skeleton posedAs(skeleton::Skeleton s, double t) {
  for (auto& p : s.primitives)
    for (Vec3& x : p.points) {
      p.roll.push_back(t * x.z());
      x += 0.3 * t * Vec3(std::sin(2 * x.z()), x.z() * x.z(), 0.2 * x.z());
    }
  return s;
}

std::vector<Vec3> imagesBy(const SpaceMap& map, const Binding& binding) {
  std::vector<Vec3> out(binding.size());
  Progress silent;
  map.apply(binding, {.position = out, .safe = {}, .status = {}, .residual = {}}, silent);
  return out;
}

bool sameBits(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  if (a.size() != b.size()) return false;
  for (std::size_t i = 0; i < a.size(); ++i)
    for (int k = 0; k < 3; ++k)
      if (!(a[i][k] == b[i][k]) && !(std::isnan(a[i][k]) && std::isnan(b[i][k]))) return false;
  return true;
}

void expectSameBits(const Maker& make) {
  std::vector<Vec3> points = cloud(31, 700, 1.1);
  points[5].x() = std::numeric_limits<double>::quiet_NaN();
  const skeleton::Skeleton rest = lines(0.7);
  std::shared_ptr<const Binding> last;
  for (const double t : {0.2, 0.6, 0.0, 1.0}) {  // the one without any edit among them
    const auto map = make(motionBetween(rest, posedAs(rest, t)));
    last = map->bindAgain(last.get(), points);
    EXPECT_TRUE(sameBits(imagesBy(*map, *last), imagesBy(*map, *map->bind(points)))) << t;
    std::vector<Mat3> a(points.size()), b(points.size());
    map->jacobians(*last, a);
    map->jacobians(*map->bind(points), b);
    EXPECT_EQ(a, b);
  }
  // What is of another rest side, of another map or of other points is not taken over.
  const skeleton::Skeleton other = lines(0.9);
  skeleton::Skeleton moved = other;
  for (Vec3& x : moved.primitives[0].points) x.x() += 0.1;
  const auto next = make(motionBetween(moved, posedAs(moved, 0.5)));
  EXPECT_TRUE(sameBits(imagesBy(*next, *next->bindAgain(last.get(), points)), imagesBy(*next, *next->bind(points))));
  const Points few = Points(points).first(99);
  EXPECT_TRUE(sameBits(imagesBy(*next, *next->bindAgain(last.get(), few)), imagesBy(*next, *next->bind(few))));
  const BarrMap foreign{BarrEdit{}};
  EXPECT_TRUE(sameBits(imagesBy(*next, *next->bindAgain(foreign.bind(points).get(), points)), imagesBy(*next, *next->bind(points))));
}

TEST(BindAgain, AxialDeformation) { expectSameBits([](const auto& m) { return std::make_shared<AxialMap>(m); }); }
TEST(BindAgain, Wires) { expectSameBits([](const auto& m) { return std::make_shared<WireMap>(m); }); }
TEST(BindAgain, LinearBlendSkinning) { expectSameBits([](const auto& m) { return std::make_shared<SkinningMap>(m); }); }
TEST(BindAgain, DualQuaternionSkinning) {
  expectSameBits([](const auto& m) { return std::make_shared<SkinningMap>(m, SkinOptions{.blend = SkinBlend::DualQuaternion}); });
}
TEST(BindAgain, SkinningWithinReach) {
  expectSameBits([](const auto& m) { return std::make_shared<SkinningMap>(m, SkinOptions{.potential = skeleton::Potential::Metaball}); });
}
TEST(BindAgain, DeCasteljauAlongOneLine) { expectSameBits([](const auto& m) { return std::make_shared<CasteljauMap>(casteljauAlong(m)); }); }
TEST(BindAgain, DeCasteljauAlongSeveral) { expectSameBits([](const auto& m) { return casteljauBy(m); }); }
TEST(BindAgain, WhatKeepsNothing) {
  expectSameBits([](const auto& m) {
    const PointPairs pairs = pointPairs(m);
    return std::make_shared<RbfWarp>(pairs.rest, pairs.posed);
  });
}
TEST(BindAgain, ConfinedToAZone) {
  const auto field = std::make_shared<const field::Field>(lines(0.7), field::FieldOptions{});
  expectSameBits([&](const auto& m) { return std::make_shared<ZonedMap>(std::make_shared<SkinningMap>(m), field, 0.5); });
}

}  // namespace
}  // namespace fielddeform::map
