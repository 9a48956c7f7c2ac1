#pragma once

#include <fielddeform/core/types.h>

#include <array>
#include <cstddef>

/// The tricubic Bernstein functions of extended lattices.
namespace fielddeform::map::detail {

using Row4 = std::array<double, 4>;
inline Row4 cubic(double t) {
  const double s = 1 - t;
  return {s * s * s, 3 * s * s * t, 3 * s * t * t, t * t * t};
}
inline Row4 cubicSlopes(double t) {
  const double s = 1 - t;
  return {-3 * s * s, 3 * s * s - 6 * s * t, 6 * s * t - 3 * t * t, 3 * t * t};
}

/// Of the nodes (i, j, k) of a cell at i + 4 (j + 4 k).
using Weights = std::array<double, 64>;
inline Weights weightsAt(const Vec3& u) {
  const Row4 a = cubic(u[0]), b = cubic(u[1]), c = cubic(u[2]);
  Weights w;
  for (std::size_t n = 0; n < 64; ++n) w[n] = a[n % 4] * b[n / 4 % 4] * c[n / 16];
  return w;
}

/// Derivative by the local coordinates of what the nodes' values give, column = coordinate.
template <class Value>
Mat3 localJacobian(const Vec3& u, Value&& value) {
  std::array<Row4, 3> b{cubic(u[0]), cubic(u[1]), cubic(u[2])}, d{cubicSlopes(u[0]), cubicSlopes(u[1]), cubicSlopes(u[2])};
  Mat3 j = Mat3::Zero();
  for (std::size_t n = 0; n < 64; ++n) {
    const std::size_t i = n % 4, k = n / 4 % 4, l = n / 16;
    const Vec3 p = value(n);
    j.col(0) += d[0][i] * b[1][k] * b[2][l] * p;
    j.col(1) += b[0][i] * d[1][k] * b[2][l] * p;
    j.col(2) += b[0][i] * b[1][k] * d[2][l] * p;
  }
  return j;
}

}  // namespace fielddeform::map::detail
