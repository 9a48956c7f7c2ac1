#pragma once

#include <fielddeform/map/skeleton_motion.h>
#include <fielddeform/map/spline_curve.h>

#include <string_view>

namespace fielddeform::map::detail {

/// A line of a skeleton as curves of one parameter.
struct LineCurves {
  SplineCurve rest, posed;
  SplineCurve numbers;               ///< (roll from rest to posed in radians, scale, rest radius)
  std::vector<Index> points;         ///< of the primitive, that the curves go through: those that coincide count once
};

/// @throw std::invalid_argument naming method and primitive if it is no line, or has no length
LineCurves lineCurves(const SkeletonMotion& motion, Index primitive, std::string_view method);

}  // namespace fielddeform::map::detail
