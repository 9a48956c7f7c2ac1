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

Skeleton of(std::vector<Primitive> primitives) {
  Skeleton s;
  s.primitives = std::move(primitives);
  return s;
}

FieldOptions gridOf(double voxel, Sampling sampling = Sampling::Trilinear) {
  FieldOptions o;
  o.distance.kind = Distance::Grid;
  o.distance.grid.voxel = voxel;
  o.distance.grid.sampling = sampling;
  return o;
}

// Greatest error of D where the closest point is unique: inside the radius and outside what is taken exactly.
double worstError(const Skeleton& s, const FieldOptions& options, double gradientTolerance = 1) {
  const Field grid(s, options), exact(s);
  double worst = 0;
  int used = 0;
  for (std::uint64_t i = 0; i < 4000; ++i) {
    const Vec3 p = randomPoint(21, i, 1.6);
    const FieldValue a = grid.evaluate(p), b = exact.evaluate(p);
    EXPECT_NEAR(a.gradient.norm(), b.gradient.norm(), gradientTolerance) << p.transpose();
    if (!b.inside || b.pseudoDistance < 0.3) continue;
    ++used;
    worst = std::max(worst, std::abs(a.pseudoDistance - b.pseudoDistance));
  }
  EXPECT_GT(used, 500);
  return worst;
}

class Grid : public ::testing::Test {
  void SetUp() override {
    if (!gridsAvailable()) GTEST_SKIP() << "built without OpenVDB";
  }
};

// A point and a segment: the distance is smooth all round, its second derivatives are 1 / d.
TEST_F(Grid, ErrorIsOfSecondOrderInTheVoxelAndWithinTheBound) {
  for (const Primitive& p : {pointSet("p", {{0.1, 0, 0}}, 1), polyline("l", {{-0.4, 0, 0.1}, {0.4, 0.1, 0}}, 1)}) {
    std::vector<double> errors;
    for (const double voxel : {0.1, 0.05, 0.025}) {
      errors.push_back(worstError(of({p}), gridOf(voxel)));
      const DistanceReport r = Field(of({p}), gridOf(voxel)).distanceReport(0);
      ASSERT_TRUE(r.smoothError);
      // Where the error is taken, at 0.3 and beyond, the bound h^2 / 4 d is smaller than the report's at exactWithin.
      EXPECT_LE(errors.back(), voxel * voxel / (4 * (0.3 - 1.8 * voxel)) + 1e-7);
      EXPECT_LE(r.exactWithin, 0.3 + 1e-12);
    }
    EXPECT_GT(errors[0] / errors[1], 3.2);  // 4 in the limit
    EXPECT_GT(errors[1] / errors[2], 3.5);
  }
}

TEST_F(Grid, QuadraticSamplingIsOfThirdOrder) {
  const Skeleton s = of({pointSet("p", {{0.1, 0, 0}}, 1)});
  const double a = worstError(s, gridOf(0.1, Sampling::Quadratic)), b = worstError(s, gridOf(0.05, Sampling::Quadratic)),
               c = worstError(s, gridOf(0.025, Sampling::Quadratic));
  EXPECT_GT(a / b, 5);  // 8 in the limit
  EXPECT_GT(b / c, 6.5);
  EXPECT_LT(b, 0.2 * worstError(s, gridOf(0.05)));
}

TEST_F(Grid, AtKinksTheErrorStaysWithinItsBound) {
  Primitive cage = cube("c", 0.5, 1);
  for (const Primitive& p : {cage, polyline("l", wavyLine(8), 0.8), patch("m", 3, 0.8), pointSet("p", wavyLine(4), 0.7)}) {
    const double voxel = 0.06;
    const Field grid(of({p}), gridOf(voxel)), exact(of({p}));
    const double bound = *grid.distanceReport(0).kinkError;
    EXPECT_NEAR(bound, std::sqrt(0.75) * voxel, 1e-6);
    for (std::uint64_t i = 0; i < 3000; ++i) {
      const Vec3 x = randomPoint(22, i, 1.5);
      EXPECT_NEAR(grid.evaluate(x).pseudoDistance, exact.evaluate(x).pseudoDistance, bound) << p.name;
    }
  }
}

TEST_F(Grid, NearThePrimitiveItIsTheExactDistance) {
  const Skeleton s = of({polyline("l", wavyLine(8), 0.8)});
  const Field grid(s, gridOf(0.05)), exact(s);
  const double near = grid.distanceReport(0).exactWithin;
  EXPECT_NEAR(near, 0.15, 1e-12);
  int used = 0;
  for (std::uint64_t i = 0; i < 20000; ++i) {
    const Vec3 x = randomPoint(23, i, 1);
    const FieldValue v = exact.evaluate(x);
    // The grid's own value decides, which may be off by the kink's bound.
    if (v.pseudoDistance > near - 0.05) continue;
    ++used;
    EXPECT_EQ(grid.evaluate(x).pseudoDistance, v.pseudoDistance);
    EXPECT_EQ(grid.evaluate(x).gradient, v.gradient);
  }
  EXPECT_GT(used, 100);
}

TEST_F(Grid, GradientIsTheCentralDifference) {
  Primitive radii = polyline("l", wavyLine(8), 0.8);
  giveRadii(radii, 0.5, 0.8);
  for (const Sampling sampling : {Sampling::Trilinear, Sampling::Quadratic})
    for (const Primitive& p : {polyline("l", wavyLine(8), 0.8), cube("c", 0.5, 1), radii}) {
      const Field field(of({p}), gridOf(0.07, sampling));
      const auto pseudoDistance = [&](const Vec3& at) { return field.evaluate(at).pseudoDistance; };
      int used = 0;
      for (std::uint64_t i = 0; i < 1500; ++i) {
        const Vec3 x = randomPoint(24, i, 1.2);
        const FieldValue v = field.evaluate(x);
        const auto central = test::centralDifference(pseudoDistance, x);
        if (!central) continue;  // a face between voxels
        ++used;
        EXPECT_LT((*central - v.gradient).norm(), 1e-6 * (1 + v.gradient.norm())) << p.name;
      }
      EXPECT_GT(used, 1300);
    }
}

TEST_F(Grid, VoxelFollowsFromTheTolerance) {
  for (const double tolerance : {1e-2, 2e-3}) {
    FieldOptions o;
    o.distance.kind = Distance::Grid;
    o.distance.grid.tolerance = tolerance;
    const Skeleton s = of({pointSet("p", {{0, 0, 0}}, 0.5)});
    const Field field(s, o);
    const DistanceReport r = field.distanceReport(0);
    EXPECT_EQ(r.kind, Distance::Grid);
    // With few voxels in a radius the exact part grows to three of them, and the bound falls below what was asked.
    EXPECT_LE(*r.smoothError, tolerance * 0.5 * (1 + 1e-9) + 1e-7);
    EXPECT_GT(*r.smoothError, tolerance * 0.5 * 0.2);
    const Field exact(s);
    for (std::uint64_t i = 0; i < 1000; ++i) {
      const Vec3 x = randomPoint(25, i, 0.5);
      EXPECT_NEAR(field.evaluate(x).pseudoDistance, exact.evaluate(x).pseudoDistance, *r.smoothError);
    }
  }
}

TEST_F(Grid, MoreMemoryThanAllowedIsRefusedWithTheNumber) {
  const Skeleton s = of({polyline("spine", wavyLine(8), 0.8)});
  for (const double voxel : {1e-3, 1e-6, 1e-12, 1e-300}) {
    FieldOptions o = gridOf(voxel);
    o.distance.grid.maxMegabytes = 20;
    try {
      Field field(s, o);
      FAIL() << voxel;
    } catch (const std::invalid_argument& problem) {
      const std::string text = problem.what();
      EXPECT_NE(text.find("\"spine\" needs about"), std::string::npos) << text;
      EXPECT_NE(text.find("must be <= 20 MB"), std::string::npos) << text;
    }
  }
  FieldOptions o = gridOf(0.05);
  o.distance.grid.maxMegabytes = 20;
  const DistanceReport r = Field(s, o).distanceReport(0);
  EXPECT_LT(r.megabytes, 20);
  EXPECT_GE(r.megabytes, 4e-6 * static_cast<double>(r.voxels));
}

TEST_F(Grid, PowersOfTwoScaleEveryBit) {
  Skeleton s = of({polyline("l", wavyLine(6), 0.6), cube("c", 0.4, 0.5)}), t = s;
  for (Primitive& p : t.primitives) {
    for (Vec3& x : p.points) x *= 1024;
    *p.radius *= 1024;
  }
  FieldOptions o;
  o.distance.kind = Distance::Grid;
  o.distance.grid.tolerance = 0.05;
  const Field a(s, o), b(t, o);
  for (std::uint64_t i = 0; i < 500; ++i) {
    const Vec3 p = randomPoint(26, i, 1.2);
    EXPECT_EQ(1024 * a.evaluate(p).pseudoDistance, b.evaluate(1024 * p).pseudoDistance);
    EXPECT_EQ(a.evaluate(p).gradient, b.evaluate(1024 * p).gradient);
  }
}

TEST_F(Grid, ThreadsAndDegenerateSkeletonsChangeNothing) {
  Skeleton s = of({polyline("a", {{1, 1, 1}, {1, 1, 1}}, 0.5), cube("b", 0, 0.5), cube("hole", 0.5, 0.4)});
  s.primitives[2].faces.pop_back();
  std::vector<double> values[2];
  for (const int threads : {1, 4}) {
    const ThreadLimit limit(threads);
    const Field field(s, gridOf(0.1));
    for (std::uint64_t i = 0; i < 300; ++i) {
      const FieldValue v = field.evaluate(i == 0 ? Vec3(1, 1, 1) : randomPoint(27, i, 1.5));
      EXPECT_TRUE(std::isfinite(v.pseudoDistance) && v.gradient.allFinite());
      values[threads > 1].push_back(v.pseudoDistance);
    }
  }
  EXPECT_EQ(values[0], values[1]);
}

TEST_F(Grid, BadOptionsAreRefused) {
  const Skeleton s = of({polyline("a", wavyLine(3), 0.5)});
  for (const double bad : {0.0, -1.0, std::nan(""), HUGE_VAL}) EXPECT_THROW(Field(s, gridOf(bad)), std::invalid_argument);
  FieldOptions o;
  o.distance.kind = Distance::Grid;
  o.distance.grid.tolerance = 0.5;
  EXPECT_THROW(Field(s, o), std::invalid_argument);
}

TEST(GridUnavailable, IsSaid) {
  if (gridsAvailable()) GTEST_SKIP() << "built with OpenVDB";
  EXPECT_THROW(Field(of({polyline("a", wavyLine(3), 0.5)}), gridOf(0.1)), std::runtime_error);
}

}  // namespace
}  // namespace fielddeform::field
