#include <fielddeform/render/detail/smooth_normals.h>
#include <gtest/gtest.h>
#include <tests/support/cases.h>

#include <numbers>

namespace fielddeform::render::detail {
namespace {

using Eigen::Vector3f;

/// A cube of side 2 about the origin; corners of all faces are points of their own, as in a triangle soup.
void cubeSoup(std::vector<Vector3f>& points, std::vector<Index>& corners) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const float side : {-1.0f, 1.0f}) {
      const Index base = static_cast<Index>(points.size());
      for (const auto& [u, v] : {std::pair{-1.0f, -1.0f}, {1.0f, -1.0f}, {1.0f, 1.0f}, {-1.0f, 1.0f}}) {
        Vector3f p;
        p[axis] = side, p[(axis + 1) % 3] = u * side, p[(axis + 2) % 3] = v;
        points.push_back(p);
      }
      for (const Index i : {0u, 1u, 2u, 0u, 2u, 3u}) corners.push_back(base + i);
    }
  }
}

TEST(SmoothNormals, KeepACubesEdgesSharp) {
  std::vector<Vector3f> points;
  std::vector<Index> corners;
  cubeSoup(points, corners);
  const auto normals = smoothNormals(points, corners, 0.7);
  for (std::size_t c = 0; c < corners.size(); ++c) {
    EXPECT_NEAR(normals[c].cwiseAbs().maxCoeff(), 1, 1e-6);  // along an axis
    EXPECT_GT(normals[c].dot(points[corners[c]]), 0.99f);    // outwards: the face's own
  }
}

TEST(SmoothNormals, RoundACubeWhenAllEdgesAreSmoothEvenInASoup) {
  std::vector<Vector3f> points;
  std::vector<Index> corners;
  cubeSoup(points, corners);
  const auto normals = smoothNormals(points, corners, std::numbers::pi);
  // By angle each face counts a right angle, however it is cut: the diagonal, exactly.
  for (std::size_t c = 0; c < corners.size(); ++c) {
    EXPECT_NEAR((normals[c] - points[corners[c]].normalized()).norm(), 0, 1e-6);
  }
}

TEST(SmoothNormals, OfASphereAreRadialAtPolesToo) {
  const auto sphere = tests::makeCapsule({.length = 0, .radius = 1, .around = 100, .along = 50, .bump = 0});
  std::vector<Vector3f> points;
  for (const Vec3& p : sphere.positions()) points.push_back(p.cast<float>());
  const auto normals = smoothNormals(points, sphere.corners(), 0.7);  // the poles have 100 neighbours
  for (std::size_t c = 0; c < normals.size(); ++c) {
    // Facets of 0.06 radians: their weighted mean is off by a fraction of that.
    EXPECT_GT(normals[c].dot(points[sphere.corners()[c]]), std::cos(0.02f));
  }
}

TEST(SmoothNormals, DegenerateTrianglesGiveNoNan) {
  const std::vector<Vector3f> points{{0, 0, 0}, {0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  for (const double crease : {0.0, 0.7, 3.1415926535897931}) {
    for (const auto& n : smoothNormals(points, {0, 1, 2, 0, 2, 3, 1, 1, 1}, crease)) EXPECT_TRUE(n.allFinite());
  }
}

}  // namespace
}  // namespace fielddeform::render::detail
