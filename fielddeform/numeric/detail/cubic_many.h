#pragma once

#include <fielddeform/core/types.h>

#include <functional>

namespace fielddeform::numeric::detail {

/// By how much sums of w |p - c|^3 at many points may differ from the plain sums, besides rounding: no more, whatever the points.
struct CubicTolerance {
  double value;
  double gradient;
};

struct CubicCentres {
  Points centres;
  Points weights;          // of three components
  std::size_t components;  // 1: the first alone, and its gradient; 3: all, no gradient
};

/// Whether cubicMany takes a point: finite and not absurdly far.
inline bool takesCubicMany(const Vec3& p) { return (p.array().abs() <= 1e6).all(); }

/// Calls take(i, sums) once for every point that takesCubicMany, from many threads: sums of the first component, then its
/// gradient; or of the three components. Same bits on every CPU and thread count, for the same points.
/// Points that lie together share what centres far from them do: one polynomial (cubic_taylor.h), built up from large groups to
/// small ones. Cost a point: nearly independent of the centres where points are many. Memory: about 50 bytes a point.
/// @param points  fewer than 2^32
void cubicMany(const CubicCentres& centres, Points points, const CubicTolerance& tolerance,
               const std::function<void(std::size_t, const double*)>& take);

}  // namespace fielddeform::numeric::detail
