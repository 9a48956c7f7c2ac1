#include <fielddeform/spatial/detail/simplex_inline.h>

namespace fielddeform::spatial {

SimplexHit closestOnPoint(const Vec3& query, const Vec3& a) noexcept { return detail::onPoint(query, a); }
SimplexHit closestOnSegment(const Vec3& query, const Vec3& a, const Vec3& b) noexcept {
  return detail::onSegment(query, a, b);
}
SimplexHit closestOnTriangle(const Vec3& query, const Vec3& a, const Vec3& b, const Vec3& c) noexcept {
  return detail::onTriangle(query, a, b, c);
}
double solidAngle(const Vec3& from, const Vec3& a, const Vec3& b, const Vec3& c) noexcept {
  return detail::solidAngle(from, a, b, c);
}

}  // namespace fielddeform::spatial
