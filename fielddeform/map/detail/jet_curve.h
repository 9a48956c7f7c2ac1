#pragma once

#include <fielddeform/map/detail/jet.h>
#include <fielddeform/map/spline_curve.h>

namespace fielddeform::map::detail {

/// The point of a curve at a parameter, and its derivative, as functions of the point of space that the parameter is of.
inline JetVec pointAt(const SplineCurve::Place& place, const Jet& t) { return {place.point, place.first * t.g.transpose()}; }
inline JetVec tangentAt(const SplineCurve::Place& place, const Jet& t) { return {place.first, place.second * t.g.transpose()}; }

/// The parameter of the closest point: inside the curve (x - C) . C' = 0, so that
/// dt = C'^T dx / (|C'|^2 - (x - C) . C''); constant beyond its ends, and where the point is the centre of curvature.
inline Jet closestAt(const SplineCurve& curve, const JetVec& x, const SplineCurve::Foot& foot) {
  Jet t{foot.t, Vec3::Zero()};
  if (!foot.inside) return t;
  const SplineCurve::Place p = curve.at(foot.t);
  const double denominator = p.first.squaredNorm() - (x.v - p.point).dot(p.second);
  if (denominator > 1e-12 * p.first.squaredNorm()) t.g = x.j.transpose() * p.first / denominator;
  return t;
}

inline Jet closestAt(const SplineCurve& curve, const JetVec& x) { return closestAt(curve, x, curve.closest(x.v)); }

inline JetVec unit(const JetVec& a) { return Jet{1, Vec3::Zero()} / norm(a) * a; }

}  // namespace fielddeform::map::detail
