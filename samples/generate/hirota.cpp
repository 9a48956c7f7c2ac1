#include "hirota.h"

#include <array>
#include <cmath>
#include <numbers>

#include "isosurface.h"
#include "sculpt.h"
#include "shapes.h"

namespace fielddeform::samples {
namespace {

using std::numbers::pi;

/// A vertex grid whose columns close to rings; the ends are closed with a vertex each, or joined to each other.
mesh::Mesh rings(const std::vector<std::vector<Vec3>>& rows, Ends ends) {
  std::vector<Vec3> points;
  std::vector<Index> corners, offsets{0};
  const auto face = [&](std::initializer_list<Index> c) {
    corners.insert(corners.end(), c);
    offsets.push_back(static_cast<Index>(corners.size()));
  };
  for (const auto& row : rows) points.insert(points.end(), row.begin(), row.end());
  const auto count = static_cast<Index>(rows.size()), n = static_cast<Index>(rows[0].size());
  const bool joined = ends == Ends::Joined;
  for (Index i = 0; i + (joined ? 0 : 1) < count; ++i)
    for (Index j = 0; j < n; ++j) {
      const Index next = (j + 1) % n, above = (i + 1) % count;
      face({i * n + j, i * n + next, above * n + next, above * n + j});
    }
  if (!joined) {
    const auto middle = [](const std::vector<Vec3>& row) {
      Vec3 sum = Vec3::Zero();
      for (const Vec3& p : row) sum += p;
      return Vec3(sum / static_cast<double>(row.size()));
    };
    const auto first = static_cast<Index>(points.size()), last = first + 1;
    points.push_back(middle(rows.front()));
    points.push_back(middle(rows.back()));
    for (Index j = 0; j < n; ++j) {
      const Index next = (j + 1) % n;
      face({first, next, j});
      face({last, (count - 1) * n + j, (count - 1) * n + next});
    }
  }
  return {std::move(points), std::move(corners), std::move(offsets)};
}

using Profile = std::array<Eigen::Vector2d, 4>;  // control points: radius, height

Eigen::Vector2d bezier(const Profile& p, double t) {
  const double s = 1 - t;
  return s * s * s * p[0] + 3 * s * s * t * p[1] + 3 * s * t * t * p[2] + t * t * t * p[3];
}

/// The pot's wall: up the outside, over the rim, down the inside. Each curve, swept round, is a row of patches.
std::vector<Profile> wall() {
  using V = Eigen::Vector2d;
  return {{V(0.02, 0), V(0.4, 0), V(0.75, 0), V(0.85, 0.08)},
          {V(0.85, 0.08), V(1.25, 0.35), V(1.3, 0.95), V(1.05, 1.5)},
          {V(1.05, 1.5), V(0.85, 1.95), V(0.62, 2.15), V(0.72, 2.85)},
          {V(0.72, 2.85), V(0.73, 2.97), V(0.66, 2.97), V(0.64, 2.85)},
          {V(0.64, 2.85), V(0.53, 2.15), V(0.74, 1.9), V(0.93, 1.45)},
          {V(0.93, 1.45), V(1.15, 0.95), V(1.1, 0.45), V(0.78, 0.22)},
          {V(0.78, 0.22), V(0.65, 0.14), V(0.4, 0.14), V(0.02, 0.14)}};
}

/// The rim is drawn out to a lip towards +x.
double lip(double angle, double height) {
  const double along = std::max(0.0, std::cos(angle)), up = smoothstep(2.0, 2.95, height);
  return 1 + 0.55 * up * along * along * along * along;
}

std::vector<std::vector<Vec3>> pot(int level) {
  std::vector<std::vector<Vec3>> rows;
  const std::vector<Profile> curves = wall();
  const int around = 8 * level;
  for (std::size_t c = 0; c < curves.size(); ++c)
    for (int k = c == 0 ? 0 : 1; k <= level; ++k) {
      const Eigen::Vector2d p = bezier(curves[c], static_cast<double>(k) / level);
      std::vector<Vec3> row;
      for (int j = 0; j < around; ++j) {
        const double angle = -2 * pi * j / around;  // counter-clockwise seen from below: outward faces
        const double r = p.x() * lip(angle, p.y());
        row.emplace_back(r * std::cos(angle), p.y(), r * std::sin(angle));
      }
      rows.push_back(std::move(row));
    }
  return rows;
}

/// A tube along two Bezier curves behind the pot; both ends stand in its wall.
std::vector<std::vector<Vec3>> handle(int level) {
  const std::array<std::array<Vec3, 4>, 2> spine{{{Vec3(-0.69, 2.62, 0), Vec3(-1.3, 2.95, 0), Vec3(-1.95, 2.6, 0), Vec3(-1.85, 1.95, 0)},
                                                  {Vec3(-1.85, 1.95, 0), Vec3(-1.75, 1.3, 0), Vec3(-1.45, 0.95, 0), Vec3(-1.12, 0.9, 0)}}};
  std::vector<std::vector<Vec3>> rows;
  for (std::size_t c = 0; c < 2; ++c)
    for (int k = c == 0 ? 0 : 1; k <= 2 * level; ++k) {
      const double t = static_cast<double>(k) / (2 * level), s = 1 - t;
      const auto& p = spine[c];
      const Vec3 at = s * s * s * p[0] + 3 * s * s * t * p[1] + 3 * s * t * t * p[2] + t * t * t * p[3];
      const Vec3 along = (s * s * (p[1] - p[0]) + 2 * s * t * (p[2] - p[1]) + t * t * (p[3] - p[2])).normalized();
      const Vec3 across(-along.y(), along.x(), 0);
      std::vector<Vec3> row;
      const int around = 4 * level;
      for (int j = 0; j < around; ++j) {
        const double a = 2 * pi * j / around;
        row.push_back(at + 0.09 * std::cos(a) * across + 0.17 * std::sin(a) * Vec3::UnitZ());
      }
      rows.push_back(std::move(row));
    }
  return rows;
}

mesh::Mesh joinMeshes(const mesh::Mesh& a, const mesh::Mesh& b) {
  std::vector<Vec3> points = a.positions();
  points.insert(points.end(), b.positions().begin(), b.positions().end());
  std::vector<Index> corners = a.corners(), offsets = a.offsets();
  for (const Index c : b.corners()) corners.push_back(c + static_cast<Index>(a.vertexCount()));
  for (std::size_t f = 1; f < b.offsets().size(); ++f) offsets.push_back(b.offsets()[f] + static_cast<Index>(a.cornerCount()));
  return {std::move(points), std::move(corners), std::move(offsets)};
}

double animal(const Vec3& p) {
  const Vec3 q(p.x(), p.y(), std::abs(p.z()));
  double d = limb(p, {-0.75, 1.12, 0}, {0.55, 1.10, 0}, 0.36, 0.37);                    // trunk
  d = join(d, limb(p, {0.60, 1.20, 0}, {0.98, 1.48, 0}, 0.27, 0.18), 0.18);             // neck
  d = join(d, limb(p, {1.00, 1.54, 0}, {1.36, 1.36, 0}, 0.18, 0.12), 0.08);             // head
  d = join(d, limb(q, {1.00, 1.66, 0.12}, {0.96, 1.74, 0.27}, 0.05, 0.045), 0.03);      // ears
  for (const double x : {-0.78, 0.55}) {                                                // legs
    d = join(d, limb(q, {x, 0.95, 0.19}, {x + 0.02, 0.50, 0.20}, 0.19, 0.12), 0.14);
    d = join(d, limb(q, {x + 0.02, 0.50, 0.20}, {x, 0.09, 0.20}, 0.115, 0.105), 0.06);
  }
  return join(d, limb(p, {-1.08, 1.30, 0}, {-1.22, 0.75, 0}, 0.075, 0.06), 0.06);       // tail
}

}  // namespace

mesh::Mesh torus(int level) {
  std::vector<std::vector<Vec3>> rows;
  for (int i = 0; i < 4 * level; ++i) {
    const double a = 2 * pi * i / (4 * level);
    std::vector<Vec3> row;
    for (int j = 0; j < 2 * level; ++j) {
      const double b = -2 * pi * j / (2 * level), r = 1 + 0.4 * std::cos(b);
      row.emplace_back(r * std::sin(a), 0.4 * std::sin(b), r * std::cos(a));
    }
    rows.push_back(std::move(row));
  }
  return rings(rows, Ends::Joined);
}

mesh::Mesh club(int around) {
  using V = Eigen::Vector2d;
  const std::array<Profile, 5> curves{{{V(0.03, -2), V(0.14, -2), V(0.2, -1.97), V(0.2, -1.85)},
                                       {V(0.2, -1.85), V(0.2, -1.7), V(0.11, -1.7), V(0.11, -1.5)},
                                       {V(0.11, -1.5), V(0.11, -0.9), V(0.2, -0.5), V(0.36, 0.2)},
                                       {V(0.36, 0.2), V(0.52, 0.9), V(0.55, 1.4), V(0.42, 1.75)},
                                       {V(0.42, 1.75), V(0.34, 1.95), V(0.2, 2), V(0.03, 2)}}};
  std::vector<Eigen::Vector2d> profile;
  for (std::size_t c = 0; c < curves.size(); ++c) {
    const double length = (curves[c][3] - curves[c][0]).norm();
    const int steps = std::max(2, static_cast<int>(std::lround(around * length / 2.4)));
    for (int k = c == 0 ? 0 : 1; k <= steps; ++k) profile.push_back(bezier(curves[c], static_cast<double>(k) / steps));
  }
  return revolve(profile, around);
}

mesh::Mesh quadruped(double fineness) {
  return isosurface(Box(Vec3(-1.5, -0.2, -0.6), Vec3(1.7, 2.0, 0.6)), 0.062 / fineness, animal);
}

mesh::Mesh pitcher(int level) { return joinMeshes(rings(pot(level), Ends::Axis), rings(handle(level), Ends::Axis)); }

}  // namespace fielddeform::samples
