#pragma once

#include <fielddeform/core/types.h>

#include <cmath>
#include <optional>

namespace fielddeform::test {

/// The gradient of f at x by central differences, h apart; nothing where f has a kink nearby: where one-sided differences
/// differ by 1e-3, a curvature of 1e-3 / h.
template <class F>
std::optional<Vec3> centralDifference(const F& f, const Vec3& x, double h = 1e-6) {
  const double here = f(x);
  Vec3 gradient;
  for (int k = 0; k < 3; ++k) {
    const double up = f(x + h * Vec3::Unit(k)), down = f(x - h * Vec3::Unit(k));
    if (!(std::abs(up - 2 * here + down) < 1e-3 * h)) return std::nullopt;
    gradient[k] = (up - down) / (2 * h);
  }
  return gradient;
}

}  // namespace fielddeform::test
