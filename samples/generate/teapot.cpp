#include <array>
#include <cmath>

#include "shapes.h"

// The control points are Martin Newell's (1975), in the public domain ever since. Body and lid are patches of a ring of
// revolution (its control points lie on squares with rounded corners), so their profile curves tell all; handle and
// spout are two patches each, and their mirror images.
namespace fielddeform::samples {
namespace {

using Profile = std::array<Eigen::Vector2d, 4>;  // radius, height
using Patch = std::array<std::array<Vec3, 4>, 4>;
using Row = std::array<Vec3, 4>;
constexpr double kRing = 0.56;  // how far a ring's control points stand off its corners

std::array<double, 4> bernstein(double t) {
  const double s = 1 - t;
  return {s * s * s, 3 * s * s * t, 3 * s * t * t, t * t * t};
}

template <class Point>
Point curve(const std::array<Point, 4>& p, double t) {
  const auto b = bernstein(t);
  return b[0] * p[0] + b[1] * p[1] + b[2] * p[2] + b[3] * p[3];
}

/// Grids of vertices joined to quads, as one piece of a mesh.
class Builder {
 public:
  /// Rows of equally many vertices; the last column joins the first. A row of one point becomes one vertex.
  void tube(const std::vector<std::vector<Vec3>>& rows) {
    std::vector<std::vector<Index>> index;
    for (const auto& row : rows) {
      std::vector<Index> at;
      for (const Vec3& p : row) {
        at.push_back(static_cast<Index>(points_.size()));
        points_.push_back(p);
      }
      index.push_back(std::move(at));
    }
    for (std::size_t i = 0; i + 1 < index.size(); ++i) {
      const auto &a = index[i], &b = index[i + 1];
      const std::size_t n = std::max(a.size(), b.size());
      for (std::size_t j = 0; j < n; ++j) {
        const std::size_t k = (j + 1) % n;
        if (a.size() == 1)
          face({a[0], b[k], b[j]});
        else if (b.size() == 1)
          face({a[j], a[k], b[0]});
        else
          face({a[j], a[k], b[k], b[j]});
      }
    }
  }
  mesh::Mesh take() { return {std::move(points_), std::move(corners_), std::move(offsets_)}; }

 private:
  void face(std::initializer_list<Index> c) {
    corners_.insert(corners_.end(), c);
    offsets_.push_back(static_cast<Index>(corners_.size()));
  }
  std::vector<Vec3> points_;
  std::vector<Index> corners_, offsets_{0};
};

/// The ring of radius r at a height: four quarter curves.
std::vector<Vec3> ring(double r, double height, int level) {
  if (r < 1e-12) return {Vec3(0, height, 0)};
  std::vector<Vec3> out;
  for (int quarter = 0; quarter < 4; ++quarter) {
    const Vec3 from = quarter == 0   ? Vec3(0, 0, 1)
                      : quarter == 1 ? Vec3(1, 0, 0)
                      : quarter == 2 ? Vec3(0, 0, -1)
                                     : Vec3(-1, 0, 0);
    const Vec3 to = quarter == 0   ? Vec3(1, 0, 0)
                    : quarter == 1 ? Vec3(0, 0, -1)
                    : quarter == 2 ? Vec3(-1, 0, 0)
                                   : Vec3(0, 0, 1);
    const Row p{from, from + kRing * to, to + kRing * from, to};
    for (int i = 0; i < level; ++i) out.push_back(r * curve(p, static_cast<double>(i) / level) + Vec3(0, height, 0));
  }
  return out;
}

/// Rings along profile curves that follow one another from below.
std::vector<std::vector<Vec3>> revolved(const std::vector<Profile>& profiles, int level) {
  std::vector<std::vector<Vec3>> rows;
  for (std::size_t i = 0; i < profiles.size(); ++i) {
    for (int k = i == 0 ? 0 : 1; k <= level; ++k) {
      const Eigen::Vector2d p = curve(profiles[i], static_cast<double>(k) / level);
      rows.push_back(ring(p.x(), p.y(), level));
    }
  }
  return rows;
}

Row rowAt(const Patch& patch, double t) {
  const auto b = bernstein(t);
  Row row;
  for (int k = 0; k < 4; ++k)
    row[k] = b[0] * patch[0][k] + b[1] * patch[1][k] + b[2] * patch[2][k] + b[3] * patch[3][k];
  return row;
}

/// Closed sections along patches that follow one another; each patch is the half z >= 0 of its piece.
std::vector<std::vector<Vec3>> swept(const std::vector<Patch>& patches, int level) {
  std::vector<std::vector<Vec3>> rows;
  for (std::size_t i = 0; i < patches.size(); ++i) {
    for (int k = i == 0 ? 0 : 1; k <= level; ++k) {
      const Row section = rowAt(patches[i], static_cast<double>(k) / level);
      std::vector<Vec3> row;
      for (int j = 0; j <= level; ++j) row.push_back(curve(section, static_cast<double>(j) / level));
      for (int j = level - 1; j > 0; --j) row.push_back(row[static_cast<std::size_t>(j)].cwiseProduct(Vec3(1, 1, -1)));
      rows.push_back(std::move(row));
    }
  }
  return rows;
}

/// A section's four control points: two in the plane z = 0, two beside it.
Row section(double xTop, double yTop, double xBottom, double yBottom, double halfWidth) {
  return {Vec3(xTop, yTop, 0), Vec3(xTop, yTop, halfWidth), Vec3(xBottom, yBottom, halfWidth),
          Vec3(xBottom, yBottom, 0)};
}

}  // namespace

mesh::Mesh teapot(int level) {
  Builder builder;
  using V = Eigen::Vector2d;
  builder.tube(revolved({Profile{V(0, 0), V(1.425, 0), V(1.5, 0.075), V(1.5, 0.15)},
                         Profile{V(1.5, 0.15), V(1.5, 0.225), V(2, 0.45), V(2, 0.9)},
                         Profile{V(2, 0.9), V(2, 1.35), V(1.75, 1.875), V(1.5, 2.4)},
                         Profile{V(1.5, 2.4), V(1.4375, 2.53125), V(1.3375, 2.53125), V(1.4, 2.4)}},
                        level));
  builder.tube(revolved({Profile{V(1.3, 2.4), V(1.3, 2.55), V(0.4, 2.55), V(0.2, 2.7)},
                         Profile{V(0.2, 2.7), V(0, 2.85), V(0.8, 3.15), V(0, 3.15)}},
                        level));
  const double h = 0.3;
  builder.tube(swept({Patch{section(-1.6, 2.025, -1.5, 2.25, h), section(-2.3, 2.025, -2.5, 2.25, h),
                            section(-2.7, 2.025, -3.0, 2.25, h), section(-2.7, 1.8, -3.0, 1.8, h)},
                      Patch{section(-2.7, 1.8, -3.0, 1.8, h), section(-2.7, 1.575, -3.0, 1.35, h),
                            section(-2.5, 1.125, -2.65, 0.9375, h), section(-2.0, 0.9, -1.9, 0.6, h)}},
                     level));
  builder.tube(swept({Patch{section(1.7, 1.425, 1.7, 0.6, 0.66), section(2.6, 1.425, 3.1, 0.825, 0.66),
                            section(2.3, 2.1, 2.4, 2.025, 0.25), section(2.7, 2.4, 3.3, 2.4, 0.25)},
                      Patch{section(2.7, 2.4, 3.3, 2.4, 0.25), section(2.8, 2.475, 3.525, 2.49375, 0.25),
                            section(2.9, 2.475, 3.45, 2.5125, 0.15), section(2.8, 2.4, 3.2, 2.4, 0.15)}},
                     level));
  return builder.take();
}

}  // namespace fielddeform::samples
