#include <fielddeform/core/parallel.h>
#include <fielddeform/core/random.h>
#include <fielddeform/map/rbf_warp.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

namespace fielddeform::map {
namespace {

Vec3 randomPoint(std::uint64_t seed, std::uint64_t i) {
  return {2 * uniform01(seed, 3 * i) - 1, 2 * uniform01(seed, 3 * i + 1) - 1, 2 * uniform01(seed, 3 * i + 2) - 1};
}

std::vector<Vec3> cloud(std::uint64_t seed, std::size_t n) {
  std::vector<Vec3> p(n);
  for (std::size_t i = 0; i < n; ++i) p[i] = randomPoint(seed, i);
  return p;
}

std::vector<Vec3> bent(const std::vector<Vec3>& p) {
  std::vector<Vec3> q;
  for (const Vec3& x : p) q.push_back(Vec3(std::sin(x.x()) * (1 + x.y()), 1 - std::cos(x.x()) * (1 + x.y()), x.z()));
  return q;
}

const Rigid kMotion{Quat(Eigen::AngleAxisd(2.2, Vec3(1, 2, -1).normalized())), Vec3(0.99, -3, 2)};

std::vector<Vec3> moved(const std::vector<Vec3>& p) {
  std::vector<Vec3> q;
  for (const Vec3& x : p) q.push_back(kMotion(x));
  return q;
}

TEST(RbfWarp, IsTheIdentityAtTimeZeroAndMeetsTheCentresAtTimeOne) {
  const auto rest = cloud(1, 80), posed = bent(rest);
  const RbfWarp warp(rest, posed);
  const RbfWarp start = warp.atTime(0), middle = warp.atTime(0.5);
  for (std::size_t j = 0; j < rest.size(); ++j) {
    EXPECT_EQ(start.position(rest[j]), rest[j]);
    EXPECT_LT((warp.position(rest[j]) - posed[j]).norm(), 1e-12);
    EXPECT_LT((middle.position(rest[j]) - 0.5 * (rest[j] + posed[j])).norm(), 1e-12);
  }
}

TEST(RbfWarp, AffineMotionsOfSpatialCentresAreExact) {
  Mat3 m;
  m << 2, 0.1, 0, 0.3, 0.5, -0.2, 0, 0.4, 1.1;
  const auto rest = cloud(2, 30);
  std::vector<Vec3> posed;
  for (const Vec3& p : rest) posed.push_back(m * p + Vec3(1, 2, 3));
  for (const RigidPart part : {RigidPart::BestRotation, RigidPart::None}) {
    const RbfWarp warp(rest, posed, {.rigidPart = part});
    for (std::uint64_t i = 0; i < 100; ++i) {
      const Vec3 p = 2 * randomPoint(3, i);
      EXPECT_LT((warp.position(p) - (m * p + Vec3(1, 2, 3))).norm(), 1e-12);
      EXPECT_LT((warp.jacobian(p) - m).norm(), 1e-12);
    }
  }
}

TEST(RbfWarp, RigidMotionsAreExactForFlatAndStraightCentresToo) {
  auto space = cloud(4, 20), plane = cloud(5, 20);
  for (Vec3& p : plane) p.z() = 0.3;
  for (const auto& rest : {space, plane}) {
    const RbfWarp warp(rest, moved(rest));
    EXPECT_EQ(warp.report().centres, 0u);  // recognised: nothing was solved
    for (std::uint64_t i = 0; i < 100; ++i)
      EXPECT_LT((warp.position(randomPoint(6, i)) - kMotion(randomPoint(6, i))).norm(), 1e-14);
  }
  // A line determines the motion but for the turn about itself: lengths and angles are kept.
  const std::vector<Vec3> line{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(3, 0, 0)};
  const RbfWarp warp(line, moved(line));
  const Mat3 j = warp.jacobian(Vec3(1, 2, 3));
  EXPECT_LT((j * j.transpose() - Mat3::Identity()).norm(), 1e-14);
  EXPECT_LT((warp.position(Vec3(2, 0, 0)) - kMotion(Vec3(2, 0, 0))).norm(), 1e-14);
}

TEST(RbfWarp, ShiftsHaveNoTurn) {
  auto line = cloud(7, 30);
  for (Vec3& p : line) p = Vec3(0.3, 0.1, 0.7) + p.x() * Vec3(0.2, -0.9, 0.5);
  for (const auto& rest : {cloud(7, 30), line}) {
    std::vector<Vec3> posed;
    for (const Vec3& p : rest) posed.push_back(p + Vec3(123.1, 56.7, -78.3));  // rounded to 1e-14
    const RbfWarp warp(rest, posed);
    EXPECT_EQ(warp.jacobian(Vec3(9, 9, 9)), Mat3::Identity());
    EXPECT_LT((warp.position(Vec3(9, 8, 7)) - Vec3(132.1, 64.7, -71.3)).norm(), 3e-14);
  }
}

TEST(RbfWarp, WithoutRigidPartAFlatSetChangesNothingAcross) {
  auto rest = cloud(8, 30);
  for (Vec3& p : rest) p.z() = 0;
  const RbfWarp warp(rest, bent(rest), {.rigidPart = RigidPart::None});
  for (const Vec3& p : rest) EXPECT_LT((warp.jacobian(p) * Vec3::UnitZ() - Vec3::UnitZ()).norm(), 1e-12);
}

TEST(RbfWarp, JacobianIsTheCentralDifference) {
  const auto rest = cloud(9, 60);
  const RbfWarp warp(rest, bent(rest), {.time = 0.7});
  const double h = 1e-5;
  for (std::uint64_t i = 0; i < 100; ++i) {
    const Vec3 p = randomPoint(10, i);
    for (int k = 0; k < 3; ++k) {
      const Vec3 d = (warp.position(p + h * Vec3::Unit(k)) - warp.position(p - h * Vec3::Unit(k))) / (2 * h);
      EXPECT_LT((warp.jacobian(p).col(k) - d).norm(), 1e-7);  // h^2 times third derivatives of r^3
    }
  }
}

TEST(RbfWarp, BindsOnceAndAppliesAtEveryTime) {
  const auto rest = cloud(11, 60);
  const RbfWarp warp(rest, bent(rest));
  auto points = cloud(12, 300);
  points[7].y() = std::numeric_limits<double>::quiet_NaN();
  for (const int threads : {1, 2, 7}) {
    const ThreadLimit limit(threads);
    const auto binding = warp.bind(points);
    for (const double t : {0.0, 0.25, 1.0}) {
      const RbfWarp at = warp.atTime(t);
      std::vector<Vec3> position(points.size()), safe(points.size());
      std::vector<Status> status(points.size());
      std::vector<float> residual(points.size());
      std::vector<Mat3> jacobian(points.size());
      Progress progress;
      at.apply(*binding, {position, safe, status, residual}, progress);
      at.jacobians(*binding, jacobian);
      for (std::size_t i = 0; i < points.size(); ++i) {
        if (i == 7) {
          EXPECT_EQ(status[i], Status::Invalid);
          EXPECT_EQ(position[i].x(), points[i].x());
          continue;
        }
        EXPECT_EQ(position[i], at.position(points[i]));
        EXPECT_EQ(safe[i], position[i]);
        EXPECT_EQ(status[i], t == 0 ? Status::Fixed : Status::Converged);
        EXPECT_EQ(jacobian[i], at.jacobian(points[i]));
        if (t == 0) {
          EXPECT_EQ(position[i], points[i]);
        }
      }
    }
  }
}

TEST(RbfWarp, UneditedCentresKeepEveryBit) {
  const auto rest = cloud(13, 20), points = cloud(14, 20);
  const RbfWarp warp(rest, rest);
  const auto binding = warp.bind(points);
  std::vector<Vec3> position(20);
  std::vector<Status> status(20);
  Progress progress;
  warp.apply(*binding, {position, {}, status, {}}, progress);
  EXPECT_EQ(position, points);
  EXPECT_EQ(countStatuses(status)[0], 20u);
}

TEST(RbfWarp, PowersOfTwoScaleEveryBit) {
  const auto rest = cloud(15, 40), posed = bent(rest);
  auto restScaled = rest, posedScaled = posed;
  for (Vec3& p : restScaled) p *= 1024;
  for (Vec3& p : posedScaled) p *= 1024;
  const RbfWarp warp(rest, posed), scaled(restScaled, posedScaled);
  for (std::uint64_t i = 0; i < 100; ++i) {
    const Vec3 p = randomPoint(16, i);
    EXPECT_EQ(Vec3(1024 * warp.position(p)), scaled.position(1024 * p));
    EXPECT_EQ(warp.jacobian(p), scaled.jacobian(1024 * p));
  }
}

TEST(RbfWarp, DegenerateCentresGiveNumbers) {
  const std::vector<Vec3> same(4, Vec3(1, 2, 3));
  const std::vector<Vec3> apart{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)};
  EXPECT_LT((RbfWarp(same, apart).position(Vec3(1, 2, 3)) - Vec3(0.25, 0.25, 0.25)).norm(), 1e-14);
  EXPECT_TRUE(RbfWarp(apart, same).position(Vec3(4, 5, 6)).allFinite());
  const std::vector<Vec3> one{Vec3(1, 1, 1)}, other{Vec3(2, 3, 4)};
  EXPECT_EQ(RbfWarp(one, other).position(Vec3(0, 0, 0)), Vec3(1, 2, 3));
}

TEST(RbfWarp, BadInputIsRefused) {
  const auto rest = cloud(17, 10), posed = bent(rest);
  EXPECT_THROW(RbfWarp({}, {}), std::invalid_argument);
  EXPECT_THROW(RbfWarp(rest, Points(posed.data(), 9)), std::invalid_argument);
  EXPECT_THROW(RbfWarp(rest, posed, {.time = std::nan("")}), std::invalid_argument);
  EXPECT_THROW(RbfWarp(rest, posed, {.smoothing = -1}), std::invalid_argument);
  EXPECT_THROW(RbfWarp(rest, posed, {.maxCentres = 9}), std::invalid_argument);
  auto bad = posed;
  bad[3].x() = std::numeric_limits<double>::infinity();
  EXPECT_THROW(RbfWarp(rest, bad), std::invalid_argument);
  const RbfWarp a(rest, posed), b(rest, rest);
  std::vector<Vec3> position(10), few(9);
  Progress progress;
  EXPECT_THROW(b.apply(*a.bind(rest), {position, {}, {}, {}}, progress), std::invalid_argument);
  EXPECT_THROW(a.apply(*a.bind(rest), {few, {}, {}, {}}, progress), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::map
