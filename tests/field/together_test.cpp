// Points evaluated together against the same points one by one: every bit.
#include <fielddeform/field/field.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "skeletons.h"

namespace fielddeform::field {
namespace {

using skeleton::Primitive;

bool same(const FieldValue& a, const FieldValue& b) {
  return a.sum == b.sum && a.pseudoDistance == b.pseudoDistance && a.gradient == b.gradient && a.inside == b.inside;
}

// One of each kind, alone and mixed; solids whole, with a hole, and turned inside out; a radius a point, weights, other potentials.
std::vector<skeleton::Skeleton> skeletons() {
  Primitive radii = patch("radii", 9, 0.5), open = cube("open", 0.4, 0.7), reversed = cube("reversed", 0.4, 0.7), heavy = patch("heavy", 5, 0.6);
  giveRadii(radii, 0.3, 0.9);
  open.faces.pop_back();
  for (auto& f : reversed.faces) std::reverse(f.begin(), f.end());
  heavy.weight = 2.5;
  Primitive other = polyline("other", wavyLine(60), 0.6), gone = cube("gone", 0.1, 3);
  other.potential = skeleton::Potential::Metaball;
  gone.weight = 0;
  const Primitive dots = pointSet("dots", wavyLine(7), 0.5);
  std::vector<skeleton::Skeleton> all;
  for (const Primitive& p : {patch("patch", 12, 0.5), radii, cube("solid", 0.4, 0.7), open, reversed, heavy, other, dots}) all.push_back({{p}, {}});
  all.push_back({{patch("patch", 12, 0.5), gone, cube("solid", 0.4, 0.7, Vec3(0.5, 0, 0)), heavy, other, dots}, {}});
  return all;
}

// Clouds of 50 points of several sizes; some within, some far beyond the radii.
std::vector<Vec3> clouds() {
  std::vector<Vec3> points;
  const double sizes[] = {1e-3, 0.03, 0.2, 1.5};
  for (std::uint64_t b = 0; b < 40; ++b)
    for (std::uint64_t k = 0; k < 50; ++k) points.push_back(randomPoint(1, b, b % 5 == 4 ? 5 : 0.8) + randomPoint(2, 50 * b + k, sizes[b % 4]));
  return points;
}

TEST(FieldTogether, GivesTheBytesOfSinglePoints) {
  std::vector<Vec3> points = clouds();
  points[20][1] = std::numeric_limits<double>::quiet_NaN();
  points[150][2] = std::numeric_limits<double>::infinity();
  for (const auto& s : skeletons())
    for (const Extension extension : {Extension::Linear, Extension::None}) {
      const Field field(s, {.extension = extension});
      SearchHints hints;
      std::vector<FieldValue> found(points.size());
      std::size_t inside = 0;
      for (std::size_t begin = 0; begin < points.size(); begin += 90) {
        const std::size_t n = std::min<std::size_t>(90, points.size() - begin);
        field.evaluateTogether(std::span(points).subspan(begin, n), std::span(found).subspan(begin, n), hints);
      }
      for (std::size_t i = 0; i < points.size(); ++i) {
        ASSERT_TRUE(same(found[i], field.evaluate(points[i]))) << s.primitives[0].name << ' ' << i;
        inside += found[i].inside;
      }
      EXPECT_GT(inside, 100u) << s.primitives[0].name;
    }
}

TEST(FieldTogether, ClosestPointsAndSignsAreThoseOfSinglePoints) {
  const std::vector<Vec3> points = clouds();
  for (const auto& s : skeletons()) {
    const Field field(s);
    SearchHints hints;
    std::vector<PrimitiveHit> found(points.size());
    for (std::size_t k = 0; k < field.primitiveCount(); ++k) {
      field.closestTogether(k, points, found, hints);
      for (std::size_t i = 0; i < points.size(); ++i) {
        const PrimitiveHit expected = field.closest(k, points[i]);
        ASSERT_EQ(found[i].distance, expected.distance) << s.primitives[k].name << ' ' << i;
        ASSERT_EQ(found[i].element, expected.element);
        ASSERT_EQ(found[i].point, expected.point);
        ASSERT_EQ(found[i].direction, expected.direction);
        ASSERT_EQ(found[i].weight, expected.weight);
        for (int c = 0; c < 3; ++c) ASSERT_EQ(found[i].vertex[c], expected.vertex[c]);
      }
    }
    EXPECT_THROW(field.closestTogether(0, points, std::span(found).first(3), hints), std::invalid_argument);
    std::vector<FieldValue> few(3);
    EXPECT_THROW(field.evaluateTogether(points, few, hints), std::invalid_argument);
  }
}

TEST(FieldTogether, FeetGiveTheClosestPointsAgainWithoutASearch) {
  std::vector<Vec3> points = clouds();
  points[20][1] = std::numeric_limits<double>::quiet_NaN();
  std::size_t known = 0, within = 0;
  for (const auto& s : skeletons()) {
    const Field field(s);
    const std::size_t n = field.primitiveCount();
    SearchHints hints;
    std::vector<FieldValue> values(points.size());
    std::vector<Foot> feet(n * points.size());
    field.evaluateTogether(points, values, hints, feet);
    for (std::size_t i = 0; i < points.size(); ++i) {
      ASSERT_TRUE(same(values[i], field.evaluate(points[i])));
      for (std::size_t k = 0; k < n; ++k) {
        const Foot foot = feet[n * i + k];
        known += foot.known();
        within += foot.known() && foot.inside();
        if (i == 20) {
          EXPECT_FALSE(foot.known());
          continue;
        }
        const PrimitiveHit found = field.closestAt(k, points[i], foot), expected = field.closest(k, points[i]);
        ASSERT_EQ(found.distance, expected.distance) << s.primitives[k].name << ' ' << i;
        ASSERT_EQ(std::signbit(found.distance), std::signbit(expected.distance));
        ASSERT_EQ(found.element, expected.element);
        ASSERT_EQ(found.point, expected.point);
        ASSERT_EQ(found.direction, expected.direction);
        ASSERT_EQ(found.weight, expected.weight);
      }
    }
    EXPECT_THROW(field.evaluateTogether(points, values, hints, std::span(feet).first(n)), std::invalid_argument);
  }
  EXPECT_GT(known, 5000u);
  EXPECT_GT(within, 500u);
}

}  // namespace
}  // namespace fielddeform::field
