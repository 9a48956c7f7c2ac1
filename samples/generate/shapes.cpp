#include "shapes.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

namespace fielddeform::samples {

mesh::Mesh revolve(const std::vector<Eigen::Vector2d>& profile, int around,
                   const std::function<double(double, double)>& ripple, Ends ends) {
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
  const bool joined = ends == Ends::Joined;
  for (Index j = 0; j < n; ++j) {
    const Index next = (j + 1) % n;
    for (Index i = 0; i + (joined ? 0 : 1) < rings; ++i) {
      const Index above = (i + 1) % rings;
      face({i * n + j, i * n + next, above * n + next, above * n + j});
    }
  }
  if (!joined) {
    const Index bottom = static_cast<Index>(points.size()), top = bottom + 1;
    points.emplace_back(0, profile.front().y(), 0);
    points.emplace_back(0, profile.back().y(), 0);
    for (Index j = 0; j < n; ++j) {
      const Index next = (j + 1) % n;
      face({bottom, next, j});
      face({top, (rings - 1) * n + j, (rings - 1) * n + next});
    }
  }
  return {std::move(points), std::move(corners), std::move(offsets)};
}

mesh::Mesh baluster() {
  // Heights and radii of the turning, joined smoothly.
  constexpr double kTurning[][2] = {
      {-2.00, 0.44}, {-1.92, 0.50}, {-1.70, 0.50}, {-1.62, 0.40}, {-1.54, 0.30}, {-1.46, 0.36}, {-1.36, 0.36},
      {-1.26, 0.26}, {-0.80, 0.44}, {-0.30, 0.40}, {0.40, 0.25},  {0.90, 0.18},  {1.04, 0.20},  {1.12, 0.29},
      {1.22, 0.29},  {1.30, 0.20},  {1.44, 0.26},  {1.58, 0.40},  {1.70, 0.50},  {1.92, 0.50},  {2.00, 0.44}};
  constexpr int kCount = std::size(kTurning), kSteps = 9;
  std::vector<Eigen::Vector2d> profile;
  for (int i = 1; i < 6; ++i) profile.emplace_back(kTurning[0][1] * i / 6, kTurning[0][0]);
  for (int i = 0; i + 1 < kCount; ++i) {
    const auto *a = kTurning[std::max(0, i - 1)], *b = kTurning[i], *c = kTurning[i + 1],
               *d = kTurning[std::min(kCount - 1, i + 2)];
    // Cubic Hermite in height; slopes limited so that the turning never swings beyond its points.
    const auto slope = [](const double* from, const double* at, const double* to) {
      const double left = at[0] > from[0] ? (at[1] - from[1]) / (at[0] - from[0]) : 0,
                   right = to[0] > at[0] ? (to[1] - at[1]) / (to[0] - at[0]) : 0;
      return left * right > 0 ? 2 * left * right / (left + right) : 0;
    };
    const double h = c[0] - b[0], m0 = slope(a, b, c), m1 = slope(b, c, d);
    for (int s = 0; s < kSteps; ++s) {
      const double t = static_cast<double>(s) / kSteps, u = 1 - t;
      profile.emplace_back(b[1] * u * u * (1 + 2 * t) + c[1] * t * t * (3 - 2 * t) + h * t * u * (u * m0 - t * m1),
                           b[0] + t * h);
    }
  }
  for (int i = 6; i > 0; --i) profile.emplace_back(kTurning[kCount - 1][1] * i / 6, kTurning[kCount - 1][0]);
  return revolve(profile, 96, [](double angle, double y) {
    const double fluted = std::clamp(std::min((y + 1.2) / 0.3, (0.95 - y) / 0.4), 0.0, 1.0);
    return 1 - 0.06 * fluted * fluted * (3 - 2 * fluted) * (1 - std::abs(std::cos(8 * angle)));
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
