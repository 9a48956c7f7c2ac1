#pragma once

#include <fielddeform/core/random.h>
#include <fielddeform/core/rigid.h>
#include <fielddeform/map/pointwise_map.h>
#include <fielddeform/map/skeleton_motion.h>
#include <fielddeform/skeleton/edit.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

/// What the tests of the classic maps share.
namespace fielddeform::map::test {

inline Vec3 randomPoint(std::uint64_t seed, std::uint64_t i, double size = 1) {
  return size * Vec3(2 * uniform01(seed, 3 * i) - 1, 2 * uniform01(seed, 3 * i + 1) - 1, 2 * uniform01(seed, 3 * i + 2) - 1);
}

inline std::vector<Vec3> cloud(std::uint64_t seed, std::size_t n, double size = 1) {
  std::vector<Vec3> p(n);
  for (std::size_t i = 0; i < n; ++i) p[i] = randomPoint(seed, i, size);
  return p;
}

inline skeleton::Primitive line(std::string name, std::vector<Vec3> points, double radius = 1) {
  skeleton::Primitive p;
  p.name = std::move(name);
  p.points = std::move(points);
  p.radius = radius;
  return p;
}

/// Evenly from a to b.
inline std::vector<Vec3> straight(const Vec3& a, const Vec3& b, int n) {
  std::vector<Vec3> p;
  for (int i = 0; i < n; ++i) p.push_back(a + static_cast<double>(i) / (n - 1) * (b - a));
  return p;
}

inline skeleton::Skeleton spine(int n = 65, double radius = 1) {
  skeleton::Skeleton s;
  s.primitives.push_back(line("spine", straight(Vec3(0, 0, -1), Vec3(0, 0, 1), n), radius));
  return s;
}

inline SkeletonMotion motionBetween(const skeleton::Skeleton& rest, const skeleton::Skeleton& posed) {
  return motionOf(skeleton::pairSkeletons(rest, posed), "test");
}

inline SkeletonMotion edited(const skeleton::Skeleton& rest, const std::vector<skeleton::Edit>& edits) {
  return motionBetween(rest, skeleton::applyEdits(rest, edits));
}

inline skeleton::Skeleton rigidlyMoved(skeleton::Skeleton s, const Rigid& motion) {
  for (auto& p : s.primitives)
    for (Vec3& x : p.points) x = motion(x);
  return s;
}

inline Vec3 image(const SpaceMap& map, const Vec3& x) {
  std::vector<Vec3> in{x}, out(1);
  Progress silent;
  map.apply(*map.bind(in), {.position = out, .safe = {}, .status = {}, .residual = {}}, silent);
  return out[0];
}

/// Jacobians against central differences, which err by h^2 / 6 of the third derivative and eps / h of rounding.
inline void expectJacobians(const SpaceMap& map, const std::vector<Vec3>& points, double tolerance = 2e-7) {
  std::vector<Mat3> j(points.size());
  map.jacobians(*map.bind(points), j);
  constexpr double h = 1e-5;
  for (std::size_t i = 0; i < points.size(); ++i) {
    Mat3 d;
    for (int k = 0; k < 3; ++k) d.col(k) = (image(map, points[i] + h * Vec3::Unit(k)) - image(map, points[i] - h * Vec3::Unit(k))) / (2 * h);
    EXPECT_LT((j[i] - d).norm(), tolerance * std::max(1.0, d.norm())) << points[i].transpose() << "\n" << j[i] << "\n" << d;
  }
}

/// Identity in, identity out: positions with their signs of zero, statuses, Jacobians.
inline void expectIdentity(const SpaceMap& map) {
  std::vector<Vec3> points = cloud(99, 50, 2);
  points.emplace_back(-0.0, 0.0, -0.0);
  std::vector<Vec3> out(points.size());
  std::vector<Status> status(points.size());
  std::vector<Mat3> j(points.size());
  Progress silent;
  const auto binding = map.bind(points);
  map.apply(*binding, {.position = out, .safe = {}, .status = status, .residual = {}}, silent);
  map.jacobians(*binding, j);
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(out[i][k], points[i][k]);
      EXPECT_EQ(std::signbit(out[i][k]), std::signbit(points[i][k]));
    }
    EXPECT_EQ(status[i], Status::Fixed);
    EXPECT_LT((j[i] - Mat3::Identity()).norm(), 1e-14);
  }
}

inline const Rigid& someMotion() {
  static const Rigid motion{Quat(Eigen::AngleAxisd(2.2, Vec3(1, 2, -1).normalized())), Vec3(0.99, -3, 2)};
  return motion;
}

}  // namespace fielddeform::map::test
