#pragma once

#include <fielddeform/skeleton/skeleton.h>

#include <cmath>
#include <numbers>

namespace fielddeform::test {

/// A closed mesh around the origin: rows of quads between two rings of triangles, 4 rows (rows - 1) triangles as fans.
/// @param radius  of the angle from the z axis and that around it
template <class Radius>
skeleton::Primitive meshSphere(int rows, Radius&& radius) {
  skeleton::Primitive p;
  p.name = "ball";
  p.type = skeleton::PrimitiveType::Mesh;
  p.closed = true;
  const int columns = 2 * rows;
  const double pi = std::numbers::pi;
  const auto put = [&](double a, double b) {
    p.points.push_back(radius(a, b) * Vec3(std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a)));
  };
  put(0, 0);
  for (int i = 1; i < rows; ++i)
    for (int j = 0; j < columns; ++j) put(pi * i / rows, 2 * pi * j / columns);
  put(pi, 0);
  const auto at = [&](int i, int j) { return static_cast<Index>(1 + (i - 1) * columns + j % columns); };
  const Index last = static_cast<Index>(p.points.size()) - 1;
  for (int j = 0; j < columns; ++j) {
    p.faces.push_back({0, at(1, j), at(1, j + 1)});
    p.faces.push_back({last, at(rows - 1, j + 1), at(rows - 1, j)});
    for (int i = 1; i + 1 < rows; ++i) p.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
  }
  return p;
}

}  // namespace fielddeform::test
