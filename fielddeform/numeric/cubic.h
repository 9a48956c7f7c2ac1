#pragma once

#include <array>
#include <optional>
#include <vector>

namespace fielddeform::numeric {

/// Real roots of c0 + c1 t + c2 t^2 + c3 t^3, ascending, each polished by Newton's method; a double root may be missed or
/// found twice by rounding. Degrees below three are fine; the zero polynomial has no roots here.
std::vector<double> cubicRoots(const std::array<double, 4>& c);

/// The real root of the least absolute value; none if there is none (a quadratic, or a constant).
std::optional<double> smallestCubicRoot(const std::array<double, 4>& c);

}  // namespace fielddeform::numeric
