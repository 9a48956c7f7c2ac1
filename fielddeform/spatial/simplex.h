#pragma once

#include <fielddeform/core/types.h>

namespace fielddeform::spatial {

/// Closest point on one point, segment or triangle. A degenerate one is treated as the segment or point that it is.
struct SimplexHit {
  double squaredDistance;
  Vec3 offset;  ///< query minus closest point
  Vec3 weight;  ///< barycentric weights of the closest point on the vertices, >= 0, sum 1; unused ones 0
};

/// Squared lengths must neither over- nor underflow: coordinates relative to the query of about 1e-140 to 1e140.
/// The squared distance depends on query and element alone, so equal elements give equal bits.
SimplexHit closestOnPoint(const Vec3& query, const Vec3& a) noexcept;
SimplexHit closestOnSegment(const Vec3& query, const Vec3& a, const Vec3& b) noexcept;
SimplexHit closestOnTriangle(const Vec3& query, const Vec3& a, const Vec3& b, const Vec3& c) noexcept;

/// Signed solid angle of a triangle seen from a point, in [-2 pi, 2 pi]; positive where the triangle's normal
/// (right-hand rule) points away from the point. 0 in its plane. [Van Oosterom & Strackee 1983]
double solidAngle(const Vec3& from, const Vec3& a, const Vec3& b, const Vec3& c) noexcept;

}  // namespace fielddeform::spatial
