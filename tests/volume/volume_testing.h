#pragma once

#include <fielddeform/core/random.h>
#include <fielddeform/core/types.h>

#include <vector>

/// What the tests of this folder share.
namespace fielddeform::test {

/// Vectors in [-1, 1]^3.
inline std::vector<Vec3> noise(std::uint64_t seed, std::size_t n) {
  std::vector<Vec3> p(n);
  for (std::size_t i = 0; i < n; ++i)
    for (int c = 0; c < 3; ++c) p[i][c] = 2 * uniform01(seed, 3 * i + static_cast<std::size_t>(c)) - 1;
  return p;
}
/// a + t b
inline std::vector<Vec3> added(Points a, Points b, double t = 1) {
  std::vector<Vec3> out(a.begin(), a.end());
  for (std::size_t i = 0; i < out.size(); ++i) out[i] += t * b[i];
  return out;
}
inline double dot(Points a, Points b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i].dot(b[i]);
  return sum;
}

}  // namespace fielddeform::test
