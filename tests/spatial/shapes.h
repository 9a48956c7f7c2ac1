#pragma once

#include <fielddeform/core/random.h>
#include <fielddeform/core/types.h>

#include <array>
#include <cmath>
#include <vector>

namespace fielddeform::spatial {

inline Vec3 randomPoint(std::uint64_t seed, std::uint64_t i, double size = 1) {
  return size * Vec3(2 * uniform01(seed, 3 * i) - 1, 2 * uniform01(seed, 3 * i + 1) - 1, 2 * uniform01(seed, 3 * i + 2) - 1);
}

struct Soup {
  std::vector<Vec3> points;
  std::vector<std::array<Index, 3>> triangles;
};

/// A sphere of rows by 2*rows quads, two triangles each, outward; the caps are triangles.
inline Soup sphere(int rows, double radius = 1, const Vec3& centre = Vec3::Zero()) {
  Soup s;
  const int cols = 2 * rows;
  const double pi = 3.14159265358979323846;
  for (int i = 0; i <= rows; ++i)
    for (int j = 0; j < cols; ++j) {
      const double a = pi * i / rows, b = 2 * pi * j / cols;
      // The poles are exact, so that the caps' degenerate triangles close the surface.
      const double r = i == 0 || i == rows ? 0 : std::sin(a);
      s.points.push_back(centre + radius * Vec3(r * std::cos(b), r * std::sin(b), std::cos(a)));
    }
  const auto at = [&](int i, int j) { return static_cast<Index>(i * cols + j % cols); };
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < cols; ++j) {
      s.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      s.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return s;
}

}  // namespace fielddeform::spatial
