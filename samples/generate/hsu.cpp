#include "hsu.h"

#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include "shapes.h"

namespace fielddeform::samples {
namespace {

void append(const mesh::Mesh& part, std::vector<Vec3>& points, std::vector<Index>& corners, std::vector<Index>& offsets) {
  const auto first = static_cast<Index>(points.size());
  points.insert(points.end(), part.positions().begin(), part.positions().end());
  for (std::size_t f = 0; f < part.faceCount(); ++f) {
    for (const Index v : part.face(f)) corners.push_back(first + v);
    offsets.push_back(static_cast<Index>(corners.size()));
  }
}

mesh::Mesh ellipsoid(const Vec3& centre, double radius, double half, int around) {
  std::vector<Eigen::Vector2d> profile;
  const int rings = around / 2;
  for (int i = 0; i < rings; ++i) {
    const double a = std::numbers::pi * (i + 0.5) / rings;
    profile.emplace_back(radius * std::sin(a), -half * std::cos(a));
  }
  mesh::Mesh m = revolve(profile, around);
  for (Vec3& p : m.mutablePositions()) p += centre;
  return m;
}

/// A rod along y with round ends.
mesh::Mesh rod(const Vec3& foot, double radius, double height) {
  constexpr int kRound = 6, kSide = 32;
  std::vector<Eigen::Vector2d> profile;
  for (int i = 0; i < kRound; ++i) {
    const double a = 0.5 * std::numbers::pi * (i + 0.5) / kRound;
    profile.emplace_back(radius * std::sin(a), radius * (1 - std::cos(a)));
  }
  for (int i = 1; i < kSide; ++i) profile.emplace_back(radius, radius + (height - 2 * radius) * i / kSide);
  for (int i = kRound; i-- > 0;) {
    const double a = 0.5 * std::numbers::pi * (i + 0.5) / kRound;
    profile.emplace_back(radius * std::sin(a), height - radius * (1 - std::cos(a)));
  }
  mesh::Mesh m = revolve(profile, 16);
  for (Vec3& p : m.mutablePositions()) p += foot;
  return m;
}

}  // namespace

mesh::Mesh block(int side) {
  const std::array<int, 3> n{side, std::max(2, 2 * side / 5), side};
  const Vec3 size(2, 0.8, 2);
  std::map<std::array<int, 3>, Index> number;
  std::vector<Vec3> points;
  std::vector<Index> corners, offsets{0};
  const auto vertex = [&](std::array<int, 3> at) {
    const auto [it, fresh] = number.emplace(at, static_cast<Index>(points.size()));
    if (fresh) {
      Vec3 p;
      for (int a = 0; a < 3; ++a) p[a] = size[a] * (static_cast<double>(at[a]) / n[a] - 0.5);
      points.push_back(p);
    }
    return it->second;
  };
  for (int axis = 0; axis < 3; ++axis)
    for (const int end : {0, 1}) {
      const int b = (axis + 1) % 3, c = (axis + 2) % 3;
      for (int i = 0; i < n[b]; ++i)
        for (int j = 0; j < n[c]; ++j) {
          std::array<std::array<int, 2>, 4> square{{{i, j}, {i + 1, j}, {i + 1, j + 1}, {i, j + 1}}};
          if (end == 0) std::swap(square[1], square[3]);
          for (const auto& [x, y] : square) {
            std::array<int, 3> at{};
            at[axis] = end * n[axis], at[b] = x, at[c] = y;
            corners.push_back(vertex(at));
          }
          offsets.push_back(static_cast<Index>(corners.size()));
        }
    }
  return mesh::Mesh(std::move(points), std::move(corners), std::move(offsets));
}

mesh::Mesh unitCube(int side) {
  mesh::Mesh m = block(side);
  for (Vec3& p : m.mutablePositions()) p = p.cwiseQuotient(Vec3(2, 0.8, 2)) + Vec3::Constant(0.5);
  return m;
}

mesh::Mesh ball(const Vec3& centre, double radius, int around) { return ellipsoid(centre, radius, radius, around); }

mesh::Mesh egg(int around) { return ellipsoid(Vec3::Zero(), 0.8, 1.2, around); }

mesh::Mesh prongRing() {
  std::vector<Eigen::Vector2d> circle;
  for (int i = 0; i < 24; ++i) {
    const double a = 2 * std::numbers::pi * i / 24;
    circle.emplace_back(1 + 0.12 * std::cos(a), 0.12 * std::sin(a));
  }
  mesh::Mesh band = revolve(circle, 96, {}, Ends::Joined);
  for (Vec3& p : band.mutablePositions()) p = Vec3(p.x(), -p.z(), p.y());  // about z
  std::vector<Vec3> points;
  std::vector<Index> corners, offsets{0};
  append(band, points, corners, offsets);
  // The collet that carries the prongs.
  std::vector<Eigen::Vector2d> collet;
  for (int i = 0; i < 16; ++i) {
    const double a = 2 * std::numbers::pi * i / 16;
    collet.emplace_back(0.4 + 0.05 * std::cos(a), 1.06 + 0.05 * std::sin(a));
  }
  append(revolve(collet, 64, {}, Ends::Joined), points, corners, offsets);
  for (int k = 0; k < 6; ++k) {
    const double a = std::numbers::pi * (k + 0.5) / 3;
    append(rod(Vec3(0.4 * std::cos(a), 1.02, 0.4 * std::sin(a)), 0.055, 0.78), points, corners, offsets);
  }
  return mesh::Mesh(std::move(points), std::move(corners), std::move(offsets));
}

mesh::Mesh stone() { return revolve({{0.03, 1.15}, {0.3, 1.46}, {0.31, 1.5}, {0.3, 1.53}, {0.19, 1.64}}, 24); }

}  // namespace fielddeform::samples
