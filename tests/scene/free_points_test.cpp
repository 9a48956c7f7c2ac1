#include <fielddeform/scene/detail/free_points.h>
#include <gtest/gtest.h>

#include <random>

namespace fielddeform::scene::detail {
namespace {

// What the tree replaces: every point is looked at.
class Plain {
 public:
  explicit Plain(std::vector<Vec3> points) : points_(std::move(points)), taken_(points_.size(), false) {}
  Index take(const Vec3& query, double tolerance) {
    Index best = kNoIndex;
    double least = tolerance;
    for (Index k = 0; k < points_.size(); ++k) {
      const double d = (points_[k] - query).norm();
      if (taken_[k] || d > least || (d == least && best != kNoIndex)) continue;
      best = k;
      least = d;
    }
    if (best != kNoIndex) taken_[best] = true;
    return best;
  }

 private:
  std::vector<Vec3> points_;
  std::vector<bool> taken_;
};

TEST(FreePoints, TakesWhatLookingAtEveryPointTakes) {
  std::mt19937 random(7);
  for (const int steps : {2, 5, 1000}) {  // few places with many points each, ties everywhere; then hardly any
    std::uniform_int_distribution<int> place(0, steps);
    const auto point = [&]() -> Vec3 { return Vec3(place(random), place(random), place(random)) / steps; };
    std::vector<Vec3> points(300);
    for (Vec3& p : points) p = point();
    FreePoints tree(points);
    for (int round = 0; round < 2; ++round) {
      Plain plain(points);
      for (int i = 0; i < 400; ++i) {
        const Vec3 query = point() + Vec3(1e-3, 0, -2e-3) * (i % 3);
        const double tolerance = i % 5 == 0 ? 0.5 : 2;
        ASSERT_EQ(tree.take(query, tolerance), plain.take(query, tolerance)) << steps << " " << i;
      }
      tree.release();
    }
  }
}

TEST(FreePoints, WithinToleranceIsInclusive) {
  FreePoints tree(std::vector<Vec3>{{1, 0, 0}, {-1, 0, 0}});
  EXPECT_EQ(tree.take({0, 0, 0}, 0.5), kNoIndex);
  EXPECT_EQ(tree.take({0, 0, 0}, 1), 0u);
  EXPECT_EQ(tree.take({0, 0, 0}, 1), 1u);
  EXPECT_EQ(tree.take({0, 0, 0}, 1), kNoIndex);
  FreePoints none(std::vector<Vec3>{});
  EXPECT_EQ(none.take({0, 0, 0}, 1), kNoIndex);
}

TEST(FreePoints, ManyPointsInOnePlaceAreTakenInOrder) {
  const std::vector<Vec3> points(50000, Vec3(0.1, 0.2, 0.3));
  FreePoints tree(points);
  for (Index k = 0; k < points.size(); ++k) ASSERT_EQ(tree.take({0, 0, 0}, 1), k);
}

}  // namespace
}  // namespace fielddeform::scene::detail
