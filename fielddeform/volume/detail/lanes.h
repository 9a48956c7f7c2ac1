#pragma once

#include <cstddef>

namespace fielddeform::volume::detail {

inline constexpr std::size_t kLanes = 4;
inline std::size_t padded(std::size_t n) { return (n + kLanes - 1) / kLanes * kLanes; }

/// Three dot products of one row with x, y, z in four fixed lanes. @param n a multiple of 4
inline void dot3(const double* row, const double* x, const double* y, const double* z, std::size_t n, double* out) {
  double a[kLanes] = {}, b[kLanes] = {}, c[kLanes] = {};
  for (std::size_t i = 0; i < n; i += kLanes)
    for (std::size_t l = 0; l < kLanes; ++l) {
      const double r = row[i + l];
      a[l] += r * x[i + l];
      b[l] += r * y[i + l];
      c[l] += r * z[i + l];
    }
  out[0] = (a[0] + a[2]) + (a[1] + a[3]);
  out[1] = (b[0] + b[2]) + (b[1] + b[3]);
  out[2] = (c[0] + c[2]) + (c[1] + c[3]);
}

}  // namespace fielddeform::volume::detail
