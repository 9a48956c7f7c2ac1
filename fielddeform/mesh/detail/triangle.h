#pragma once

#include <fielddeform/core/types.h>

#include <algorithm>

/// Small things about one triangle, shared by measures, quality and normals.
namespace fielddeform::mesh::detail {

/// A triangle counts as degenerate when twice its area is at most this share of its longest side squared.
inline constexpr double kDegenerate = 1e-12;

/// Twice the area times the unit normal.
inline Vec3 areaVector(const Vec3& a, const Vec3& b, const Vec3& c) { return (b - a).cross(c - a); }

inline double longestSideSquared(const Vec3& a, const Vec3& b, const Vec3& c) {
  return std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
}

/// False for degenerate triangles and for those with a non-finite coordinate.
inline bool hasArea(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& area) {
  const double longest = longestSideSquared(a, b, c), limit = kDegenerate * longest;
  return area.squaredNorm() > limit * limit && area.allFinite();
}

/// Largest cotangent of the triangle's angles: that of the smallest angle.
inline double largestCotangent(const Vec3& a, const Vec3& b, const Vec3& c, double twiceArea) {
  return std::max({(b - a).dot(c - a), (a - b).dot(c - b), (a - c).dot(b - c)}) / twiceArea;
}

}  // namespace fielddeform::mesh::detail
