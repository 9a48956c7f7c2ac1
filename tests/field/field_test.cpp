#include <fielddeform/core/parallel.h>
#include <fielddeform/field/field.h>
#include <gtest/gtest.h>
#include <tests/support/central_difference.h>

#include <stdexcept>

#include "skeletons.h"

namespace fielddeform::field {
namespace {

using skeleton::Potential;
using skeleton::Primitive;
using skeleton::Skeleton;
constexpr double kInf = std::numeric_limits<double>::infinity();

Skeleton of(std::vector<Primitive> primitives) {
  Skeleton s;
  s.primitives = std::move(primitives);
  return s;
}

bool same(const FieldValue& a, const FieldValue& b) {
  return a.sum == b.sum && a.pseudoDistance == b.pseudoDistance && a.gradient == b.gradient && a.inside == b.inside;
}

TEST(Field, OneLineIsItsDistance) {
  const Field field(of({polyline("a", {{0, 0, 0}, {2, 0, 0}}, 0.5)}));
  EXPECT_EQ(field.referenceRadius(), 0.5);
  for (const double d : {0.0, 0.1, 0.3, 0.49, 0.5, 0.7, 3.0}) {
    const FieldValue v = field.evaluate(Vec3(1, 0, d));
    EXPECT_NEAR(v.pseudoDistance, d, 1e-15);
    EXPECT_EQ(v.inside, d < 0.5);
    EXPECT_NEAR(v.sum, d < 0.5 ? std::exp(-4 * d / 0.5) - std::exp(-4) : 0, 1e-15);
    EXPECT_EQ(v.gradient, d > 0 ? Vec3(0, 0, 1) : Vec3::Zero());
  }
  EXPECT_NEAR(field.evaluate(Vec3(-0.3, 0.4, 0)).pseudoDistance, 0.5, 1e-15);
}

TEST(Field, CubeIsSignedWithOutwardGradient) {
  for (const bool insideOut : {false, true}) {
    Primitive p = cube("c", 1, 0.5);
    if (insideOut)
      for (auto& f : p.faces) std::reverse(f.begin(), f.end());
    const Field field(of({p}));
    for (const double x : {-0.3, 0.0, 0.6, 1.0, 1.2, 1.5, 4.0}) {
      // The first face wins at equal distances; stay nearest to +x.
      const Vec3 at(0.7 + 0.3 * x, 0.05, 0.02);
      if (std::abs(at.x()) < 0.2) continue;
      const FieldValue v = field.evaluate(at);
      EXPECT_NEAR(v.pseudoDistance, at.x() - 1, 1e-15);
      EXPECT_NEAR((v.gradient - Vec3(1, 0, 0)).norm(), 0, 1e-12) << at.x();
      EXPECT_EQ(v.inside, at.x() < 1.5);
    }
  }
}

TEST(Field, ClosedMeshWithAHoleKeepsItsSign) {
  Primitive p = cube("c", 1, 0.5);
  p.faces.pop_back();
  p.faces.push_back({1, 3, 7});  // half of the +x side is missing
  const Field field(of({p}));
  for (std::uint64_t i = 0; i < 1000; ++i) {
    const Vec3 x = randomPoint(1, i, 2);
    const double depth = x.cwiseAbs().maxCoeff() - 1;
    if (std::abs(depth) < 0.1 || x.x() > 0.4) continue;  // before the hole itself the winding number is about a half
    EXPECT_EQ(field.evaluate(x).pseudoDistance < 0, depth < 0);
  }
}

TEST(Field, OpenMeshIsUnsigned) {
  const Field field(of({patch("p", 6, 0.5)}));
  for (std::uint64_t i = 0; i < 500; ++i) EXPECT_GE(field.evaluate(randomPoint(2, i)).pseudoDistance, 0);
}

// The formulas of the tracking design, straight from the hits.
FieldValue byHand(const Field& field, const Skeleton& s, double k, const Vec3& p) {
  const double R = field.referenceRadius();
  double S = 0, nearest = kInf;
  Vec3 g = Vec3::Zero(), outer = Vec3::Zero();
  for (std::size_t i = 0; i < s.primitives.size(); ++i) {
    const PrimitiveHit h = field.closest(i, p);
    const double r = field.radiusAt(i, h);
    if (h.distance / r < nearest) {
      nearest = h.distance / r;
      outer = R / r * h.direction;
    }
    if (!(h.distance < r)) continue;
    S += s.primitives[i].weight * (std::exp(-k * h.distance / r) - std::exp(-k));
    g += s.primitives[i].weight * R / r * std::exp(-k * h.distance / r) * h.direction;
  }
  if (S > 0) return {S, R / k * -std::log(S + std::exp(-k)), g / (S + std::exp(-k)), true};
  return {0, R * nearest, outer, false};
}

TEST(Field, BlendFollowsTheFormulas) {
  Skeleton s = of({polyline("a", wavyLine(20), 0.6), polyline("b", {{0, -1, 0}, {0.2, 1, 0.3}}, 0.4),
                   pointSet("c", {{0.5, 0.5, 0}, {-0.5, 0.2, 0.4}}, 0.5), cube("d", 0.2, 0.3, Vec3(0, 0, 0.7)), patch("e", 3, 0.2)});
  s.primitives[1].weight = 2.5;
  const Field field(s);
  int inside = 0;
  for (std::uint64_t i = 0; i < 3000; ++i) {
    const Vec3 p = randomPoint(3, i, 1.2);
    const FieldValue v = field.evaluate(p), expected = byHand(field, s, 4, p);
    EXPECT_EQ(v.inside, expected.inside);
    EXPECT_NEAR(v.sum, expected.sum, 1e-13 * (1 + expected.sum));
    EXPECT_NEAR(v.pseudoDistance, expected.pseudoDistance, 1e-13);
    EXPECT_LT((v.gradient - expected.gradient).norm(), 1e-12);
    inside += v.inside;
  }
  EXPECT_GT(inside, 800);
  EXPECT_LT(inside, 2500);
}

TEST(Field, CoincidentPrimitivesShiftTheDistance) {
  const Field one(of({polyline("a", {{0, 0, 0}, {1, 0, 0}}, 0.5)}));
  const Field three(of({polyline("a", {{0, 0, 0}, {1, 0, 0}}, 0.5), polyline("b", {{0, 0, 0}, {1, 0, 0}}, 0.5),
                        polyline("c", {{0, 0, 0}, {1, 0, 0}}, 0.5)}));
  Skeleton weighted = of({polyline("a", {{0, 0, 0}, {1, 0, 0}}, 0.5)});
  weighted.primitives[0].weight = 3;
  const Field heavy(weighted);
  for (const double d : {0.05, 0.2, 0.45}) {
    const Vec3 p(0.5, d, 0);
    EXPECT_NEAR(three.evaluate(p).sum, 3 * one.evaluate(p).sum, 1e-15);
    const double shifted = -0.5 / 4 * std::log(3 * (std::exp(-8 * d) - std::exp(-4)) + std::exp(-4));
    EXPECT_NEAR(three.evaluate(p).pseudoDistance, shifted, 1e-15);
    EXPECT_NEAR(heavy.evaluate(p).pseudoDistance, shifted, 1e-15);
  }
}

// Largest difference between the gradient and central differences; kinks (a change of the closest element or of the set
// of active primitives) are left out by comparing the one-sided differences.
double gradientError(const Field& field, std::uint64_t seed, double size, int* used) {
  double worst = 0;
  const auto pseudoDistance = [&](const Vec3& at) { return field.evaluate(at).pseudoDistance; };
  for (std::uint64_t i = 0; i < 2000; ++i) {
    const Vec3 p = randomPoint(seed, i, size);
    const FieldValue v = field.evaluate(p);
    const auto central = test::centralDifference(pseudoDistance, p);
    if (!central) continue;  // a curvature of 1000 over h is a kink
    ++*used;
    worst = std::max(worst, (*central - v.gradient).norm() / (1 + v.gradient.norm()));
  }
  return worst;
}

TEST(FieldGradient, IsTheCentralDifferenceForEveryTypeAndRadiusPerPoint) {
  for (const bool radii : {false, true})
    for (Primitive p : {polyline("a", wavyLine(12), 0.6), pointSet("b", wavyLine(5), 0.6), patch("c", 4, 0.6), cube("d", 0.6, 0.6)}) {
      if (radii) giveRadii(p, 0.3, 0.8);
      int used = 0;
      const double worst = gradientError(Field(of({p})), 4, 1.5, &used);
      EXPECT_LT(worst, 1e-6) << p.name << radii;  // h^2 times third derivatives near the primitive, rounding / h
      EXPECT_GT(used, 1800) << p.name << radii;
    }
}

TEST(FieldGradient, IsTheCentralDifferenceForEveryPotentialBlended) {
  for (const Potential potential : {Potential::Exponential, Potential::Gaussian, Potential::Metaball, Potential::SoftObject}) {
    Skeleton s = of({polyline("a", wavyLine(12), 0.9), polyline("b", {{-1, 1, 0}, {1, -1, 0.2}}, 1.1), cube("c", 0.3, 0.7, Vec3(0, 0, 1))});
    giveRadii(s.primitives[0], 0.7, 1.1);
    s.primitives[1].weight = 0.7;
    int used = 0;
    FieldOptions options;
    options.potential = potential;
    const Field field(s, options);
    const double R = field.referenceRadius();
    double worst = 0;
    const auto pseudoDistance = [&](const Vec3& at) { return field.evaluate(at).pseudoDistance; };
    for (std::uint64_t i = 0; i < 2000; ++i) {
      const Vec3 p = randomPoint(5, i, 1.3);
      const FieldValue v = field.evaluate(p);
      // Beside the floored slope (near x = 0) and the square-root behaviour of the inverses (x = 0 and x = k).
      if (v.pseudoDistance > -0.05 * R && v.pseudoDistance < 0.1 * R) continue;
      if (v.inside && v.pseudoDistance > 0.95 * R) continue;
      const auto central = test::centralDifference(pseudoDistance, p);
      if (!central) continue;
      ++used;
      worst = std::max(worst, (*central - v.gradient).norm() / (1 + v.gradient.norm()));
    }
    EXPECT_LT(worst, 2e-6) << static_cast<int>(potential);
    EXPECT_GT(used, 1200) << static_cast<int>(potential);
  }
}

TEST(FieldGradient, IsTheCentralDifferenceForMixedPotentials) {
  Skeleton s = of({polyline("a", wavyLine(12), 0.9), polyline("b", {{-1, 1, 0}, {1, -1, 0.2}}, 1.1), pointSet("c", {{0, 0, 1}}, 0.7)});
  s.primitives[1].potential = Potential::SoftObject;
  s.primitives[2].potential = Potential::Gaussian;
  int used = 0;
  EXPECT_LT(gradientError(Field(s), 6, 1.3, &used), 2e-6);
  EXPECT_GT(used, 1800);
}

TEST(Field, IsContinuousAcrossTheRadiusAndThePrimitive) {
  for (const Potential potential : {Potential::Exponential, Potential::Gaussian, Potential::Metaball, Potential::SoftObject}) {
    FieldOptions options;
    options.potential = potential;
    Skeleton s = of({cube("c", 1, 0.5), polyline("far", {{9, 9, 9}, {9, 9, 8}}, 0.5)});
    s.primitives[0].weight = 0.8;  // not the shortcut for a single plain primitive
    const Field field(s, options);
    const auto at = [&](double d) { return field.evaluate(Vec3(1 + d, 0.1, 0.2)).pseudoDistance; };
    // A square-root inverse moves by sqrt(1e-9) over 1e-9.
    EXPECT_NEAR(at(0.5 - 1e-9), at(0.5 + 1e-9), 1e-4);
    EXPECT_NEAR(at(-1e-9), at(1e-9), 1e-4);
    double last = at(-0.75);
    for (double d = -0.74; d < 1; d += 0.01) {
      EXPECT_GT(at(d), last);
      last = at(d);
    }
  }
}

TEST(Field, PrimitivesOfWeightZeroContributeNothing) {
  Skeleton with = of({polyline("a", wavyLine(12), 0.6), cube("b", 0.5, 0.9, Vec3(0.5, 0.5, 0))});
  with.primitives[1].weight = 0;
  const Field a(with), b(of({polyline("a", wavyLine(12), 0.6)}));
  EXPECT_EQ(a.referenceRadius(), 0.6);
  for (std::uint64_t i = 0; i < 500; ++i) EXPECT_TRUE(same(a.evaluate(randomPoint(7, i, 2)), b.evaluate(randomPoint(7, i, 2))));
  with.primitives[0].weight = 0;
  const FieldValue nothing = Field(with).evaluate(Vec3::Zero());
  EXPECT_TRUE(same(nothing, {0, kInf, Vec3::Zero(), false}));
}

TEST(Field, WithoutExtensionItIsClippedAtTheRadius) {
  const Skeleton s = of({polyline("a", wavyLine(12), 0.6)});
  FieldOptions options;
  options.extension = Extension::None;
  const Field clipped(s, options), extended(s);
  for (std::uint64_t i = 0; i < 500; ++i) {
    const Vec3 p = randomPoint(8, i, 1.5);
    const FieldValue v = clipped.evaluate(p);
    if (v.inside) EXPECT_TRUE(same(v, extended.evaluate(p)));
    else EXPECT_TRUE(same(v, {0, 0.6, Vec3::Zero(), false}));
  }
}

TEST(Field, ReferenceRadiusIsOnlyTheUnit) {
  const Skeleton s = of({polyline("a", wavyLine(12), 0.6), pointSet("b", {{0.3, 0.3, 0.3}}, 0.4)});
  FieldOptions options;
  options.referenceRadius = 2.4;
  const Field a(s), b(s, options);
  EXPECT_EQ(b.referenceRadius(), 2.4);
  for (std::uint64_t i = 0; i < 500; ++i) {
    const FieldValue v = a.evaluate(randomPoint(9, i)), w = b.evaluate(randomPoint(9, i));
    EXPECT_NEAR(w.pseudoDistance, 4 * v.pseudoDistance, 1e-14);
    EXPECT_LT((w.gradient - 4 * v.gradient).norm(), 1e-13);
  }
}

TEST(Field, PowersOfTwoScaleEveryBit) {
  for (const Potential potential : {Potential::Exponential, Potential::Gaussian, Potential::Metaball, Potential::SoftObject}) {
    Skeleton s = of({polyline("a", wavyLine(12), 0.6), polyline("b", wavyLine(3), 0.5), pointSet("c", wavyLine(5), 0.6),
                     patch("d", 3, 0.3), cube("e", 0.3, 0.4, Vec3(0, 0, 0.5)), cube("f", 0.2, 0.4, Vec3(0.3, 0, 0.5))});
    giveRadii(s.primitives[1], 0.2, 0.5);
    giveRadii(s.primitives[3], 0.1, 0.3);
    giveRadii(s.primitives[4], 0.2, 0.4);
    s.primitives[0].weight = 0.6;
    FieldOptions options;
    options.potential = potential;
    for (const double f : {1024.0, 1.0 / 1024, std::ldexp(1.0, 300)}) {
      Skeleton t = s;
      for (Primitive& p : t.primitives) {
        for (Vec3& x : p.points) x *= f;
        for (double& r : p.pointRadius) r *= f;
        *p.radius *= f;
      }
      const Field a(s, options), b(t, options);
      for (std::uint64_t i = 0; i < 500; ++i) {
        const Vec3 p = randomPoint(10, i, 1.5);
        FieldValue v = a.evaluate(p);
        v.pseudoDistance *= f;
        EXPECT_TRUE(same(v, b.evaluate(f * p)));
      }
    }
  }
}

TEST(Field, HitsNameTheElementAndItsPoints) {
  const Field field(of({polyline("a", {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}}, 1), cube("b", 1, 1), pointSet("c", {{0, 0, 0}, {5, 0, 0}}, 1)}));
  const PrimitiveHit line = field.closest(0, Vec3(1.5, 0.25, 0));
  EXPECT_EQ(line.element, 1u);
  EXPECT_EQ(line.vertex[0], 1u);
  EXPECT_EQ(line.vertex[1], 2u);
  EXPECT_EQ(line.vertex[2], kNoIndex);
  EXPECT_EQ(line.weight, Vec3(0.75, 0.25, 0));
  EXPECT_EQ(line.point, Vec3(1, 0.25, 0));
  EXPECT_EQ(line.distance, 0.5);
  EXPECT_EQ(line.direction, Vec3(1, 0, 0));
  const PrimitiveHit solid = field.closest(1, Vec3(0.5, 0.1, 0.2));
  EXPECT_EQ(solid.distance, -0.5);
  EXPECT_EQ(solid.direction, Vec3(1, 0, 0));
  EXPECT_GE(solid.element, 10u);  // the sixth quad's triangles
  const PrimitiveHit point = field.closest(2, Vec3(4, 0, 0));
  EXPECT_EQ(point.element, 1u);
  EXPECT_EQ(point.vertex[0], 1u);
  EXPECT_EQ(field.closest(2, Vec3(std::nan(""), 0, 0)).element, kNoIndex);
}

TEST(Field, ClosedPolylineJoinsItsEnds) {
  Primitive p = polyline("a", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, 1);
  p.closed = true;
  EXPECT_EQ(Field(of({p})).closest(0, Vec3(-0.5, 0.5, 0)).element, 2u);
  EXPECT_EQ(Field(of({p})).closest(0, Vec3(-0.5, 0.5, 0)).distance, 0.5);
}

TEST(Field, RadiusPerPointIsTakenAtTheClosestPoint) {
  Primitive p = polyline("a", {{0, 0, 0}, {2, 0, 0}}, 9);
  p.pointRadius = {1, 3};
  p.radius.reset();
  const Field field(of({p}));
  EXPECT_EQ(field.referenceRadius(), 3);
  EXPECT_EQ(field.radiusAt(0, field.closest(0, Vec3(1, 1, 0))), 2);
  EXPECT_NEAR(field.evaluate(Vec3(1, 1, 0)).pseudoDistance, 1.5, 1e-15);
  EXPECT_FALSE(field.evaluate(Vec3(-1.01, 0, 0)).inside);
  EXPECT_TRUE(field.evaluate(Vec3(4.99, 0, 0)).inside);
}

TEST(Field, DegenerateSkeletonsGiveNumbers) {
  Skeleton s = of({polyline("a", {{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}, 0.5), cube("b", 0, 0.5), patch("c", 2, 0.5)});
  for (Vec3& p : s.primitives[2].points) p.y() = p.z() = 0;
  giveRadii(s.primitives[2], 0.2, 0.6);
  giveRadii(s.primitives[0], 0.2, 0.6);
  const Field field(s);
  for (std::uint64_t i = 0; i < 500; ++i) {
    const FieldValue v = field.evaluate(i < 2 ? Vec3(Vec3::Constant(static_cast<double>(i))) : randomPoint(11, i, 2));
    EXPECT_TRUE(std::isfinite(v.pseudoDistance) && v.gradient.allFinite() && std::isfinite(v.sum));
  }
}

TEST(Field, DeepInsideAndFarOutsideStayFinite) {
  Skeleton s = of({cube("a", 1000, 0.5), cube("b", 900, 0.5)});
  s.primitives[1].weight = 1e40;
  for (const Potential potential : {Potential::Exponential, Potential::Gaussian, Potential::Metaball, Potential::SoftObject}) {
    FieldOptions options;
    options.potential = potential;
    for (const Vec3& p : {Vec3(0, 0, 0.1), Vec3(899, 0, 0.1), Vec3(1e9, 0, 0), Vec3(1e200, 0, 0)}) {
      const FieldValue v = Field(s, options).evaluate(p);
      EXPECT_TRUE(std::isfinite(v.pseudoDistance) && v.gradient.allFinite() && std::isfinite(v.sum)) << p.transpose();
      EXPECT_GT(v.gradient.norm(), 0);
    }
  }
}

TEST(Field, PointsThatAreNotFiniteHaveNoValue) {
  const Field field(of({cube("a", 1, 0.5)}));
  for (const double bad : {kInf, -kInf, std::nan("")})
    EXPECT_TRUE(same(field.evaluate(Vec3(0, bad, 0)), {0, kInf, Vec3::Zero(), false}));
}

TEST(Field, BatchesAreTheSameBitsOnAnyThreadCount) {
  const Field field(of({polyline("a", wavyLine(50), 0.5), cube("b", 0.3, 0.4), patch("c", 3, 0.2)}));
  std::vector<Vec3> points;
  for (std::uint64_t i = 0; i < 5000; ++i) points.push_back(randomPoint(12, i));
  for (const int threads : {1, 2, 7}) {
    const ThreadLimit limit(threads);
    std::vector<FieldValue> out(points.size());
    field.evaluate(points, out);
    for (std::size_t i = 0; i < points.size(); ++i) EXPECT_TRUE(same(out[i], field.evaluate(points[i])));
  }
  std::vector<FieldValue> wrong(1);
  EXPECT_THROW(field.evaluate(points, wrong), std::invalid_argument);
}

TEST(Field, PseudoDistanceOfASumIsTheOneOfThePoint) {
  const Field field(of({polyline("a", wavyLine(12), 0.6), cube("b", 0.3, 0.4)}));
  for (std::uint64_t i = 0; i < 500; ++i) {
    const FieldValue v = field.evaluate(randomPoint(13, i));
    if (v.inside) {
      EXPECT_NEAR(field.pseudoDistanceOf(v.sum), v.pseudoDistance, 1e-13);
    }
  }
}

TEST(Field, BadInputIsRefused) {
  Primitive p = polyline("a", {{0, 0, 0}, {1, 0, 0}}, 1);
  EXPECT_THROW(Field(Skeleton{}), std::invalid_argument);
  EXPECT_THROW(Field(of({p}), {.sharpness = 0}), std::invalid_argument);
  EXPECT_THROW(Field(of({p}), {.sharpness = std::nan("")}), std::invalid_argument);
  EXPECT_THROW(Field(of({p}), {.referenceRadius = -1.0}), std::invalid_argument);
  p.weight = 1e41;
  EXPECT_THROW(Field(of({p})), std::invalid_argument);
  p.weight = 1;
  p.radius.reset();
  EXPECT_THROW(Field(of({p})), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::field
