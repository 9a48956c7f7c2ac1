#pragma once

#include <fielddeform/core/types.h>

namespace fielddeform::numeric::detail {

/// Centres in blocks of eight: eight x, y, z, and eight weights of each of three components. Unused places hold zeros.
inline constexpr std::size_t kCubicLanes = 8;
inline constexpr std::size_t kCubicBlock = 6 * kCubicLanes;

/// sum_j w_j |p - c_j|^3 of the three components.
Vec3 cubicSums(const double* blocks, std::size_t count, const Vec3& p);

/// The same of the first component, and its gradient 3 sum_j w_j |p - c_j| (p - c_j).
double cubicSum(const double* blocks, std::size_t count, const Vec3& p, Vec3& gradient);

}  // namespace fielddeform::numeric::detail
