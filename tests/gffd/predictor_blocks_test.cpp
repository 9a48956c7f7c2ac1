// Predictors by blocks, in vector instructions, against the same ones point by point.
#include <fielddeform/core/detail/simd.h>
#include <fielddeform/core/random.h>
#include <fielddeform/gffd/detail/axial.h>
#include <fielddeform/gffd/detail/axial_lines.h>
#include <fielddeform/gffd/detail/correspondence.h>
#include <fielddeform/gffd/detail/mls.h>
#include <gtest/gtest.h>
#include <tests/gffd/gffd_testing.h>

#include <cmath>
#include <cstring>

namespace fielddeform::gffd::tests {
namespace {

using detail::AxialLines;
using detail::AxialPredictor;
using detail::Block;
using detail::kLanes;
using detail::LocalMotion;
using detail::MlsBlock;
using detail::MlsPredictor;
using detail::MotionBlock;
using fielddeform::detail::SimdLevel;

Vec3 randomPoint(std::uint64_t seed, std::uint64_t index, double size) {
  return size * (2 * Vec3(uniform01(seed, 3 * index), uniform01(seed, 3 * index + 1), uniform01(seed, 3 * index + 2)) - Vec3::Ones());
}

skeleton::Primitive primitive(const char* name, std::vector<Vec3> points, double radius) {
  skeleton::Primitive p;
  p.name = name;
  p.points = std::move(points);
  p.radius = radius;
  return p;
}

std::vector<Vec3> randomWalk(int count, std::uint64_t seed, double step) {
  std::vector<Vec3> points{Vec3::Zero()};
  for (int i = 1; i < count; ++i) points.push_back(points.back() + randomPoint(seed, static_cast<std::uint64_t>(i), step));
  return points;
}

// A turn that grows along z, with a shear and some noise: smooth where the points are, rigid nowhere.
std::vector<Vec3> moved(std::vector<Vec3> points, std::uint64_t seed) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    Vec3& p = points[i];
    const double a = 0.4 + 0.6 * p[2], c = std::cos(a), s = std::sin(a);
    p = Vec3(c * p[0] - s * p[1] + 0.2, s * p[0] + c * p[1], p[2] + 0.3 * p[0]) + randomPoint(seed, i, 0.01);
  }
  return points;
}

// Lines fine and coarse, with corners, closed, with a radius for each point and with points at one place; points; several.
std::vector<skeleton::Skeleton> skeletons() {
  std::vector<skeleton::Skeleton> all;
  const auto straight = fielddeform::tests::verticalLine(101, 2);
  all.push_back({{primitive("straight", straight, 0.6)}, {}});
  all.push_back({{primitive("coarse", {{-1, 0, 0}, {0, 0, 0.2}, {0, 1, 0}}, 0.5)}, {}});
  auto ring = primitive("ring", fielddeform::tests::bendMap(fielddeform::tests::verticalLine(40, 2), 6.1), 0.3);
  ring.closed = true;
  all.push_back({{ring}, {}});
  auto tapered = primitive("tapered", straight, 0.4);
  for (std::size_t i = 0; i < straight.size(); ++i) tapered.pointRadius.push_back(0.2 + 0.004 * static_cast<double>(i));
  tapered.radius.reset();
  all.push_back({{tapered}, {}});
  all.push_back({{primitive("twice", {{-1, 0, 0}, {0, 0, 0}, {0, 0, 0}, {1, 0.5, 0}}, 0.5)}, {}});
  auto dots = primitive("dots", randomWalk(9, 8, 0.4), 0.5);
  dots.type = skeleton::PrimitiveType::Points;
  all.push_back({{dots}, {}});
  auto one = primitive("one", {{0.1, 0.2, 0.3}}, 0.5);
  one.type = skeleton::PrimitiveType::Points;
  all.push_back({{one, ring}, {}});
  all.push_back({{primitive("walk", randomWalk(40, 5, 0.3), 0.4), tapered, dots, primitive("straight", straight, 0.6)}, {}});
  return all;
}

struct Predictors {
  std::shared_ptr<const field::Field> field;
  skeleton::SampledPair samples;
  AxialPredictor axial;
  MlsPredictor mls;

  static skeleton::SampledPair sampled(const skeleton::Skeleton& rest) {
    skeleton::Skeleton posed = rest;
    for (auto& p : posed.primitives) {
      p.points = moved(p.points, 31);
      if (p.radius) *p.radius *= 1.2;
    }
    const auto pair = skeleton::pairSkeletons(rest, posed);
    return detail::sampleMotion(detail::movingPart(pair), pair.posed, field::Field(posed));
  }
  explicit Predictors(const skeleton::Skeleton& rest)
      : field(std::make_shared<const field::Field>(rest)), samples(sampled(rest)), axial(field, samples), mls(samples) {}
};

// Blocks as of one cell, as wide as the object, and right on the skeleton; not all of them full.
std::size_t blockOf(const skeleton::Skeleton& s, std::uint64_t b, Block& block) {
  const auto& points = s.primitives[b % s.primitives.size()].points;
  const Vec3 on = points[splitmix64(9, b) % points.size()];
  const double size = b % 3 == 0 ? 0.03 : b % 3 == 1 ? 0.2 : 1.0;
  const Vec3 centre = b % 4 == 0 ? on : Vec3(on + randomPoint(77, b, 0.4));
  for (std::size_t k = 0; k < kLanes; ++k) {
    const Vec3 x = b % 8 == 0 && k == 5 ? on : Vec3(centre + randomPoint(b, k, size));
    block.x[k] = x[0];
    block.y[k] = x[1];
    block.z[k] = x[2];
  }
  return b % 5 == 0 ? 1 + splitmix64(3, b) % kLanes : kLanes;
}

Vec3 pointOf(const Block& block, std::size_t k) { return {block.x[k], block.y[k], block.z[k]}; }

// Sums of a hundred terms of order one: some 1e-14; where two feet are equally near either is right, and such points are rare.
constexpr double kRounding = 1e-12;

TEST(AxialLines, MovesAsTheAxialPredictor) {
  for (const auto& s : skeletons()) {
    const Predictors p(s);
    const auto lines = AxialLines::of(s, p.samples);
    ASSERT_TRUE(lines) << s.primitives[0].name;
    Block block;
    MotionBlock motion;
    double near[kLanes];
    std::size_t apart = 0, all = 0;
    for (std::uint64_t b = 0; b < 40; ++b) {
      const std::size_t count = blockOf(s, b, block);
      lines->at(block, count, motion);
      lines->nearness(block, count, near);
      for (std::size_t k = 0; k < count; ++k) {
        const Vec3 x = pointOf(block, k);
        const LocalMotion exact = p.axial.at(x);
        ASSERT_NEAR(motion.nearness[k], p.axial.nearness(x), kRounding) << s.primitives[0].name;
        ASSERT_NEAR(near[k], motion.nearness[k], kRounding);
        const Quat q(motion.qw[k], motion.qx[k], motion.qy[k], motion.qz[k]);
        ++all;
        const double off = (Vec3(motion.x[k], motion.y[k], motion.z[k]) - exact.translation).norm();
        apart += !(off < kRounding) || !(1 - std::abs(q.dot(exact.rotation)) < kRounding);
      }
    }
    EXPECT_EQ(apart, 0u) << s.primitives[0].name << ' ' << all;
  }
}

// Where one sample has nearly all weight, the spread that turns the points is a small difference of such sums; far outside
// the influence region, where nobody asks, it is nothing but rounding.
constexpr double kSmallSpread = 1e-9;
constexpr double kFarthest = 1.25;  // radii

TEST(MlsBlocks, MoveAsTheMlsPredictor) {
  for (const auto& s : skeletons()) {
    const Predictors p(s);
    Block block;
    MlsBlock motion;
    std::size_t settled = 0, all = 0;
    for (std::uint64_t b = 0; b < 40; ++b) {
      const std::size_t count = blockOf(s, b, block);
      p.mls.at(block, count, motion);
      for (std::size_t k = 0; k < count; ++k) {
        const Vec3 x = pointOf(block, k);
        if (p.axial.nearness(x) > kFarthest) continue;
        ++all;
        if (motion.settled[k] != 1) continue;
        ++settled;
        const LocalMotion exact = p.mls.at(x);
        const Mat3 r = exact.rotation.toRotationMatrix();
        ASSERT_LT((Vec3(motion.x[k], motion.y[k], motion.z[k]) - exact.translation).norm(), kSmallSpread) << s.primitives[0].name;
        for (int i = 0; i < 9; ++i) ASSERT_NEAR(motion.turn[i][k], r(i / 3, i % 3), kSmallSpread) << s.primitives[0].name;
      }
    }
    EXPECT_GT(all, 400u);
    EXPECT_GT(settled, all * 98 / 100) << s.primitives[0].name;  // the rest is asked one by one
  }
}

std::vector<double> numbersOf(const MotionBlock& m, std::size_t k) {
  return {m.x[k], m.y[k], m.z[k], m.qx[k], m.qy[k], m.qz[k], m.qw[k], m.nearness[k]};
}

std::vector<double> numbersOf(const MlsBlock& m, std::size_t k) {
  std::vector<double> n{m.x[k], m.y[k], m.z[k], m.settled[k]};
  for (const auto& channel : m.turn) n.push_back(channel[k]);
  return n;
}

template <class Motions>
bool sameBytes(const Motions& a, const Motions& b, std::size_t count) {
  for (std::size_t k = 0; k < count; ++k) {
    const auto x = numbersOf(a, k), y = numbersOf(b, k);
    if (std::memcmp(x.data(), y.data(), 8 * x.size()) != 0) return false;
  }
  return true;
}

TEST(PredictorBlocks, EveryInstructionSetWritesTheSameBytes) {
  for (const auto& s : skeletons()) {
    const Predictors p(s);
    const auto lines = AxialLines::of(s, p.samples);
    Block block;
    for (std::uint64_t b = 0; b < 20; ++b) {
      const std::size_t count = blockOf(s, b, block);
      MotionBlock axial, otherAxial;
      MlsBlock mls, otherMls;
      {
        const fielddeform::detail::SimdLimit limit(SimdLevel::Baseline);
        lines->at(block, count, axial);
        p.mls.at(block, count, mls);
      }
      for (const SimdLevel level : {SimdLevel::Avx2, SimdLevel::Avx512}) {
        if (level > fielddeform::detail::supportedSimdLevel()) continue;
        const fielddeform::detail::SimdLimit limit(level);
        lines->at(block, count, otherAxial);
        p.mls.at(block, count, otherMls);
        ASSERT_TRUE(sameBytes(axial, otherAxial, count)) << s.primitives[0].name << ' ' << toString(level);
        ASSERT_TRUE(sameBytes(mls, otherMls, count)) << s.primitives[0].name << ' ' << toString(level);
      }
    }
  }
}

TEST(PredictorBlocks, APointsMotionDoesNotDependOnItsBlock) {
  for (const auto& s : skeletons()) {
    const Predictors p(s);
    const auto lines = AxialLines::of(s, p.samples);
    Block block, alone;
    MotionBlock axial, oneAxial;
    MlsBlock mls, oneMls;
    for (std::uint64_t b = 0; b < 12; ++b) {
      const std::size_t count = blockOf(s, b, block);
      lines->at(block, count, axial);
      p.mls.at(block, count, mls);
      for (std::size_t k = 0; k < count; ++k) {
        alone.x[0] = block.x[k];
        alone.y[0] = block.y[k];
        alone.z[0] = block.z[k];
        lines->at(alone, 1, oneAxial);
        p.mls.at(alone, 1, oneMls);
        ASSERT_EQ(numbersOf(axial, k), numbersOf(oneAxial, 0)) << s.primitives[0].name;
        ASSERT_EQ(numbersOf(mls, k), numbersOf(oneMls, 0)) << s.primitives[0].name;
      }
    }
  }
}

TEST(AxialLines, LeavesMeshesAlone) {
  skeleton::Primitive p = primitive("shell", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, 0.5);
  p.type = skeleton::PrimitiveType::Mesh;
  p.faces = {{0, 1, 2}};
  const skeleton::Skeleton s{{p}, {}};
  EXPECT_FALSE(AxialLines::of(s, Predictors(s).samples));
}

}  // namespace
}  // namespace fielddeform::gffd::tests
