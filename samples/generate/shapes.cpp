#include "shapes.h"

#include <cmath>
#include <numbers>

namespace fielddeform::samples {

mesh::Mesh revolve(const std::vector<Eigen::Vector2d>& profile, int around,
                   const std::function<double(double, double)>& ripple) {
  std::vector<Vec3> points;
  std::vector<Index> corners, offsets{0};
  const auto face = [&](std::initializer_list<Index> c) {
    corners.insert(corners.end(), c);
    offsets.push_back(static_cast<Index>(corners.size()));
  };
  for (const auto& ring : profile) {
    for (int j = 0; j < around; ++j) {
      const double angle = 2 * std::numbers::pi * j / around;
      const double r = ring.x() * (ripple ? ripple(angle, ring.y()) : 1);
      points.emplace_back(r * std::sin(angle), ring.y(), r * std::cos(angle));
    }
  }
  const Index n = static_cast<Index>(around), rings = static_cast<Index>(profile.size());
  const Index bottom = static_cast<Index>(points.size()), top = bottom + 1;
  points.emplace_back(0, profile.front().y(), 0);
  points.emplace_back(0, profile.back().y(), 0);
  for (Index j = 0; j < n; ++j) {
    const Index next = (j + 1) % n;
    face({bottom, next, j});
    for (Index i = 0; i + 1 < rings; ++i) face({i * n + j, i * n + next, (i + 1) * n + next, (i + 1) * n + j});
    face({top, (rings - 1) * n + j, (rings - 1) * n + next});
  }
  return {std::move(points), std::move(corners), std::move(offsets)};
}

mesh::Mesh bar(double length, double width, int segments) {
  // The section is a superellipse; the ends are rounded like it.
  const double half = length / 2, round = width / 4;
  std::vector<Eigen::Vector2d> profile;
  constexpr int kRound = 6;
  for (int i = 0; i <= kRound; ++i) {
    const double a = std::numbers::pi / 2 * i / kRound;
    profile.emplace_back(width / 2 - round + round * std::sin(a), -half + round - round * std::cos(a));
  }
  for (int i = 1; i < segments; ++i)
    profile.emplace_back(width / 2, -half + round + (length - 2 * round) * i / segments);
  for (int i = 0; i <= kRound; ++i) {
    const double a = std::numbers::pi / 2 * i / kRound;
    profile.emplace_back(width / 2 - round + round * std::cos(a), half - round + round * std::sin(a));
  }
  return revolve(profile, 48, [](double angle, double) {
    const double c = std::abs(std::cos(angle)), s = std::abs(std::sin(angle));
    return std::pow(std::pow(c, 6.0) + std::pow(s, 6.0), -1.0 / 6);
  });
}

skeleton::Primitive polyline(std::string name, std::vector<Vec3> points, double radius) {
  skeleton::Primitive p;
  p.name = std::move(name);
  p.type = skeleton::PrimitiveType::Polyline;
  p.points = std::move(points);
  p.radius = radius;
  return p;
}

skeleton::Primitive solid(std::string name, const mesh::Mesh& mesh, double radius) {
  skeleton::Primitive p;
  p.name = std::move(name);
  p.type = skeleton::PrimitiveType::Mesh;
  p.closed = true;
  p.points = mesh.positions();
  for (std::size_t f = 0; f < mesh.faceCount(); ++f) p.faces.emplace_back(mesh.face(f).begin(), mesh.face(f).end());
  p.radius = radius;
  return p;
}

}  // namespace fielddeform::samples
