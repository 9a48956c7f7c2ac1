#include <fielddeform/core/random.h>
#include <fielddeform/gffd/detail/lines_field.h>
#include <gtest/gtest.h>
#include <tests/gffd/gffd_testing.h>

#include <cmath>
#include <numbers>

namespace fielddeform::gffd::tests {
namespace {

using detail::Block;
using detail::kLanes;
using detail::LinesField;
using detail::LineValues;

double uniform(std::uint64_t seed, std::uint64_t index) { return uniform01(seed, index); }
Vec3 randomPoint(std::uint64_t seed, std::uint64_t index, double size) {
  return size * (2 * Vec3(uniform(seed, 3 * index), uniform(seed, 3 * index + 1), uniform(seed, 3 * index + 2)) - Vec3::Ones());
}

skeleton::Primitive primitive(const char* name, std::vector<Vec3> points, double radius) {
  skeleton::Primitive p;
  p.name = name;
  p.points = std::move(points);
  p.radius = radius;
  return p;
}

std::vector<Vec3> helix(int count) {
  std::vector<Vec3> points;
  for (int i = 0; i < count; ++i) {
    const double t = 6 * i / (count - 1.0);
    points.emplace_back(std::cos(t), std::sin(t), 0.2 * t);
  }
  return points;
}

std::vector<Vec3> randomWalk(int count, std::uint64_t seed) {
  std::vector<Vec3> points{Vec3::Zero()};
  for (int i = 1; i < count; ++i) points.push_back(points.back() + randomPoint(seed, static_cast<std::uint64_t>(i), 0.3));
  return points;
}

// Smooth lines, corners, a fold, points at one place, closed rings, points, several at once, other weights.
std::vector<skeleton::Skeleton> skeletons() {
  std::vector<skeleton::Skeleton> all;
  all.push_back({{primitive("helix", helix(60), 0.7)}, {}});
  all.push_back({{primitive("fine", helix(3000), 0.4)}, {}});
  all.push_back({{primitive("corner", {{-1, 0, 0}, {0, 0, 0}, {0, 1, 0}}, 0.8)}, {}});
  all.push_back({{primitive("hairpin", {{-1, 0, 0}, {0, 0, 0}, {-1, 0.1, 0}}, 0.8)}, {}});
  all.push_back({{primitive("twice", {{-1, 0, 0}, {0, 0, 0}, {0, 0, 0}, {1, 0.5, 0}}, 0.8)}, {}});
  all.push_back({{primitive("walk", randomWalk(40, 5), 0.6)}, {}});
  // Straight pieces in many segments, so that whole bends lie in single vertices; some points twice.
  std::vector<Vec3> pieces;
  const auto corners = randomWalk(14, 21);
  for (std::size_t i = 0; i + 1 < corners.size(); ++i)
    for (int k = 0; k < 7; ++k) {
      pieces.push_back(corners[i] + k / 7.0 * (corners[i + 1] - corners[i]));
      if (i % 3 == 0 && k % 4 == 0) pieces.push_back(pieces.back());
    }
  all.push_back({{primitive("pieces", pieces, 0.6)}, {}});
  // Bent far more sharply than points are away.
  std::vector<Vec3> coil;
  for (int i = 0; i < 400; ++i) coil.emplace_back(0.05 * std::cos(0.35 * i), 0.05 * std::sin(0.35 * i), 0.004 * i - 0.8);
  all.push_back({{primitive("coil", coil, 0.5)}, {}});
  auto ring = primitive("ring", fielddeform::tests::bendMap(fielddeform::tests::verticalLine(40, 2), 6.1), 0.3);
  ring.closed = true;
  all.push_back({{ring}, {}});
  auto dots = primitive("dots", randomWalk(9, 8), 0.5);
  dots.type = skeleton::PrimitiveType::Points;
  all.push_back({{dots}, {}});
  auto heavy = primitive("heavy", {{-1, 0.3, 0}, {1, 0.3, 0}}, 0.5);
  heavy.weight = 2.5;
  all.push_back({{heavy}, {}});
  all.push_back({{primitive("a", helix(60), 0.7), heavy, dots, primitive("b", randomWalk(40, 6), 0.6)}, {}});
  return all;
}

TEST(LinesField, AgreesWithTheFieldWhereAPrimitiveReaches) {
  for (const auto& s : skeletons()) {
    const field::Field field(s);
    const auto lines = LinesField::of(s, {}, field.referenceRadius());
    ASSERT_TRUE(lines) << s.primitives[0].name;
    Block block;
    LineValues values;
    std::size_t reached = 0;
    for (std::uint64_t b = 0; b < 60; ++b) {
      // Blocks of all sizes: as of one cell, and as wide as the object.
      const double size = b % 3 == 0 ? 0.02 : b % 3 == 1 ? 0.1 : 1.2;
      const Vec3 centre = randomPoint(77, b, 1.1);
      for (std::size_t p = 0; p < kLanes; ++p) {
        const Vec3 x = centre + randomPoint(b, p, size);
        block.x[p] = x[0];
        block.y[p] = x[1];
        block.z[p] = x[2];
      }
      lines->evaluate(block, kLanes, values);
      for (std::size_t p = 0; p < kLanes; ++p) {
        const field::FieldValue exact = field.evaluate({block.x[p], block.y[p], block.z[p]});
        if (!exact.inside) {
          if (s.primitives.size() > 1) {
            EXPECT_TRUE(std::isnan(values.value[p]));
          }
          continue;
        }
        ++reached;
        // Rounding of distances of order one, through exp and log.
        ASSERT_NEAR(values.value[p], exact.pseudoDistance, 1e-13) << s.primitives[0].name;
        const Vec3 g(values.gx[p], values.gy[p], values.gz[p]);
        // Where two feet are equally far either is right: then the values agree and the directions need not.
        ASSERT_LT((g - exact.gradient).norm(), 1e-9) << s.primitives[0].name;
      }
    }
    EXPECT_GT(reached, 100u) << s.primitives[0].name;
  }
}

TEST(LinesField, APointsValueDoesNotDependOnItsBlock) {
  for (const auto& s : skeletons()) {
    const auto lines = LinesField::of(s, {}, 1);
    Block block, alone;
    LineValues together, single;
    for (std::uint64_t b = 0; b < 40; ++b) {
      // Also points exactly beside a vertex, where two segments have the same foot.
      const auto& points = s.primitives[0].points;
      const Vec3 centre = b % 2 ? randomPoint(3, b, 1.1) : points[splitmix64(9, b) % points.size()];
      for (std::size_t p = 0; p < kLanes; ++p) {
        const Vec3 x = centre + randomPoint(b, p, p % 2 ? 0.05 : 0.4);
        block.x[p] = x[0];
        block.y[p] = x[1];
        block.z[p] = x[2];
      }
      lines->evaluate(block, kLanes, together);
      for (std::size_t p = 0; p < kLanes; ++p) {
        alone.x[0] = block.x[p];
        alone.y[0] = block.y[p];
        alone.z[0] = block.z[p];
        lines->evaluate(alone, 1, single);
        if (std::isnan(single.value[0]) && std::isnan(together.value[p])) continue;
        ASSERT_EQ(single.value[0], together.value[p]) << s.primitives[0].name;
        ASSERT_EQ(single.gx[0], together.gx[p]);
        ASSERT_EQ(single.gy[0], together.gy[p]);
        ASSERT_EQ(single.gz[0], together.gz[p]);
      }
    }
  }
}

TEST(LinesField, LeavesOtherFieldsAlone) {
  skeleton::Skeleton s{{primitive("line", helix(20), 0.5)}, {}};
  EXPECT_FALSE(LinesField::of(s, {.potential = skeleton::Potential::Metaball}, 1));
  EXPECT_FALSE(LinesField::of(s, {.extension = field::Extension::None}, 1));
  s.primitives[0].potential = skeleton::Potential::Gaussian;
  EXPECT_FALSE(LinesField::of(s, {}, 1));
  s.primitives[0].potential.reset();
  s.primitives[0].pointRadius.assign(20, 0.5);
  EXPECT_FALSE(LinesField::of(s, {}, 1));
}

}  // namespace
}  // namespace fielddeform::gffd::tests
