#include <fielddeform/spatial/simplex.h>
#include <gtest/gtest.h>

#include "shapes.h"

namespace fielddeform::spatial {
namespace {

using Real = long double;
using Vec3L = Eigen::Matrix<Real, 3, 1>;

Real segmentReference(const Vec3L& p, const Vec3L& a, const Vec3L& b) {
  const Vec3L d = b - a;
  const Real n = d.squaredNorm();
  const Real t = n > 0 ? std::min<Real>(1, std::max<Real>(0, (p - a).dot(d) / n)) : 0;
  return (a + t * d - p).norm();
}

// Independent of the code under test: extended precision, least squares on the plane, else the three edges.
Real triangleReference(const Vec3& p0, const Vec3& a0, const Vec3& b0, const Vec3& c0) {
  const Vec3L p = p0.cast<Real>(), a = a0.cast<Real>(), b = b0.cast<Real>(), c = c0.cast<Real>();
  Real best = std::min({segmentReference(p, a, b), segmentReference(p, b, c), segmentReference(p, c, a)});
  const Vec3L e = b - a, f = c - a, n = e.cross(f);
  if (n.squaredNorm() <= 1e-34L * e.squaredNorm() * f.squaredNorm()) return best;
  const Real v = n.dot((p - a).cross(f)) / n.squaredNorm(), w = n.dot(e.cross(p - a)) / n.squaredNorm();
  if (v >= 0 && w >= 0 && v + w <= 1) best = std::min(best, std::abs(n.dot(p - a)) / n.norm());
  return best;
}

double triangleError(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const SimplexHit hit = closestOnTriangle(p, a, b, c);
  EXPECT_GE(hit.weight.minCoeff(), 0);
  EXPECT_NEAR(hit.weight.sum(), 1, 4e-16);
  const Vec3 point = hit.weight[0] * a + hit.weight[1] * b + hit.weight[2] * c;
  EXPECT_LT((p - point - hit.offset).norm(), 1e-11);  // weights of a thin triangle: its sine is down to 1e-5
  EXPECT_EQ(hit.squaredDistance, hit.offset.squaredNorm());
  return static_cast<double>(std::abs(std::sqrt(static_cast<Real>(hit.squaredDistance)) - triangleReference(p, a, b, c)));
}

TEST(Simplex, TriangleDistanceAgreesWithExtendedPrecision) {
  double worst = 0;
  for (std::uint64_t i = 0; i < 100000; ++i)
    worst = std::max(worst, triangleError(randomPoint(1, 4 * i), randomPoint(1, 4 * i + 1), randomPoint(1, 4 * i + 2),
                                          randomPoint(1, 4 * i + 3)));
  EXPECT_LT(worst, 5e-15);  // of coordinates up to 1.7 in size
}

TEST(Simplex, ThinTrianglesKeepTheirDistance) {
  double worst = 0;
  for (std::uint64_t i = 0; i < 100000; ++i) {
    const Vec3 a = randomPoint(2, 4 * i), b = randomPoint(2, 4 * i + 1);
    const double thickness = std::ldexp(1.0, -static_cast<int>(i % 60));
    const Vec3 c = a + 1.5 * uniform01(3, i) * (b - a) + thickness * randomPoint(2, 4 * i + 2);
    worst = std::max(worst, triangleError(randomPoint(2, 4 * i + 3), a, b, c));
  }
  // A triangle thinner than 1e-14 is taken for its edges: at most that much nearer.
  EXPECT_LT(worst, 2e-14);
}

TEST(Simplex, PointsInAThinTriangleAreInIt) {
  double worst = 0;
  for (std::uint64_t i = 0; i < 20000; ++i) {
    const Vec3 a = randomPoint(4, 4 * i), b = randomPoint(4, 4 * i + 1);
    const Vec3 c = a + uniform01(3, i) * (b - a) + std::ldexp(1.0, -10 - static_cast<int>(i % 30)) * randomPoint(4, 4 * i + 2);
    const Vec3 p = (a + b + c) / 3;
    worst = std::max(worst, std::sqrt(closestOnTriangle(p, a, b, c).squaredDistance));
  }
  EXPECT_LT(worst, 5e-15);
}

TEST(Simplex, PointsOfTheTriangleHaveDistanceZero) {
  for (std::uint64_t i = 0; i < 10000; ++i) {
    const Vec3 a = randomPoint(5, 3 * i), b = randomPoint(5, 3 * i + 1), c = randomPoint(5, 3 * i + 2);
    const double u = uniform01(6, 2 * i), v = (1 - u) * uniform01(6, 2 * i + 1);
    EXPECT_LT(closestOnTriangle(a + u * (b - a) + v * (c - a), a, b, c).offset.norm(), 1e-14);
    EXPECT_EQ(closestOnTriangle(b, a, b, c).squaredDistance, 0);
    EXPECT_EQ(closestOnTriangle(b, a, b, c).weight, Vec3(0, 1, 0));
  }
}

TEST(Simplex, DegenerateTrianglesAreTheirSegmentOrPoint) {
  for (std::uint64_t i = 0; i < 2000; ++i) {
    const Vec3 p = randomPoint(7, 3 * i), a = randomPoint(7, 3 * i + 1), b = randomPoint(7, 3 * i + 2);
    const double segment = std::sqrt(closestOnSegment(p, a, b).squaredDistance);
    for (const auto& t : {std::array{a, b, b}, std::array{a, a, b}, std::array{a, b, a}, std::array{a, b, Vec3(0.5 * a + 0.5 * b)}})
      EXPECT_NEAR(std::sqrt(closestOnTriangle(p, t[0], t[1], t[2]).squaredDistance), segment, 1e-15);
    EXPECT_EQ(closestOnTriangle(p, a, a, a).squaredDistance, (p - a).squaredNorm());
    EXPECT_EQ(closestOnSegment(p, a, a).squaredDistance, (p - a).squaredNorm());
  }
}

TEST(Simplex, SegmentMeetsItsEndsExactly) {
  const Vec3 a(0.1, 0.2, 0.3), b(0.7, -0.3, 0.9);
  EXPECT_EQ(closestOnSegment(a - 3 * (b - a), a, b).weight, Vec3(1, 0, 0));
  EXPECT_EQ(closestOnSegment(b + 3 * (b - a), a, b).weight, Vec3(0, 1, 0));
  EXPECT_EQ(closestOnSegment(b, a, b).squaredDistance, 0);
  EXPECT_EQ(closestOnSegment(a, a, b).squaredDistance, 0);
}

TEST(Simplex, SolidAngleOfACubesFaceIsASixthOfTheSphere) {
  const Vec3 c[4] = {{1, -1, -1}, {1, 1, -1}, {1, 1, 1}, {1, -1, 1}};
  const double whole = 4 * 3.14159265358979323846;
  EXPECT_NEAR(solidAngle(Vec3::Zero(), c[0], c[1], c[2]) + solidAngle(Vec3::Zero(), c[0], c[2], c[3]), whole / 6, 1e-15);
  EXPECT_NEAR(solidAngle(Vec3(2, 0, 0), c[0], c[1], c[2]) + solidAngle(Vec3(2, 0, 0), c[0], c[2], c[3]), -whole / 6, 1e-15);
  EXPECT_EQ(solidAngle(Vec3(1, 5, 5), c[0], c[1], c[2]), 0);
  EXPECT_EQ(solidAngle(c[0], c[0], c[1], c[2]), 0);
}

}  // namespace
}  // namespace fielddeform::spatial
