#pragma once

#include <fielddeform/mesh/mesh.h>

#include <cmath>
#include <numbers>

/// Small meshes for the tests of this folder and of those that deform meshes.
namespace fielddeform::test {

using mesh::Mesh;

/// Unit cube [0,1]^3 of 12 triangles or 6 quads, outward.
inline std::vector<Vec3> cubeCorners() {
  std::vector<Vec3> p;
  for (int i = 0; i < 8; ++i) p.emplace_back(i & 1, i >> 1 & 1, i >> 2 & 1);
  return p;
}
inline Mesh quadCube() {
  return Mesh(cubeCorners(), {0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5},
              {0, 4, 8, 12, 16, 20, 24});
}
inline Mesh cube() { return Mesh(cubeCorners(), quadCube().triangles()); }

/// Flat grid of n by n squares over [0,1]^2, two triangles each or one quad each, facing +z.
inline Mesh grid(int n, int cornersPerFace = 3) {
  std::vector<Vec3> p;
  std::vector<Index> c, offsets{0};
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i) p.emplace_back(double(i) / n, double(j) / n, 0);
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const auto a = static_cast<Index>(j * (n + 1) + i), b = a + 1, d = static_cast<Index>(a + n + 1), e = d + 1;
      if (cornersPerFace == 4) c.insert(c.end(), {a, b, e, d});
      else c.insert(c.end(), {a, b, e, a, e, d});
      for (; offsets.back() < c.size();) offsets.push_back(offsets.back() + static_cast<Index>(cornersPerFace));
    }
  return Mesh(std::move(p), std::move(c), std::move(offsets));
}

/// Closed sphere of radius 1 around 0 by longitudes and latitudes; quads with triangles at the poles.
inline Mesh sphere(int around, int down) {
  std::vector<Vec3> p{{0, 0, 1}};
  for (int j = 1; j < down; ++j)
    for (int i = 0; i < around; ++i) {
      const double t = std::numbers::pi * j / down, a = 2 * std::numbers::pi * i / around;
      p.emplace_back(std::sin(t) * std::cos(a), std::sin(t) * std::sin(a), std::cos(t));
    }
  p.emplace_back(0, 0, -1);
  const auto at = [&](int j, int i) { return static_cast<Index>(1 + (j - 1) * around + (i + around) % around); };
  const auto last = static_cast<Index>(p.size() - 1);
  std::vector<Index> c, offsets{0};
  const auto face = [&](std::initializer_list<Index> f) {
    c.insert(c.end(), f);
    offsets.push_back(static_cast<Index>(c.size()));
  };
  for (int i = 0; i < around; ++i) {
    face({0, at(1, i), at(1, i + 1)});
    for (int j = 1; j + 1 < down; ++j) face({at(j, i), at(j + 1, i), at(j + 1, i + 1), at(j, i + 1)});
    face({last, at(down - 1, i + 1), at(down - 1, i)});
  }
  return Mesh(std::move(p), std::move(c), std::move(offsets));
}

/// Closed bar [-w/2, w/2]^2 x [0, length] of the given number of segments along z: 4 quads a segment and 2 caps.
inline Mesh bar(int segments, double length, double width, int cornersPerFace = 3) {
  std::vector<Vec3> p;
  const double w = width / 2;
  for (int j = 0; j <= segments; ++j)
    for (int k = 0; k < 4; ++k)
      p.emplace_back(k == 1 || k == 2 ? w : -w, k >= 2 ? w : -w, length * j / segments);
  std::vector<Index> c{0, 3, 2, 1}, offsets{0};
  for (int j = 0; j < segments; ++j)
    for (int k = 0; k < 4; ++k) {
      const auto a = static_cast<Index>(4 * j + k), b = static_cast<Index>(4 * j + (k + 1) % 4);
      c.insert(c.end(), {a, b, b + 4, a + 4});
    }
  const auto top = static_cast<Index>(4 * segments);
  c.insert(c.end(), {top, top + 1, top + 2, top + 3});
  while (offsets.back() < c.size()) offsets.push_back(offsets.back() + 4);
  const Mesh quads(p, c, offsets);
  return cornersPerFace == 4 ? quads : Mesh(p, quads.triangles());
}

/// Pages that share one edge (0, 1): non-manifold from three pages on.
inline Mesh book(int pages) {
  std::vector<Vec3> p{{0, 0, 0}, {0, 0, 1}};
  std::vector<Index> c;
  for (int i = 0; i < pages; ++i) {
    const double a = 2 * std::numbers::pi * i / pages;
    p.emplace_back(std::cos(a), std::sin(a), 0.5);
    c.insert(c.end(), {0, 1, static_cast<Index>(2 + i)});
  }
  return Mesh(std::move(p), std::move(c));
}

/// The same positions, moved.
template <class F>
std::vector<Vec3> moved(const Mesh& m, F&& f) {
  std::vector<Vec3> out;
  for (const Vec3& p : m.positions()) out.push_back(f(p));
  return out;
}

/// Two meshes side by side in one; connectivity and positions only.
inline Mesh together(const Mesh& a, const Mesh& b) {
  std::vector<Vec3> p = a.positions();
  p.insert(p.end(), b.positions().begin(), b.positions().end());
  std::vector<Index> c, offsets{0};
  for (const Mesh* m : {&a, &b})
    for (std::size_t f = 0; f < m->faceCount(); ++f) {
      for (const Index v : m->face(f)) c.push_back(v + (m == &b ? static_cast<Index>(a.vertexCount()) : 0));
      offsets.push_back(static_cast<Index>(c.size()));
    }
  return Mesh(std::move(p), std::move(c), std::move(offsets));
}

}  // namespace fielddeform::test
