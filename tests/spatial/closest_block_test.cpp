// Blocks of queries against the same queries one by one: every bit.
#include <fielddeform/core/detail/simd.h>
#include <fielddeform/spatial/closest_tree.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <stdexcept>

#include "shapes.h"

namespace fielddeform::spatial {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
using fielddeform::detail::SimdLevel;

// To the bit: zeros of both signs differ.
bool same(const Vec3& a, const Vec3& b) { return std::memcmp(a.data(), b.data(), sizeof(Vec3)) == 0; }
bool same(const ClosestPoint& a, const ClosestPoint& b) {
  return a.element == b.element && a.distance == b.distance && same(a.point, b.point) && same(a.offset, b.offset) &&
         same(a.weight, b.weight);
}

struct Shape {
  const char* name;
  Soup soup;
};

// Spheres coarse and fine, a soup, slivers, points and lines among the triangles, every triangle twice, a flat patch,
// coordinates far from the origin.
std::vector<Shape> shapes() {
  std::vector<Shape> all;
  all.push_back({"coarse sphere", sphere(4)});
  all.push_back({"fine sphere", sphere(48)});
  all.push_back({"far sphere", sphere(10, 1, Vec3(1e5, -3e5, 2e5))});
  Soup soup, thin;
  for (Index t = 0; t < 300; ++t) {
    const Vec3 at = randomPoint(1, 4 * t), along = randomPoint(2, t, 0.4);
    for (std::uint64_t k = 1; k < 4; ++k) soup.points.push_back(at + randomPoint(1, 4 * t + k, 0.3));
    soup.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
    // From needles to what has no plane at all: two corners in one place, three in a row, three in one place.
    const double width = std::pow(10.0, -static_cast<double>(t % 20));
    thin.points.push_back(at);
    thin.points.push_back(t % 7 == 3 ? at : Vec3(at + along));
    thin.points.push_back(t % 7 == 3 ? (t % 2 ? at : Vec3(at + along)) : t % 7 == 5 ? Vec3(at + 0.25 * along) : Vec3(at + 0.6 * along + randomPoint(3, t, width)));
    thin.triangles.push_back({3 * t, 3 * t + 1 + t % 2, 3 * t + 2 - t % 2});
  }
  all.push_back({"soup", soup});
  all.push_back({"thin", thin});
  Soup twice = sphere(8);
  const auto copy = twice.triangles;
  for (const auto& t : copy) twice.triangles.push_back({t[1], t[2], t[0]});
  for (const auto& t : copy) twice.triangles.push_back(t);
  all.push_back({"twice", twice});
  Soup patch;
  for (Index i = 0; i < 81; ++i) patch.points.emplace_back(0.25 * (i % 9) - 1, 0.25 * (i / 9) - 1, 0);
  for (Index i = 0; i < 72; ++i)
    if (i % 9 != 8) {
      patch.triangles.push_back({i, i + 1, i + 10});
      patch.triangles.push_back({i, i + 10, i + 9});
    }
  all.push_back({"patch", patch});
  return all;
}

// Queries in blocks of 64: small clouds far and near, wide ones, exact corners, middles of edges and their mirror images
// (equally far from several triangles), and one point many times.
std::vector<Vec3> queriesAround(const Soup& s, std::uint64_t seed) {
  std::vector<Vec3> q;
  const double sizes[] = {1e-3, 0.02, 0.1, 1, 0, 30};
  for (std::uint64_t b = 0; b < 48; ++b) {
    const auto& t = s.triangles[splitmix64(seed, b) % s.triangles.size()];
    const Vec3 at = (s.points[t[0]] + s.points[t[1]] + s.points[t[2]]) / 3, out = randomPoint(seed, 1000 + b, b % 3 ? 0.3 : 0);
    for (std::uint64_t k = 0; k < 64; ++k) {
      Vec3 p = at + out + randomPoint(seed + 1, 64 * b + k, sizes[b % 6]);
      if (k % 9 == 4) p = s.points[t[k % 3]];
      if (k % 9 == 7) p = 0.5 * (s.points[t[0]] + s.points[t[1]]) + Vec3(0, 0, k % 2 ? 0.125 : -0.125);
      q.push_back(p);
    }
  }
  return q;
}

TEST(ClosestBlock, TrianglesGetTheBytesOfSingleQueriesInAnyInstructionSet) {
  for (const Shape& shape : shapes()) {
    const ClosestTree tree = ClosestTree::ofTriangles(shape.soup.points, shape.soup.triangles);
    const std::vector<Vec3> q = queriesAround(shape.soup, 11);
    std::vector<ClosestPoint> expected(q.size()), found(q.size());
    for (std::size_t i = 0; i < q.size(); ++i) expected[i] = tree.closest(q[i]);
    for (const SimdLevel level : {SimdLevel::Baseline, SimdLevel::Avx2, SimdLevel::Avx512}) {
      if (level > fielddeform::detail::supportedSimdLevel()) continue;
      const fielddeform::detail::SimdLimit limit(level);
      for (const std::size_t call : {q.size(), std::size_t{64}, std::size_t{7}}) {
        ClosestTree::BlockHint hint;
        for (std::size_t begin = 0; begin < q.size(); begin += call) {
          const std::size_t n = std::min(call, q.size() - begin);
          tree.closestTogether(std::span(q).subspan(begin, n), std::span(found).subspan(begin, n), hint);
        }
        for (std::size_t i = 0; i < q.size(); ++i)
          ASSERT_TRUE(same(found[i], expected[i])) << shape.name << ' ' << toString(level) << ' ' << call << ' ' << i << " element "
                                                   << found[i].element << ' ' << expected[i].element << " apart " << found[i].distance - expected[i].distance;
      }
    }
  }
}

// A call's queries come again, moved a little, fewer of them, with another bound, to another tree: never another byte.
TEST(ClosestBlock, QueriesThatComeAgainGetTheBytesOfSingleQueries) {
  for (const Shape& shape : shapes()) {
    const ClosestTree tree = ClosestTree::ofTriangles(shape.soup.points, shape.soup.triangles);
    const Soup other = sphere(7, 1.5);
    const ClosestTree otherTree = ClosestTree::ofTriangles(other.points, other.triangles);
    const std::vector<Vec3> q = queriesAround(shape.soup, 17);
    ClosestTree::BlockHint hint;
    std::vector<ClosestPoint> found(64);
    for (std::size_t begin = 0; begin < q.size(); begin += 64) {
      for (int round = 0; round < 6; ++round) {
        std::vector<Vec3> some;
        for (std::size_t i = begin; i < begin + 64; ++i) {
          if (round >= 2 && i % 5 == static_cast<std::size_t>(round)) continue;
          const Vec3 moved = q[i] + static_cast<double>(round) * randomPoint(18, i, round == 3 ? 0.1 : 1e-5);
          some.push_back(round == 5 && i % 64 == 40 ? Vec3(moved * std::numeric_limits<double>::quiet_NaN()) : moved);
        }
        const ClosestTree& asked = round == 4 ? otherTree : tree;
        const double bound = round == 2 ? 0.05 : kInf;
        const auto answers = std::span(found).first(some.size());
        asked.closestTogether(some, answers, hint, bound);
        for (std::size_t i = 0; i < some.size(); ++i)
          ASSERT_TRUE(same(answers[i], asked.closest(some[i], {.maxDistance = bound}))) << shape.name << ' ' << begin << ' ' << round << ' ' << i;
      }
    }
  }
}

TEST(ClosestBlock, AKnownElementGivesTheBytesOfTheSearch) {
  for (const Shape& shape : shapes()) {
    const ClosestTree tree = ClosestTree::ofTriangles(shape.soup.points, shape.soup.triangles);
    for (const Vec3& p : queriesAround(shape.soup, 19)) {
      const ClosestPoint expected = tree.closest(p);
      ASSERT_TRUE(same(tree.closestOn(expected.element, p), expected)) << shape.name;
    }
    const Vec3 far(1e300, -1e299, 3);
    EXPECT_TRUE(same(tree.closestOn(tree.closest(far).element, far), tree.closest(far)));
    EXPECT_EQ(tree.closestOn(kNoIndex, Vec3::Zero()).element, kNoIndex);
    EXPECT_EQ(tree.closestOn(0, Vec3::Constant(std::numeric_limits<double>::quiet_NaN())).element, kNoIndex);
  }
}

TEST(ClosestBlock, ABoundLeavesTheSameQueriesWithoutAnAnswer) {
  const Soup s = sphere(12);
  const ClosestTree tree = ClosestTree::ofTriangles(s.points, s.triangles);
  const std::vector<Vec3> q = queriesAround(s, 21);
  std::size_t none = 0;
  for (const double bound : {0.0, 0.05, 0.2, 5.0}) {
    ClosestTree::BlockHint hint;
    std::vector<ClosestPoint> found(q.size());
    tree.closestTogether(q, found, hint, bound);
    for (std::size_t i = 0; i < q.size(); ++i) {
      const ClosestPoint expected = tree.closest(q[i], {.maxDistance = bound});
      ASSERT_TRUE(same(found[i], expected)) << bound << ' ' << i;
      none += expected.element == kNoIndex;
    }
  }
  EXPECT_GT(none, q.size() / 2);
}

TEST(ClosestBlock, PointsAndSegmentsGetTheBytesOfSingleQueries) {
  std::vector<Vec3> points;
  std::vector<std::array<Index, 2>> segments;
  for (Index i = 0; i < 400; ++i) {
    const double t = 0.05 * i;
    points.push_back(i % 50 == 7 ? points.back() : Vec3(std::cos(t), std::sin(t), 0.05 * t));
    if (i > 0) segments.push_back({i - 1, i});
  }
  Soup corners;  // only for the queries
  corners.points = points;
  for (Index i = 0; i + 2 < 400; ++i) corners.triangles.push_back({i, i + 1, i + 2});
  const std::vector<Vec3> q = queriesAround(corners, 31);
  for (const ClosestTree& tree : {ClosestTree::ofPoints(points), ClosestTree::ofSegments(points, segments)}) {
    ClosestTree::BlockHint hint;
    std::vector<ClosestPoint> found(q.size());
    tree.closestTogether(q, found, hint);
    for (std::size_t i = 0; i < q.size(); ++i) ASSERT_TRUE(same(found[i], tree.closest(q[i]))) << i;
  }
}

TEST(ClosestBlock, QueriesThatAreNotFiniteOrVeryFarAreAnsweredAsSingleOnes) {
  const Soup s = sphere(6);
  const ClosestTree tree = ClosestTree::ofTriangles(s.points, s.triangles);
  std::vector<Vec3> q = queriesAround(s, 41);
  q.resize(256);
  q[5][1] = std::numeric_limits<double>::quiet_NaN();
  q[70][0] = kInf;
  q[140] = Vec3(1e300, 1, 0);
  q[150] = Vec3(1e160, 1e150, 0);
  q[200] = Vec3(0, 1e-300, 0);
  ClosestTree::BlockHint hint;
  std::vector<ClosestPoint> found(q.size());
  tree.closestTogether(q, found, hint);
  for (std::size_t i = 0; i < q.size(); ++i) EXPECT_TRUE(same(found[i], tree.closest(q[i]))) << i;
  EXPECT_EQ(found[5].element, kNoIndex);
}

TEST(ClosestBlock, ScalingByAPowerOfTwoScalesEveryByte) {
  Soup s = sphere(9);
  std::vector<Vec3> q = queriesAround(s, 51);
  const ClosestTree small = ClosestTree::ofTriangles(s.points, s.triangles);
  std::vector<ClosestPoint> a(q.size()), b(q.size());
  ClosestTree::BlockHint hint, other;
  small.closestTogether(q, a, hint);
  for (Vec3& p : s.points) p *= 0x1p300;
  for (Vec3& p : q) p *= 0x1p300;
  ClosestTree::ofTriangles(s.points, s.triangles).closestTogether(q, b, other);
  for (std::size_t i = 0; i < q.size(); ++i) {
    ASSERT_EQ(a[i].element, b[i].element);
    ASSERT_EQ(0x1p300 * a[i].distance, b[i].distance);
    ASSERT_EQ(a[i].weight, b[i].weight);
  }
}

TEST(ClosestBlock, AnEmptyTreeAndAWrongSizeAreHandled) {
  const ClosestTree tree = ClosestTree::ofTriangles({}, {});
  std::vector<Vec3> q(20, Vec3::Ones());
  std::vector<ClosestPoint> found(q.size());
  ClosestTree::BlockHint hint;
  tree.closestTogether(q, found, hint);
  for (const ClosestPoint& c : found) EXPECT_EQ(c.element, kNoIndex);
  tree.closestTogether({}, {}, hint);
  EXPECT_THROW(tree.closestTogether(q, std::span(found).first(3), hint), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::spatial
