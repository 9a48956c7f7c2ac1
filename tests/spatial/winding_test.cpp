#include <fielddeform/spatial/winding.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "shapes.h"

namespace fielddeform::spatial {
namespace {

TEST(WindingNumber, IsOneInsideAndZeroOutside) {
  const Soup s = sphere(30);
  const WindingNumber w(s.points, s.triangles);
  for (std::uint64_t i = 0; i < 3000; ++i) {
    const Vec3 p = randomPoint(1, i, 1.5);
    const double r = p.norm();
    if (r > 0.99 && r < 1.001) continue;  // the faceted surface itself
    EXPECT_NEAR(w.exactAt(p), r < 1 ? 1 : 0, 1e-12);
    EXPECT_NEAR(w.at(p), r < 1 ? 1 : 0, 0.1);
  }
}

TEST(WindingNumber, HierarchyAgreesWithTheSum) {
  Soup s;  // nothing closed: random triangles
  for (std::uint64_t t = 0; t < 2000; ++t) {
    const Vec3 at = randomPoint(2, 4 * t);
    for (std::uint64_t k = 1; k < 4; ++k) s.points.push_back(at + randomPoint(2, 4 * t + k, 0.05));
    const Index v = static_cast<Index>(3 * t);
    s.triangles.push_back({v, v + 1, v + 2});
  }
  const WindingNumber w(s.points, s.triangles);
  for (std::uint64_t i = 0; i < 1000; ++i) {
    const Vec3 p = randomPoint(3, i, 2);
    EXPECT_NEAR(w.at(p), w.exactAt(p), 0.1);
  }
}

TEST(WindingNumber, SmallHolesDoNoHarm) {
  Soup s = sphere(30);
  std::vector<std::array<Index, 3>> kept;
  for (std::size_t t = 0; t < s.triangles.size(); ++t)
    if (splitmix64(4, t) % 50 != 0) kept.push_back(s.triangles[t]);  // 2 % of the surface missing
  const WindingNumber w(s.points, kept);
  for (std::uint64_t i = 0; i < 3000; ++i) {
    const Vec3 p = randomPoint(5, i, 1.5);
    if (std::abs(p.norm() - 1) > 0.1) {
      EXPECT_EQ(w.at(p) > 0.5, p.norm() < 1);
    }
  }
}

TEST(WindingNumber, DoesNotSeePowersOfTwoNorDistanceFromTheOrigin) {
  const Soup s = sphere(12), far = sphere(12, 1, Vec3(1e4, 2e4, -1e4));
  Soup scaled = s;
  for (Vec3& p : scaled.points) p *= 1024;
  const WindingNumber a(s.points, s.triangles), b(scaled.points, scaled.triangles), c(far.points, far.triangles);
  for (std::uint64_t i = 0; i < 500; ++i) {
    const Vec3 p = randomPoint(6, i, 1.5);
    EXPECT_EQ(a.at(p), b.at(1024 * p));
    EXPECT_NEAR(a.at(p), c.at(p + Vec3(1e4, 2e4, -1e4)), 0.1);
  }
}

TEST(WindingNumber, EdgeCasesGiveNumbers) {
  const Soup s = sphere(6);
  const WindingNumber w(s.points, s.triangles);
  for (const Vec3& p : s.points) EXPECT_TRUE(std::isfinite(w.at(p)));
  EXPECT_EQ(w.at(Vec3(std::nan(""), 0, 0)), 0);
  EXPECT_EQ(w.at(Vec3(1e308, 0, 0)), 0);
  EXPECT_EQ(WindingNumber({}, {}).at(Vec3::Zero()), 0);
  EXPECT_EQ(WindingNumber({}, {}).exactAt(Vec3::Zero()), 0);
  const std::vector<std::array<Index, 3>> outOfRange{{0, 1, 99999}};
  EXPECT_THROW(WindingNumber(s.points, outOfRange), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::spatial
