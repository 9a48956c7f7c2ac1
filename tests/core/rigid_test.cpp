#include <fielddeform/core/random.h>
#include <fielddeform/core/rigid.h>
#include <gtest/gtest.h>

namespace fielddeform {
namespace {

Rigid someMotion(std::uint64_t i) {
  const Vec3 axis = Vec3(uniform01(i, 0) - 0.5, uniform01(i, 1) - 0.5, uniform01(i, 2) - 0.5).normalized();
  return {Quat(Eigen::AngleAxisd(3.1 * uniform01(i, 3), axis)), Vec3(uniform01(i, 4), uniform01(i, 5), uniform01(i, 6))};
}

double distance(const Rigid& a, const Rigid& b) {
  double d = 0;
  for (const Vec3& x : {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)}) d = std::max(d, (a(x) - b(x)).norm());
  return d;
}

TEST(Rigid, InverseUndoesTheMotion) {
  for (std::uint64_t i = 0; i < 50; ++i) EXPECT_LT(distance(someMotion(i) * someMotion(i).inverse(), Rigid{}), 1e-14);
}

TEST(Rigid, ScrewPowersAddUp) {
  for (std::uint64_t i = 0; i < 50; ++i) {
    const Rigid m = someMotion(i);
    EXPECT_LT(distance(screwPower(m, 0), Rigid{}), 1e-15);
    EXPECT_LT(distance(screwPower(m, 1), m), 1e-13);
    const Rigid third = screwPower(m, 1.0 / 3);
    EXPECT_LT(distance(third * third * third, m), 1e-13);
  }
}

TEST(Rigid, ScrewPowerOfATinyTurnIsContinuous) {
  const Rigid below{Quat(Eigen::AngleAxisd(1e-12, Vec3::UnitZ())), Vec3(1, 2, 3)};
  const Rigid above{Quat(Eigen::AngleAxisd(1e-11, Vec3::UnitZ())), Vec3(1, 2, 3)};
  EXPECT_LT(distance(screwPower(below, 0.5), screwPower(above, 0.5)), 1e-10);
}

TEST(Rigid, MinimalRotationTakesOneDirectionToTheOther) {
  for (std::uint64_t i = 0; i < 50; ++i) {
    const Vec3 a = someMotion(i).translation - Vec3(0.5, 0.5, 0.5), b = someMotion(i + 100).translation - Vec3(0.5, 0.5, 0.5);
    EXPECT_LT((minimalRotation(a, b) * a.normalized() - b.normalized()).norm(), 1e-14);
  }
  for (const double off : {1e-3, 1e-6, 1e-9}) {
    const Vec3 almost = Vec3(-1, off, 0).normalized();
    EXPECT_LT((minimalRotation(Vec3::UnitX(), almost) * Vec3::UnitX() - almost).norm(), 1e-15 / off + 1e-15) << off;
  }
  EXPECT_LT((minimalRotation(Vec3::UnitX(), -Vec3::UnitX()) * Vec3::UnitX() + Vec3::UnitX()).norm(), 1e-14);
  EXPECT_TRUE(minimalRotation(Vec3::Zero(), Vec3::UnitX()).isApprox(Quat::Identity()));
}

TEST(Rigid, BlendReproducesEndsAndEqualMotions) {
  const Rigid a = someMotion(1), b = someMotion(2);
  EXPECT_LT(distance(blend(a, b, 0), a), 1e-14);
  EXPECT_LT(distance(blend(a, b, 1), b), 1e-14);
  Rigid flipped = a;
  flipped.rotation.coeffs() *= -1;
  EXPECT_LT(distance(blend(a, flipped, 0.5), a), 1e-14);
}

}  // namespace
}  // namespace fielddeform
