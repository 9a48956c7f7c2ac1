#include <fielddeform/core/parallel.h>
#include <fielddeform/spatial/closest_tree.h>
#include <fielddeform/spatial/simplex.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "shapes.h"

namespace fielddeform::spatial {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

bool same(const ClosestPoint& a, const ClosestPoint& b) {
  return a.element == b.element && a.distance == b.distance && a.point == b.point && a.offset == b.offset &&
         a.weight == b.weight;
}

// First element of the smallest squared distance, over all elements, in coordinates whose squares are in range.
Index bruteForce(const Soup& s, const Vec3& p) {
  Index best = kNoIndex;
  double d2 = kInf;
  for (Index t = 0; t < s.triangles.size(); ++t) {
    const auto& c = s.triangles[t];
    const double d = closestOnTriangle(p, s.points[c[0]], s.points[c[1]], s.points[c[2]]).squaredDistance;
    if (d < d2) {
      d2 = d;
      best = t;
    }
  }
  return best;
}

Soup randomSoup(std::uint64_t seed, std::size_t triangles, double size, const Vec3& centre) {
  Soup s;
  for (std::size_t t = 0; t < triangles; ++t) {
    const Vec3 at = centre + randomPoint(seed, 4 * t);
    for (std::uint64_t k = 0; k < 3; ++k) s.points.push_back(at + randomPoint(seed, 4 * t + 1 + k, size));
    const Index v = static_cast<Index>(3 * t);
    s.triangles.push_back({v, v + 1, v + 2});
  }
  return s;
}

TEST(ClosestTree, TrianglesAgreeWithBruteForceToTheLastBit) {
  for (const Soup& s : {randomSoup(1, 300, 0.1, Vec3::Zero()), randomSoup(2, 300, 2, Vec3::Zero()), sphere(12),
                        randomSoup(3, 300, 0.2, Vec3(1e4, -1e4, 2e4))}) {
    const ClosestTree tree = ClosestTree::ofTriangles(s.points, s.triangles);
    for (std::uint64_t i = 0; i < 3000; ++i) {
      const Vec3 p = s.points[0] + randomPoint(9, i, i % 2 ? 1.5 : 30);
      const ClosestPoint hit = tree.closest(p);
      const Index expected = bruteForce(s, p);
      ASSERT_EQ(hit.element, expected) << i;
      const auto& c = s.triangles[expected];
      const SimplexHit direct = closestOnTriangle(p, s.points[c[0]], s.points[c[1]], s.points[c[2]]);
      EXPECT_EQ(hit.distance, std::sqrt(direct.squaredDistance));
      EXPECT_EQ(hit.weight, direct.weight);
      EXPECT_EQ(hit.offset, direct.offset);
      const double size = s.points[0].norm() + 30;
      EXPECT_LT((hit.point - (p - direct.offset)).norm(), 1e-15 * size);
    }
  }
}

TEST(ClosestTree, PointsAndSegmentsAgreeWithBruteForce) {
  std::vector<Vec3> points;
  for (std::uint64_t i = 0; i < 500; ++i) points.push_back(randomPoint(4, i));
  std::vector<std::array<Index, 2>> segments;
  for (Index i = 0; i + 1 < 500; ++i) segments.push_back({i, i + 1});
  segments.push_back({7, 7});
  const ClosestTree ofPoints = ClosestTree::ofPoints(points), ofSegments = ClosestTree::ofSegments(points, segments);
  for (std::uint64_t i = 0; i < 5000; ++i) {
    const Vec3 p = randomPoint(5, i, 1.5);
    Index bestPoint = 0, bestSegment = 0;
    double d2 = kInf, e2 = kInf;
    for (Index k = 0; k < 500; ++k)
      if (const double d = closestOnPoint(p, points[k]).squaredDistance; d < d2) d2 = d, bestPoint = k;
    for (Index k = 0; k < segments.size(); ++k)
      if (const double d = closestOnSegment(p, points[segments[k][0]], points[segments[k][1]]).squaredDistance; d < e2)
        e2 = d, bestSegment = k;
    EXPECT_EQ(ofPoints.closest(p).element, bestPoint);
    EXPECT_EQ(ofPoints.closest(p).distance, std::sqrt(d2));
    EXPECT_EQ(ofPoints.closest(p).point, points[bestPoint]);
    EXPECT_EQ(ofSegments.closest(p).element, bestSegment);
    EXPECT_EQ(ofSegments.closest(p).distance, std::sqrt(e2));
  }
}

TEST(ClosestTree, SphereIsWhereItShouldBe) {
  const Soup s = sphere(60);
  const ClosestTree tree = ClosestTree::ofTriangles(s.points, s.triangles);
  // A chord of pi/60 lies at most 1 - cos(pi/120 * sqrt 2) inside the sphere.
  const double sagitta = 7e-4;
  for (std::uint64_t i = 0; i < 10000; ++i) {
    const Vec3 p = randomPoint(6, i, 2);
    const ClosestPoint hit = tree.closest(p);
    const double d = p.norm() - 1;
    EXPECT_NEAR(hit.distance, std::abs(d), sagitta);
    EXPECT_NEAR((p - hit.point).norm(), hit.distance, 1e-15);
  }
}

TEST(ClosestTree, TiesTakeTheLowestElement) {
  // All corners of a fan meet in the first point; and every element exists three times.
  Soup fan;
  fan.points.push_back(Vec3::Zero());
  for (int k = 0; k < 40; ++k) fan.points.push_back(Vec3(std::cos(k * 0.1), std::sin(k * 0.1), -1));
  for (Index round = 0; round < 3; ++round)
    for (Index k = 1; k < 40; ++k) fan.triangles.push_back({0, k, k + 1});
  const ClosestTree tree = ClosestTree::ofTriangles(fan.points, fan.triangles);
  EXPECT_EQ(tree.closest(Vec3(0, 0, 2)).element, 0u);
  EXPECT_EQ(tree.closest(Vec3(0, 0, 2)).weight, Vec3(1, 0, 0));
  for (std::uint64_t i = 0; i < 2000; ++i) {
    const Vec3 p = randomPoint(8, i, 2);
    EXPECT_LT(tree.closest(p).element, 39u);
    EXPECT_EQ(tree.closest(p).element, bruteForce(fan, p));
  }
  const std::vector<Vec3> coincident(1000, Vec3(1, 2, 3));
  EXPECT_EQ(ClosestTree::ofPoints(coincident).closest(Vec3(4, 4, 4)).element, 0u);
}

TEST(ClosestTree, AHintNeverChangesTheAnswer) {
  const Soup s = sphere(8);  // the centre sees many ties
  const ClosestTree tree = ClosestTree::ofTriangles(s.points, s.triangles);
  for (std::uint64_t i = 0; i < 2000; ++i) {
    const Vec3 p = i == 0 ? Vec3::Zero() : randomPoint(10, i);
    const ClosestPoint plain = tree.closest(p);
    const Index hint = static_cast<Index>(splitmix64(11, i) % s.triangles.size());
    EXPECT_TRUE(same(plain, tree.closest(p, {.hint = hint})));
    EXPECT_TRUE(same(plain, tree.closest(p, {.hint = kNoIndex - 1})));
  }
}

TEST(ClosestTree, BoundLeavesOutWhatIsFarther) {
  const Soup s = sphere(8);
  const ClosestTree tree = ClosestTree::ofTriangles(s.points, s.triangles);
  for (std::uint64_t i = 0; i < 500; ++i) {
    const Vec3 p = randomPoint(12, i, 2);
    const ClosestPoint hit = tree.closest(p);
    EXPECT_TRUE(same(hit, tree.closest(p, {.maxDistance = hit.distance})));
    EXPECT_TRUE(same(hit, tree.closest(p, {.maxDistance = 1.01 * hit.distance})));
    EXPECT_EQ(tree.closest(p, {.maxDistance = 0.999 * hit.distance}).element, kNoIndex);
    EXPECT_EQ(tree.closest(p, {.maxDistance = 0.5 * hit.distance, .hint = 3}).element, kNoIndex);
  }
}

TEST(ClosestTree, PowersOfTwoScaleEveryBit) {
  const Soup s = randomSoup(13, 200, 0.3, Vec3(0.3, 0.2, 5));
  const ClosestTree tree = ClosestTree::ofTriangles(s.points, s.triangles);
  for (const int e : {10, -10, 600, -600, 1015, -1000}) {
    const double f = std::ldexp(1.0, e);
    Soup scaled = s;
    for (Vec3& v : scaled.points) v *= f;
    const ClosestTree other = ClosestTree::ofTriangles(scaled.points, scaled.triangles);
    for (std::uint64_t i = 0; i < 500; ++i) {
      const Vec3 p = randomPoint(14, i, 6);
      const ClosestPoint a = tree.closest(p), b = other.closest(p * f);
      EXPECT_EQ(a.element, b.element);
      EXPECT_EQ(a.distance * f, b.distance);
      EXPECT_EQ(Vec3(a.point * f), b.point);
      EXPECT_EQ(a.weight, b.weight);
    }
  }
}

TEST(ClosestTree, HugeAndDenormalCoordinatesStayExact) {
  for (const double unit : {1.7e308 / 4, 5e-324 * 1048576, 5e-324}) {
    const std::vector<Vec3> points{Vec3(0, 0, 0), Vec3(4 * unit, 0, 0), Vec3(0, 4 * unit, 0)};
    const std::vector<std::array<Index, 3>> triangle{{0, 1, 2}};
    const ClosestTree tree = ClosestTree::ofTriangles(points, triangle);
    const ClosestPoint above = tree.closest(Vec3(unit, unit, 2 * unit));
    EXPECT_EQ(above.distance, 2 * unit);
    EXPECT_EQ(above.point, Vec3(unit, unit, 0));
    EXPECT_EQ(tree.closest(Vec3(-3 * unit, 0, 0)).distance, 3 * unit);
  }
  // A query that is far beyond the elements' range of squares, and one that is denormally near.
  const std::vector<Vec3> one{Vec3::Zero(), Vec3(1, 0, 0)};
  const ClosestTree tree = ClosestTree::ofPoints(one);
  EXPECT_DOUBLE_EQ(tree.closest(Vec3(0, 1e308, 0)).distance, 1e308);
  EXPECT_DOUBLE_EQ(tree.closest(Vec3(0, 1e-320, 0)).distance, 1e-320);
  EXPECT_DOUBLE_EQ(ClosestTree::ofPoints(Points(one.data(), 1)).closest(Vec3(3e-200, 4e-200, 0)).distance, 5e-200);
}

TEST(ClosestTree, NothingFoundWhereThereIsNothingToFind) {
  const ClosestTree none = ClosestTree::ofPoints({});
  EXPECT_EQ(none.closest(Vec3::Zero()).element, kNoIndex);
  EXPECT_EQ(none.closest(Vec3::Zero()).distance, kInf);
  const std::vector<Vec3> one{Vec3::Zero()};
  const ClosestTree tree = ClosestTree::ofPoints(one);
  EXPECT_EQ(tree.closest(Vec3(std::nan(""), 0, 0)).element, kNoIndex);
  EXPECT_EQ(tree.closest(Vec3(0, kInf, 0)).element, kNoIndex);
  EXPECT_EQ(tree.closest(Vec3(0, 1, 0), {.maxDistance = std::nan("")}).element, kNoIndex);
}

TEST(ClosestTree, BadInputIsRefused) {
  const std::vector<Vec3> points{Vec3::Zero(), Vec3(1, 0, 0), Vec3(0, std::nan(""), 0)};
  const std::vector<std::array<Index, 2>> outOfRange{{0, 7}};
  EXPECT_THROW(ClosestTree::ofPoints(points), std::invalid_argument);
  EXPECT_THROW(ClosestTree::ofSegments(Points(points.data(), 2), outOfRange), std::invalid_argument);
}

TEST(ClosestTree, DegenerateInputNeitherRecursesNorLoses) {
  // 50,000 equal triangles, all on one line, with equal middles.
  std::vector<Vec3> points{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0.25, 0, 0)};
  const std::vector<std::array<Index, 3>> triangles(50000, {0, 1, 2});
  const ClosestTree tree = ClosestTree::ofTriangles(points, triangles);
  EXPECT_EQ(tree.closest(Vec3(0.5, 0.5, 0)).distance, 0.5);
  EXPECT_EQ(tree.closest(Vec3(0.5, 0.5, 0)).element, 0u);
}

TEST(ClosestTree, BatchesEqualSingleQueriesOnAnyThreadCount) {
  const Soup s = sphere(30);
  const ClosestTree tree = ClosestTree::ofTriangles(s.points, s.triangles);
  std::vector<Vec3> queries;
  for (std::uint64_t i = 0; i < 10000; ++i) queries.push_back(randomPoint(15, i));
  queries[5000] = Vec3(std::nan(""), 0, 0);
  std::vector<ClosestPoint> expected;
  for (const Vec3& q : queries) expected.push_back(tree.closest(q));
  for (const int threads : {1, 2, 7}) {
    const ThreadLimit limit(threads);
    std::vector<ClosestPoint> out(queries.size());
    tree.closest(queries, out);
    for (std::size_t i = 0; i < out.size(); ++i) EXPECT_TRUE(same(out[i], expected[i]));
  }
  std::vector<ClosestPoint> wrong(3);
  EXPECT_THROW(tree.closest(queries, wrong), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::spatial
