#pragma once

#include <fielddeform/core/random.h>
#include <fielddeform/skeleton/skeleton.h>

#include <cmath>
#include <string>

namespace fielddeform::field {

inline Vec3 randomPoint(std::uint64_t seed, std::uint64_t i, double size = 1) {
  return size * Vec3(2 * uniform01(seed, 3 * i) - 1, 2 * uniform01(seed, 3 * i + 1) - 1, 2 * uniform01(seed, 3 * i + 2) - 1);
}

inline skeleton::Primitive polyline(const std::string& name, std::vector<Vec3> points, double radius) {
  skeleton::Primitive p;
  p.name = name;
  p.type = skeleton::PrimitiveType::Polyline;
  p.points = std::move(points);
  p.radius = radius;
  return p;
}

inline skeleton::Primitive pointSet(const std::string& name, std::vector<Vec3> points, double radius) {
  skeleton::Primitive p = polyline(name, std::move(points), radius);
  p.type = skeleton::PrimitiveType::Points;
  return p;
}

/// An axis-aligned cube of half side h, quads with outward normals.
inline skeleton::Primitive cube(const std::string& name, double h, double radius, const Vec3& centre = Vec3::Zero()) {
  skeleton::Primitive p;
  p.name = name;
  p.type = skeleton::PrimitiveType::Mesh;
  p.closed = true;
  for (int i = 0; i < 8; ++i) p.points.push_back(centre + h * Vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1));
  p.faces = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  p.radius = radius;
  return p;
}

/// An open, slightly curved patch of n by n quads over [-1, 1]^2.
inline skeleton::Primitive patch(const std::string& name, int n, double radius) {
  skeleton::Primitive p;
  p.name = name;
  p.type = skeleton::PrimitiveType::Mesh;
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i) {
      const double x = 2.0 * i / n - 1, y = 2.0 * j / n - 1;
      p.points.push_back(Vec3(x, y, 0.2 * x * x - 0.1 * y));
    }
  const auto at = [n](int i, int j) { return static_cast<Index>(j * (n + 1) + i); };
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) p.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
  p.radius = radius;
  return p;
}

inline std::vector<Vec3> wavyLine(int n) {
  std::vector<Vec3> points;
  for (int i = 0; i <= n; ++i) {
    const double t = 2.0 * i / n - 1;
    points.push_back(Vec3(t, 0.3 * t * t, 0.2 * t * t * t));
  }
  return points;
}

inline void giveRadii(skeleton::Primitive& p, double least, double greatest) {
  p.pointRadius.resize(p.points.size());
  for (std::size_t i = 0; i < p.points.size(); ++i) p.pointRadius[i] = least + (greatest - least) * uniform01(77, i);
}

}  // namespace fielddeform::field
