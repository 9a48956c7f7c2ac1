// The whole field in one grid, and grids that follow a mesh.
#include <fielddeform/core/parallel.h>
#include <fielddeform/field/field.h>
#include <gtest/gtest.h>
#include <tests/support/central_difference.h>

#include <cmath>
#include <stdexcept>

#include "skeletons.h"

namespace fielddeform::field {
namespace {

using skeleton::Primitive;
using skeleton::Skeleton;

Skeleton several() {
  Skeleton s;
  s.primitives = {cube("c", 0.4, 0.7), polyline("l", wavyLine(6), 0.6), pointSet("p", {{0.9, 0.6, 0.2}}, 0.8)};
  s.primitives[2].weight = 1.5;
  return s;
}

Skeleton lines() {
  Skeleton s = several();
  s.primitives.erase(s.primitives.begin());
  return s;
}

FieldOptions blendOf(double voxel, Sampling sampling = Sampling::Trilinear) {
  FieldOptions o;
  o.distance.kind = Distance::Grid;
  o.distance.grid.voxel = voxel;
  o.distance.grid.sampling = sampling;
  o.distance.grid.of = GridOf::Blend;
  return o;
}

double nearestOf(const Field& field, const Vec3& p) {
  double nearest = HUGE_VAL;
  for (std::size_t i = 0; i < field.primitiveCount(); ++i) nearest = std::min(nearest, std::abs(field.closest(i, p).distance));
  return nearest;
}

class BlendGrid : public ::testing::Test {
  void SetUp() override {
    if (!gridsAvailable()) GTEST_SKIP() << "built without OpenVDB";
  }
};

TEST_F(BlendGrid, StaysWithinItsBoundEverywhere) {
  const Field grid(several(), blendOf(0.05)), exact(several());
  const DistanceReport r = *grid.blendReport();
  EXPECT_EQ(r.kind, Distance::Grid);
  EXPECT_EQ(grid.distanceReport(0).kind, Distance::Exact);
  double worst = 0;
  for (std::uint64_t i = 0; i < 4000; ++i) {
    const Vec3 p = randomPoint(51, i, 1.8);
    const FieldValue a = grid.evaluate(p), b = exact.evaluate(p);
    worst = std::max(worst, std::abs(a.pseudoDistance - b.pseudoDistance));
    if (std::abs(b.pseudoDistance - exact.referenceRadius()) > 0.05) {
      EXPECT_EQ(a.inside, b.inside);
    }
    // S and D say the same: S = E(k D / R).
    if (a.inside) {
      EXPECT_NEAR(grid.pseudoDistanceOf(a.sum), a.pseudoDistance, 1e-9);
    }
  }
  EXPECT_LE(worst, *r.kinkError);
  // What is said to have been measured is of the size of what is met elsewhere.
  EXPECT_LT(worst, 2 * r.measuredError);
  EXPECT_GT(worst, 0.2 * r.measuredError);
  EXPECT_LE(r.measuredError, *r.kinkError);
}

TEST_F(BlendGrid, NearAPrimitiveItIsTheExactField) {
  const Field grid(several(), blendOf(0.06)), exact(several());
  const double near = grid.blendReport()->exactWithin;
  EXPECT_NEAR(near, 0.18, 1e-12);
  int used = 0;
  for (std::uint64_t i = 0; i < 6000; ++i) {
    const Vec3 p = randomPoint(52, i, 1);
    if (nearestOf(exact, p) > near) continue;
    ++used;
    EXPECT_EQ(grid.evaluate(p).pseudoDistance, exact.evaluate(p).pseudoDistance);
    EXPECT_EQ(grid.evaluate(p).gradient, exact.evaluate(p).gradient);
  }
  EXPECT_GT(used, 300);
}

TEST_F(BlendGrid, GradientIsTheCentralDifference) {
  Skeleton radii = several();
  giveRadii(radii.primitives[1], 0.4, 0.6);
  for (const Sampling sampling : {Sampling::Trilinear, Sampling::Quadratic})
    for (const Skeleton& s : {several(), radii}) {
      const Field field(s, blendOf(0.09, sampling));
      const auto pseudoDistance = [&](const Vec3& at) { return field.evaluate(at).pseudoDistance; };
      int used = 0;
      for (std::uint64_t i = 0; i < 1500; ++i) {
        const Vec3 x = randomPoint(53, i, 1.2);
        const FieldValue v = field.evaluate(x);
        const auto central = test::centralDifference(pseudoDistance, x);
        if (!central) continue;  // a face between voxels
        ++used;
        EXPECT_LT((*central - v.gradient).norm(), 1e-6 * (1 + v.gradient.norm()));
      }
      EXPECT_GT(used, 1300);
    }
}

TEST_F(BlendGrid, TheVoxelFollowsFromTheTolerance) {
  for (const double tolerance : {5e-2, 2e-2}) {
    FieldOptions o = blendOf(1);
    o.distance.grid.voxel.reset();
    o.distance.grid.tolerance = tolerance;
    const Field field(lines(), o);
    const double wanted = tolerance * field.referenceRadius();
    EXPECT_LE(*field.blendReport()->smoothError, wanted + 1e-6);  // of floats
    EXPECT_GT(*field.blendReport()->smoothError, 0.9 * wanted);
  }
}

TEST_F(BlendGrid, OtherPotentialsHaveAMeasuredErrorOnly) {
  for (const auto potential : {skeleton::Potential::Gaussian, skeleton::Potential::Metaball, skeleton::Potential::SoftObject}) {
    FieldOptions o = blendOf(0.05), plain;
    o.potential = plain.potential = potential;
    const Field grid(several(), o), exact(several(), plain);
    EXPECT_FALSE(grid.blendReport()->smoothError);
    EXPECT_FALSE(grid.blendReport()->kinkError);
    EXPECT_GT(grid.blendReport()->measuredError, 0);
    double sum = 0;
    for (std::uint64_t i = 0; i < 1000; ++i) {
      const Vec3 p = randomPoint(54, i, 1.5);
      sum += std::abs(grid.evaluate(p).pseudoDistance - exact.evaluate(p).pseudoDistance);
    }
    EXPECT_LT(sum / 1000, 5e-3);
  }
}

TEST_F(BlendGrid, MoreMemoryThanAllowedIsRefusedWithTheNumber) {
  for (const double voxel : {2e-3, 1e-12, 1e-300}) {
    FieldOptions o = blendOf(voxel);
    o.distance.grid.maxMegabytes = 30;
    o.distance.grid.takenMegabytes = 10;
    try {
      Field field(several(), o);
      FAIL() << voxel;
    } catch (const std::invalid_argument& problem) {
      const std::string text = problem.what();
      EXPECT_NE(text.find("the whole field needs about"), std::string::npos) << text;
      EXPECT_NE(text.find("must be <= 20 MB, what other grids left of 30 MB"), std::string::npos) << text;
    }
  }
}

TEST_F(BlendGrid, PowersOfTwoAndThreadsChangeNoBit) {
  Skeleton t = several();
  for (Primitive& p : t.primitives) {
    for (Vec3& x : p.points) x *= 1024;
    *p.radius *= 1024;
  }
  FieldOptions o = blendOf(1);
  o.distance.grid.voxel.reset();
  o.distance.grid.tolerance = 0.05;
  const Field a(several(), o);
  const ThreadLimit limit(4);
  const Field b(t, o);
  for (std::uint64_t i = 0; i < 500; ++i) {
    const Vec3 p = randomPoint(55, i, 1.5);
    EXPECT_EQ(1024 * a.evaluate(p).pseudoDistance, b.evaluate(1024 * p).pseudoDistance);
    EXPECT_EQ(a.evaluate(p).gradient, b.evaluate(1024 * p).gradient);
    EXPECT_EQ(a.evaluate(p).sum, b.evaluate(1024 * p).sum);
  }
}

TEST_F(BlendGrid, WithoutAWeightThereIsNoField) {
  Skeleton s = several();
  for (Primitive& p : s.primitives) p.weight = 0;
  const Field field(s, blendOf(0.05));
  EXPECT_FALSE(field.blendReport());
  EXPECT_EQ(field.evaluate(Vec3(0.1, 0, 0)).pseudoDistance, HUGE_VAL);
}

// Grids near given points: the same samples there, the exact field elsewhere, and less memory.
TEST_F(BlendGrid, AroundPointsItIsTheSameAndElsewhereExact) {
  std::vector<Vec3> around;
  for (std::uint64_t i = 0; i < 500; ++i) around.push_back(0.9 * randomPoint(56, i).normalized());
  around.push_back(Vec3(std::nan(""), 0, 0));
  around.push_back(Vec3(1e300, 0, 0));
  for (const GridOf of : {GridOf::Primitives, GridOf::Blend})
    for (const Sampling sampling : {Sampling::Trilinear, Sampling::Quadratic}) {
      FieldOptions o = blendOf(0.03, sampling);
      o.distance.grid.of = of;
      const Field whole(lines(), o), part(lines(), o, around), exact(lines());
      EXPECT_LT(part.gridMegabytes(), whole.gridMegabytes());
      // Three voxels are kept around a point, and two of them serve a stencil; whole leaves are eight wide.
      const double farthest = (3 + 8) * 0.03 * std::sqrt(3);
      for (std::size_t i = 0; i < 500; ++i) {
        const Vec3 p = around[i] + 0.9 * 0.03 * randomPoint(57, i);
        EXPECT_EQ(part.evaluate(p).pseudoDistance, whole.evaluate(p).pseudoDistance) << toString(of);
        EXPECT_EQ(part.evaluate(p).gradient, whole.evaluate(p).gradient);
      }
      int used = 0;
      for (std::uint64_t i = 0; i < 2000; ++i) {
        const Vec3 p = randomPoint(58, i, 1.4);
        if (std::abs(p.norm() - 0.9) < farthest) continue;
        ++used;
        EXPECT_EQ(part.evaluate(p).pseudoDistance, exact.evaluate(p).pseudoDistance) << toString(of);
        EXPECT_EQ(part.evaluate(p).gradient, exact.evaluate(p).gradient);
      }
      EXPECT_GT(used, 200);
      if (sampling == Sampling::Quadratic) continue;
      o.distance.grid.around = GridAround::Influence;
      EXPECT_EQ(Field(lines(), o, around).gridMegabytes(), whole.gridMegabytes());
    }
}

TEST_F(BlendGrid, AroundPointsIsRefusedByWhatItNeedsItself) {
  FieldOptions o = blendOf(2e-3);
  o.distance.grid.maxMegabytes = 30;
  const std::vector<Vec3> few{{0.9, 0, 0}, {0, 0.9, 0}};
  EXPECT_THROW(Field(lines(), o), std::invalid_argument);
  EXPECT_LT(Field(lines(), o, few).gridMegabytes(), 3);
  std::vector<Vec3> many;
  for (std::uint64_t i = 0; i < 30000; ++i) many.push_back(randomPoint(59, i));
  EXPECT_THROW(Field(lines(), o, many), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::field
