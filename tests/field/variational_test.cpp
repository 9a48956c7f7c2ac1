#include <fielddeform/field/field.h>
#include <gtest/gtest.h>
#include <tests/support/central_difference.h>

#include <algorithm>
#include <cmath>

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

FieldOptions fitted(std::size_t centres) {
  FieldOptions o;
  o.distance.kind = Distance::Variational;
  o.distance.variational.centres = centres;
  return o;
}

std::vector<Primitive> everyType() {
  return {pointSet("p", {{0.1, 0, 0}, {-0.6, 0.1, 0.2}}, 0.5), polyline("l", wavyLine(12), 0.5), patch("m", 4, 0.5), cube("c", 0.6, 0.5)};
}

struct Errors {
  double mean = 0, worst = 0;  // in radii, within 0.8 radii
};

Errors errorsOf(const Primitive& p, const FieldOptions& options) {
  const Field field(of({p}), options), exact(of({p}));
  Errors e;
  int used = 0;
  for (std::uint64_t i = 0; i < 2000; ++i) {
    const Vec3 x = randomPoint(31, i, 1.3);
    const double wanted = exact.evaluate(x).pseudoDistance;
    if (wanted > 0.8 * *p.radius) continue;
    const double error = std::abs(field.evaluate(x).pseudoDistance - wanted) / *p.radius;
    e.mean += error;
    e.worst = std::max(e.worst, error);
    ++used;
  }
  e.mean /= used;
  return e;
}

// The distance has a cusp on points and curves that smooth functions round off: hence the worst errors.
TEST(Variational, IsTheDistanceToAFewPercentOfTheRadius) {
  for (const Primitive& p : everyType()) {
    const Errors e = errorsOf(p, fitted(1000));
    EXPECT_LT(e.mean, 0.03) << p.name;
    EXPECT_LT(e.worst, 0.25) << p.name;
  }
}

TEST(Variational, MoreCentresComeNearer) {
  for (const Primitive& p : {polyline("l", wavyLine(12), 0.5), cube("c", 0.6, 0.5)}) {
    const double few = errorsOf(p, fitted(120)).mean, many = errorsOf(p, fitted(1000)).mean, most = errorsOf(p, fitted(4000)).mean;
    EXPECT_LT(many, 0.6 * few) << p.name;
    EXPECT_LT(most, 0.9 * many) << p.name;  // of another kernel
  }
}

TEST(Variational, ManyCentresComeAsNearAsOneLikes) {
  // Around points and curves the number grows as the third power of the fineness: 8000 are half as far apart as 1000.
  for (const Primitive& p : {pointSet("p", {{0.1, 0, 0}, {-0.6, 0.1, 0.2}}, 0.5), polyline("l", wavyLine(12), 0.5)}) {
    const double dense = errorsOf(p, fitted(2000)).mean, many = errorsOf(p, fitted(4000)).mean, most = errorsOf(p, fitted(16000)).mean;
    EXPECT_LT(many, 0.5 * dense) << p.name;
    EXPECT_LT(most, 0.6 * many) << p.name;
    EXPECT_LT(most, 0.0015) << p.name;
  }
}

TEST(Variational, ConstraintsAreMetAndReported) {
  for (const std::size_t centres : {500, 3000})
    for (const Primitive& p : everyType()) {
      const Field field(of({p}), fitted(centres));
      const DistanceReport r = field.distanceReport(0);
      EXPECT_EQ(r.kind, Distance::Variational);
      EXPECT_LE(r.centres, centres);
      EXPECT_GT(r.centres, 20u);
      EXPECT_EQ(r.levels > 0, centres > 2000);
      EXPECT_LE(r.residual, 1e-6 * 0.5) << p.name;
      for (const Vec3& x : p.points) EXPECT_NEAR(field.evaluate(x).pseudoDistance, 0, 1e-6) << p.name;
    }
}

TEST(Variational, SolidsAreSigned) {
  const Field field(of({cube("c", 0.6, 0.5)}), fitted(1000));
  EXPECT_LT(field.evaluate(Vec3(0.4, 0.1, 0)).pseudoDistance, -0.1);
  EXPECT_GT(field.evaluate(Vec3(0.8, 0.1, 0)).pseudoDistance, 0.1);
}

TEST(Variational, GradientIsTheCentralDifference) {
  Primitive radii = polyline("l", wavyLine(8), 0.8);
  giveRadii(radii, 0.4, 0.8);
  for (const std::size_t centres : {300, 2500})
    for (const Primitive& p : {polyline("l", wavyLine(12), 0.5), cube("c", 0.6, 0.5), radii}) {
      const Field field(of({p}), fitted(centres));
      const auto pseudoDistance = [&](const Vec3& at) { return field.evaluate(at).pseudoDistance; };
      int used = 0;
      for (std::uint64_t i = 0; i < 500; ++i) {
        const Vec3 x = randomPoint(32, i, 1.2);
        const FieldValue v = field.evaluate(x);
        const auto central = test::centralDifference(pseudoDistance, x);
        if (!central) continue;  // kinks of the exact part
        ++used;
        EXPECT_LT((*central - v.gradient).norm(), 1e-6 * (1 + v.gradient.norm())) << p.name << centres;
      }
      EXPECT_GT(used, 450);
    }
}

// Also in the corners of the box around a primitive, far from all constraints.
TEST(Variational, BeyondThePrimitivesReachItIsTheExactDistance) {
  Primitive octahedron = cube("o", 1, 0.5);
  octahedron.points = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  octahedron.faces = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  std::vector<Primitive> all = everyType();
  all.push_back(octahedron);
  for (const std::size_t centres : {600, 3000})
    for (const Primitive& p : all) {
      const Field field(of({p}), fitted(centres)), exact(of({p}));
      for (std::uint64_t i = 0; i < 300; ++i) {
        const Vec3 x = randomPoint(33, i, i % 2 ? 1.7 : 4);
        const FieldValue v = exact.evaluate(x);
        if (v.pseudoDistance < 1.15 * 0.5) continue;
        EXPECT_EQ(field.evaluate(x).pseudoDistance, v.pseudoDistance) << p.name;
        EXPECT_FALSE(field.evaluate(x).inside);
      }
    }
}

// Taken together, many points share what far centres add.
TEST(Variational, ManyPointsTogetherAreThePointsOneByOne) {
  Primitive heavy = cube("heavy", 0.3, 0.6, Vec3(0.6, 0, 0));
  heavy.weight = 2;
  const Skeleton skeleton = of({polyline("l", wavyLine(12), 0.5), heavy, pointSet("few", {{0, 0.8, 0}}, 0.3)});
  const Field field(skeleton, fitted(700));
  std::vector<Vec3> points(140000);
  for (std::size_t i = 0; i < points.size(); ++i) points[i] = randomPoint(36, i, i % 50 ? 0.4 : 3);
  points[5].x() = std::nan("");
  std::vector<FieldValue> found(points.size());
  field.evaluate(points, found);
  EXPECT_EQ(found[5].pseudoDistance, field.evaluate(points[5]).pseudoDistance);
  bool differs = false;
  for (std::size_t i = 0; i < points.size(); i += i < 100 ? 1 : 29) {
    if (i == 5) continue;
    const FieldValue one = field.evaluate(points[i]);
    // 1e-8 of distances up to 0.7, which the potentials' slopes may amplify a few times.
    EXPECT_NEAR(found[i].pseudoDistance, one.pseudoDistance, 3e-8);
    EXPECT_NEAR(found[i].sum, one.sum, 1e-6);
    EXPECT_LT((found[i].gradient - one.gradient).norm(), 1e-5);
    EXPECT_EQ(found[i].inside, one.inside);
    differs = differs || found[i].pseudoDistance != one.pseudoDistance;
  }
  EXPECT_TRUE(differs);
}

TEST(Variational, PowersOfTwoScaleEveryBit) {
  Primitive p = polyline("l", wavyLine(6), 0.6), q = p;
  for (Vec3& x : q.points) x *= 256;
  *q.radius *= 256;
  for (const std::size_t centres : {200, 2200}) {
    const Field a(of({p}), fitted(centres)), b(of({q}), fitted(centres));
    for (std::uint64_t i = 0; i < 100; ++i) {
      const Vec3 x = randomPoint(34, i, 1.2);
      EXPECT_EQ(256 * a.evaluate(x).pseudoDistance, b.evaluate(256 * x).pseudoDistance) << centres;
    }
  }
}

TEST(Variational, DegeneratePrimitivesGiveNumbers) {
  Primitive flat = patch("c", 2, 0.5);
  for (Vec3& p : flat.points) p.y() = p.z() = 0;
  for (const std::size_t centres : {16, 400, 2500})
    for (const Primitive& p : {polyline("a", {{1, 1, 1}, {1, 1, 1}}, 0.5), cube("b", 0, 0.5), flat, pointSet("many", wavyLine(300), 1e-3)}) {
      const Field field(of({p}), fitted(centres));
      for (std::uint64_t i = 0; i < 100; ++i) {
        const FieldValue v = field.evaluate(i == 0 ? p.points[0] : randomPoint(35, i, 1.5));
        EXPECT_TRUE(std::isfinite(v.pseudoDistance) && v.gradient.allFinite()) << p.name;
      }
    }
}

}  // namespace
}  // namespace fielddeform::field
