#pragma once

#include <fielddeform/numeric/elementary.h>
#include <fielddeform/spatial/simplex.h>

/// The bodies of simplex.h, inline for the trees.
namespace fielddeform::spatial::detail {

// Below this sine squared at corner a the projection on the plane gets the careful treatment, below the second one
// (rounding of the cross product) there is no plane.
inline constexpr double kThin = 1e-2, kFlat = 1e-28;
// Weights below this may be rounding: the edge decides, so that neighbours agree about their common edges and corners.
inline constexpr double kOnEdge = 1e-13;

// In the order of the lanes of closest_lanes.cpp, which must find the same bits.
inline double dot(const Vec3& a, const Vec3& b) noexcept { return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]; }
inline double square(const Vec3& a) noexcept { return dot(a, a); }

inline SimplexHit onPoint(const Vec3& p, const Vec3& a) noexcept {
  const Vec3 d = p - a;
  return {square(d), d, Vec3(1, 0, 0)};
}

// Closest point on a segment: the fraction t and the offset query - point. Ends are met exactly, so that neighbours
// sharing an end agree to the last bit.
struct EdgeHit {
  double squaredDistance, t;
  Vec3 offset;
};

inline EdgeHit onEdge(const Vec3& pa, const Vec3& pb, const Vec3& ab) noexcept {
  const double along = dot(pa, ab), length2 = square(ab);
  if (!(along > 0)) return {square(pa), 0, pa};
  if (!(along < length2)) return {square(pb), 1, pb};
  const double t = along / length2;
  // From the nearer end: the rounding of t counts less.
  const Vec3 offset = t < 0.5 ? Vec3(pa - t * ab) : Vec3(pb + (1 - t) * ab);
  return {square(offset), t, offset};
}

inline SimplexHit onSegment(const Vec3& p, const Vec3& a, const Vec3& b) noexcept {
  const EdgeHit e = onEdge(p - a, p - b, b - a);
  return {e.squaredDistance, e.offset, Vec3(1 - e.t, e.t, 0)};
}

// Makes the offset perpendicular to both edges of a thin triangle. Its normal is uncertain by rounding / sine; along
// the longer edge and across it the residual is not.
inline void refineProjection(const Vec3& ab, const Vec3& ac, double& v, double& w, Vec3& offset) noexcept {
  const bool swap = square(ac) > square(ab);
  const Vec3& e = swap ? ac : ab;
  const Vec3& f = swap ? ab : ac;
  double& onE = swap ? w : v;
  double& onF = swap ? v : w;
  const double e2 = square(e), t = dot(e, f) / e2;
  const Vec3 across = f - t * e;
  const double across2 = square(across);
  if (!(across2 > 0)) return;
  for (int i = 0; i < 3; ++i) {
    // Along first: what is left of it would be blown up by 1 / sine in the other step.
    const double de = dot(e, offset) / e2;
    offset -= de * e;
    const double df = dot(across, offset) / across2;
    offset -= df * across;
    onE += de - df * t;
    onF += df;
  }
}

inline SimplexHit onTriangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) noexcept {
  const Vec3 pa = p - a, ab = b - a, ac = c - a;
  const Vec3 n = ab.cross(ac);
  const double n2 = square(n), ab2 = square(ab), ac2 = square(ac);
  const bool thin = !(n2 > kThin * ab2 * ac2);
  bool acrossA = true, acrossB = true, acrossC = true;  // beyond the edge opposite to the corner
  SimplexHit best{std::numeric_limits<double>::infinity(), pa, Vec3(1, 0, 0)};
  if (n2 > kFlat * ab2 * ac2 && n2 > 0) {
    const double inverse = 1 / n2;
    double v = dot(n, pa.cross(ac)) * inverse, w = dot(n, ab.cross(pa)) * inverse;
    Vec3 offset = pa - v * ab - w * ac;
    if (thin) refineProjection(ab, ac, v, w, offset);
    const double u = 1 - v - w;
    if (u >= 0 && v >= 0 && w >= 0) best = {square(offset), offset, Vec3(u, v, w)};
    if (!thin) {
      acrossA = u < kOnEdge;
      acrossB = v < kOnEdge;
      acrossC = w < kOnEdge;
    }
  }
  // A convex polygon's closest point lies on an edge that the query is beyond.
  const Vec3 pb = p - b, pc = p - c;
  if (acrossC) {
    const EdgeHit e = onEdge(pa, pb, ab);
    if (e.squaredDistance < best.squaredDistance) best = {e.squaredDistance, e.offset, Vec3(1 - e.t, e.t, 0)};
  }
  if (acrossB) {
    const EdgeHit e = onEdge(pa, pc, ac);
    if (e.squaredDistance < best.squaredDistance) best = {e.squaredDistance, e.offset, Vec3(1 - e.t, 0, e.t)};
  }
  if (acrossA) {
    const EdgeHit e = onEdge(pb, pc, c - b);
    if (e.squaredDistance < best.squaredDistance) best = {e.squaredDistance, e.offset, Vec3(0, 1 - e.t, e.t)};
  }
  return best;
}

// Half a solid angle as a vector that points its way, of any length.
struct HalfAngle {
  double sine, cosine;
};

inline HalfAngle halfSolidAngle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) noexcept {
  const Vec3 u = a - p, v = b - p, w = c - p;
  const double lu = u.norm(), lv = v.norm(), lw = w.norm();
  // From edges: the triple product of nearby corners seen from afar would cancel.
  return {u.dot((b - a).cross(c - a)), lu * lv * lw + u.dot(v) * lw + v.dot(w) * lu + w.dot(u) * lv};
}

inline double solidAngle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) noexcept {
  const HalfAngle h = halfSolidAngle(p, a, b, c);
  return h.sine == 0 ? 0 : 2 * numeric::atan2(h.sine, h.cosine);
}

}  // namespace fielddeform::spatial::detail
