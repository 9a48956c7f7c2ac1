#include <fielddeform/map/fitted_lattice.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "classic.h"

namespace fielddeform::map {
namespace {

using namespace test;

TEST(FittedLattice, AnUneditedSkeletonLeavesTheNodesWhereTheyAre) {
  const FittedLattice fit = fitLattice(edited(spine(), {}), cloud(1, 50));
  expectIdentity(LatticeMap(fit.lattice));
}

TEST(FittedLattice, RigidMotionsAreExact) {
  const skeleton::Skeleton rest = skeleton::applyEdits(spine(), std::vector<skeleton::Edit>{{"", skeleton::Bend{.spine = {.axis = Vec3(0, 0, 1), .pivot = Vec3::Zero()}, .angle = 1.5, .about = Vec3(0, 1, 0)}}});
  const FittedLattice fit = fitLattice(motionBetween(rest, rigidlyMoved(rest, someMotion())), cloud(1, 50));
  const LatticeMap map(fit.lattice);
  for (const Vec3& x : cloud(2, 50)) EXPECT_LT((map.position(x) - someMotion()(x)).norm(), 1e-11);
}

TEST(FittedLattice, CarriesTheSkeletonsPointsWithinItsReport) {
  const SkeletonMotion motion = edited(spine(33, 0.5), {{"", skeleton::Bend{.spine = {.axis = Vec3(0, 0, 1), .pivot = Vec3::Zero()}, .angle = 1.2, .about = Vec3(0, 1, 0)}}});
  const FittedLattice fit = fitLattice(motion, cloud(1, 50, 0.3), {.nodes = std::array<int, 3>{5, 5, 9}});
  const LatticeMap map(fit.lattice);
  double worst = 0;
  for (std::size_t i = 0; i < 33; ++i)
    worst = std::max(worst, (map.position(motion.rest.primitives[0].points[i]) - motion.posed.primitives[0].points[i]).norm());
  EXPECT_LE(worst, fit.report.largestMiss * (1 + 1e-9) + 1e-12);
  EXPECT_LT(worst, 0.01);
  EXPECT_EQ(fit.lattice.nodes(), (std::array<int, 3>{5, 5, 9}));
}

TEST(FittedLattice, NodesFollowTheBox) {
  std::vector<Vec3> points = straight(Vec3(-1, -0.2, -0.2), Vec3(1, 0.2, 0.2), 20);
  skeleton::Skeleton rest;
  rest.primitives.push_back(line("spine", straight(Vec3(-0.9, 0, 0), Vec3(0.9, 0, 0), 9), 0.2));
  const FittedLattice fit = fitLattice(edited(rest, {}), points);
  const auto n = fit.lattice.nodes();
  EXPECT_GT(n[0], 6);
  EXPECT_EQ(n[1], 4);
  EXPECT_EQ(n[2], 4);
  EXPECT_THROW(fitLattice(edited(rest, {}), points, {.nodes = std::array<int, 3>{1, 4, 4}}), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::map
