#include <fielddeform/core/parallel.h>
#include <fielddeform/mesh/detail/triangle.h>
#include <fielddeform/mesh/quality.h>
#include <fielddeform/numeric/rotation.h>
#include <fielddeform/numeric/elementary.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <stdexcept>

namespace fielddeform::mesh {
namespace {

constexpr std::size_t kGrain = 4096;

void checkCount(const Mesh& mesh, std::size_t count, const char* what) {
  if (count != mesh.vertexCount())
    throw std::invalid_argument(fmt::format("{} {}, expected {}", count, what, mesh.vertexCount()));
}

/// The triangles of a mesh, without a copy if it has no other faces.
class Triangles {
 public:
  explicit Triangles(const Mesh& mesh)
      : own_(mesh.allTriangles() ? std::vector<Index>{} : mesh.triangles()),
        corners_(mesh.allTriangles() ? std::span<const Index>(mesh.corners()) : std::span<const Index>(own_)) {}
  explicit Triangles(std::span<const Index> corners) : corners_(corners) {}
  std::size_t size() const { return corners_.size() / 3; }
  const Index* operator[](std::size_t t) const { return corners_.data() + 3 * t; }
  std::span<const Index> corners() const { return corners_; }

 private:
  std::vector<Index> own_;
  std::span<const Index> corners_;
};

/// Normal (of no particular length) of a triangle with area.
std::optional<Vec3> normal(const Index* t, Points x) {
  const Vec3 n = detail::areaVector(x[t[0]], x[t[1]], x[t[2]]);
  if (!detail::hasArea(x[t[0]], x[t[1]], x[t[2]], n)) return std::nullopt;
  return n;
}

/// Cosine between the normals at an edge of exactly two triangles, both with area.
std::optional<double> edgeCosine(const EdgeTable& table, const Triangles& triangles, std::size_t e, Points x) {
  const auto uses = table.uses(e);
  if (uses.size() != 2) return std::nullopt;
  const auto a = normal(triangles[uses[0] / 3], x), b = normal(triangles[uses[1] / 3], x);
  if (!a || !b) return std::nullopt;
  const double cosine = a->dot(*b) / std::sqrt(a->squaredNorm() * b->squaredNorm());
  return table.isForward(uses[0]) == table.isForward(uses[1]) ? -cosine : cosine;
}

using UnitNormal = std::array<float, 3>;

/// Unit normals as floats; anything for triangles without area.
std::vector<UnitNormal> unitNormals(const Triangles& triangles, Points x) {
  std::vector<UnitNormal> unit(triangles.size());
  parallelFor(unit.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const Index* c = triangles[t];
      const Vec3 n = detail::areaVector(x[c[0]], x[c[1]], x[c[2]]);
      const double scale = 1 / std::sqrt(n.squaredNorm());
      for (int k = 0; k < 3; ++k) unit[t][static_cast<std::size_t>(k)] = static_cast<float>(n[k] * scale);
    }
  });
  return unit;
}

float cosine(const UnitNormal& a, const UnitNormal& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/// How many edges of exactly two triangles, both with area, have a cosine below kFoldTo at x, and how many of those one above
/// kFoldFrom at `other`. Decided by the triangles' unit normals as floats, and exactly near the bound.
struct Sharp {
  std::size_t edges = 0, folds = 0;
};
Sharp countSharp(const EdgeTable& table, const Triangles& triangles, Points x, Points other) {
  constexpr float kFloatError = 1e-5f;
  const std::vector<UnitNormal> unit = unitNormals(triangles, x);
  return deterministicReduce(
      table.size(), kGrain, Sharp{},
      [&](std::size_t begin, std::size_t end) {
        Sharp n;
        for (std::size_t e = begin; e < end; ++e) {
          const auto uses = table.uses(e);
          if (uses.size() != 2) continue;
          const bool same = table.isForward(uses[0]) != table.isForward(uses[1]);
          const float near = cosine(unit[uses[0] / 3], unit[uses[1] / 3]) * (same ? 1.0f : -1.0f);
          if (!(near < static_cast<float>(kFoldTo) + kFloatError)) continue;
          const auto here = edgeCosine(table, triangles, e, x);
          if (!here || !(*here < kFoldTo)) continue;
          ++n.edges;
          if (other.empty()) continue;
          const auto there = edgeCosine(table, triangles, e, other);
          n.folds += there && *there > kFoldFrom;
        }
        return n;
      },
      [](const Sharp& a, const Sharp& b) { return Sharp{a.edges + b.edges, a.folds + b.folds}; });
}

// Two triangles whose normals are both within acos 0.6 of a third direction are less than 107 degrees apart, not a fold.
constexpr float kAlike = 0.6f;

// Differs from one number to another in every bit.
std::uint64_t scrambled(std::uint64_t x) {
  x = (x + 0x9E3779B97F4A7C15u) * 0xBF58476D1CE4E5B9u;
  return (x ^ (x >> 29)) * 0x94D049BB133111EBu;
}

// Triangles that may be at a fold: whose normal differs from that of some triangle at one of their corners, or that have a corner
// around which not all are turned alike, where normals tell nothing. Everything else is certain, rounding to floats included.
std::vector<char> mayFold(const Mesh& mesh, const Triangles& triangles, Points posed) {
  const std::size_t n = triangles.size();
  const std::vector<UnitNormal> unit = unitNormals(triangles, posed);
  struct Corner {
    Index some = 0;            // a triangle here
    std::uint64_t left = 0;    // of the vertices that edges lead to, less those that they come from: 0 around a whole fan turned alike
  };
  std::vector<Corner> at(mesh.vertexCount());
  for (std::size_t t = 0; t < n; ++t) {
    const Index* c = triangles[t];
    const std::uint64_t hash[3] = {scrambled(c[0]), scrambled(c[1]), scrambled(c[2])};
    for (int k = 0; k < 3; ++k) {
      Corner& corner = at[c[k]];
      corner.some = static_cast<Index>(t);
      corner.left += hash[(k + 1) % 3] - hash[(k + 2) % 3];
    }
  }
  std::vector<char> out(n);
  parallelFor(n, kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      bool alike = true;
      for (int k = 0; k < 3; ++k) {
        const Corner& corner = at[triangles[t][k]];
        alike = alike && corner.left == 0 && cosine(unit[t], unit[corner.some]) > kAlike;  // not where there is no number
      }
      out[t] = !alike;
    }
  });
  return out;
}

/// Folds at the edges of some triangles, as of the whole mesh.
std::size_t countFoldsAt(const Mesh& mesh, const Triangles& triangles, const std::vector<char>& chosen, Points rest, Points posed) {
  std::vector<char> corner(mesh.vertexCount(), 0);
  for (std::size_t t = 0; t < chosen.size(); ++t)
    if (chosen[t])
      for (int k = 0; k < 3; ++k) corner[triangles[t][k]] = 1;
  // Every triangle at an edge between two marked vertices.
  std::vector<Index> around;
  for (std::size_t t = 0; t < chosen.size(); ++t) {
    const Index* c = triangles[t];
    if (corner[c[0]] + corner[c[1]] + corner[c[2]] >= 2) around.insert(around.end(), c, c + 3);
  }
  if (around.empty()) return 0;
  const Triangles few(around);
  const EdgeTable table(mesh.vertexCount(), few.corners());
  return deterministicReduce(
      table.size(), kGrain, std::size_t{0},
      [&](std::size_t begin, std::size_t end) {
        std::size_t folds = 0;
        for (std::size_t e = begin; e < end; ++e) {
          const auto [a, b] = table.vertices(e);
          if (!corner[a] || !corner[b]) continue;
          const auto after = edgeCosine(table, few, e, posed);
          if (!after || !(*after < kFoldTo)) continue;
          const auto before = edgeCosine(table, few, e, rest);
          folds += before && *before > kFoldFrom;
        }
        return folds;
      },
      std::plus<>());
}

/// The same where the mesh's edges may serve: fans have edges of their own.
template <class Count>
auto withEdges(const Mesh& mesh, const EdgeTable& edges, const Triangles& triangles, Count&& count) {
  return mesh.allTriangles() ? count(edges) : count(EdgeTable(mesh.vertexCount(), triangles.corners()));
}

/// Smallest angle over the faces face(0) ... face(count - 1).
template <class Face>
double smallestAngleOf(const Mesh& mesh, Points positions, std::size_t count, Face&& face) {
  const double none = -1;  // the largest of a triangle's cotangents is positive
  const double cotangent = deterministicReduce(
      count, kGrain, none,
      [&](std::size_t begin, std::size_t end) {
        double largest = none;
        for (std::size_t i = begin; i < end; ++i)
          mesh.forEachTriangle(face(i), [&](Index a, Index b, Index c) {
            const Vec3 &p = positions[a], &q = positions[b], &r = positions[c];
            const Vec3 n = detail::areaVector(p, q, r);
            if (detail::hasArea(p, q, r, n)) largest = std::max(largest, detail::largestCotangent(p, q, r, n.norm()));
          });
        return largest;
      },
      [](double a, double b) { return std::max(a, b); });
  return cotangent == none ? 0.0 : numeric::atan2(1.0, cotangent);
}

std::size_t flippedWith(const Mesh& mesh, Points rest, Points posed, std::span<const Mat3> jacobians) {
  const Triangles triangles(mesh);
  return deterministicReduce(
      triangles.size(), kGrain, std::size_t{0},
      [&](std::size_t begin, std::size_t end) {
        std::size_t count = 0;
        for (std::size_t t = begin; t < end; ++t) {
          const auto before = normal(triangles[t], rest), after = normal(triangles[t], posed);
          if (!before || !after) continue;
          Vec3 expected = Vec3::Zero();
          int reversed = 0;
          for (int k = 0; k < 3; ++k) {
            const Mat3& j = jacobians[triangles[t][k]];
            const Vec3 r0 = j.row(0), r1 = j.row(1), r2 = j.row(2);
            expected += Vec3(r1.cross(r2).dot(*before), r2.cross(r0).dot(*before), r0.cross(r1).dot(*before));
            reversed += r0.dot(r1.cross(r2)) < 0;
          }
          count += after->dot(expected) < 0 || reversed >= 2;
        }
        return count;
      },
      std::plus<>());
}

}  // namespace

std::size_t countFolds(const Mesh& mesh, Points rest, Points posed) {
  checkCount(mesh, rest.size(), "rest positions"), checkCount(mesh, posed.size(), "posed positions");
  const Triangles triangles(mesh);
  return countFoldsAt(mesh, triangles, mayFold(mesh, triangles, posed), rest, posed);
}

std::size_t countFolds(const Mesh& mesh, const EdgeTable& edges, Points rest, Points posed) {
  checkCount(mesh, rest.size(), "rest positions"), checkCount(mesh, posed.size(), "posed positions");
  const Triangles triangles(mesh);
  return withEdges(mesh, edges, triangles, [&](const EdgeTable& table) { return countSharp(table, triangles, posed, rest).folds; });
}

std::size_t countSharpEdges(const Mesh& mesh, Points positions) { return countSharpEdges(mesh, EdgeTable(mesh), positions); }

std::size_t countSharpEdges(const Mesh& mesh, const EdgeTable& edges, Points positions) {
  checkCount(mesh, positions.size(), "positions");
  const Triangles triangles(mesh);
  return withEdges(mesh, edges, triangles, [&](const EdgeTable& table) { return countSharp(table, triangles, positions, {}).edges; });
}

StretchReport edgeStretch(const EdgeTable& edges, Points rest, Points posed) {
  std::vector<double> ratio(edges.size());
  parallelFor(edges.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t e = begin; e < end; ++e) {
      const auto [a, b] = edges.vertices(e);
      ratio[e] = (posed[a] - posed[b]).norm() / (rest[a] - rest[b]).norm();
    }
  });
  std::erase_if(ratio, [](double r) { return !std::isfinite(r); });
  StretchReport out;
  out.edges = ratio.size();
  out.unmeasured = edges.size() - ratio.size();
  if (ratio.empty()) return out;
  const std::size_t rank = (ratio.size() * 99 + 99) / 100 - 1;
  std::nth_element(ratio.begin(), ratio.begin() + static_cast<std::ptrdiff_t>(rank), ratio.end());
  out.p99 = ratio[rank];
  out.max = *std::max_element(ratio.begin() + static_cast<std::ptrdiff_t>(rank), ratio.end());
  out.min = *std::min_element(ratio.begin(), ratio.begin() + static_cast<std::ptrdiff_t>(rank) + 1);
  return out;
}

double smallestAngle(const Mesh& mesh, Points positions) {
  checkCount(mesh, positions.size(), "positions");
  return smallestAngleOf(mesh, positions, mesh.faceCount(), [](std::size_t i) { return i; });
}

double smallestAngle(const Mesh& mesh, Points positions, std::span<const Index> faces) {
  checkCount(mesh, positions.size(), "positions");
  return smallestAngleOf(mesh, positions, faces.size(), [&](std::size_t i) { return faces[i]; });
}

QualityReport compareQuality(const Mesh& mesh, Points rest, Points posed) {
  return compareQuality(mesh, EdgeTable(mesh), rest, posed);
}

QualityReport compareQuality(const Mesh& mesh, const EdgeTable& edges, Points rest, Points posed) {
  checkCount(mesh, rest.size(), "rest positions"), checkCount(mesh, posed.size(), "posed positions");
  QualityReport out;
  const Triangles triangles(mesh);
  withEdges(mesh, edges, triangles, [&](const EdgeTable& table) {
    const Sharp sharp = countSharp(table, triangles, posed, rest);
    out.folds = sharp.folds, out.sharpPosed = sharp.edges;
    out.sharpRest = countSharp(table, triangles, rest, {}).edges;
  });
  using Pair = std::array<std::size_t, 2>;
  const Pair flat = deterministicReduce(
      triangles.size(), kGrain, Pair{},
      [&](std::size_t begin, std::size_t end) {
        Pair n{};
        for (std::size_t t = begin; t < end; ++t) {
          const bool before = normal(triangles[t], rest).has_value();
          n[0] += !before;
          n[1] += before && !normal(triangles[t], posed);
        }
        return n;
      },
      [](const Pair& a, const Pair& b) { return Pair{a[0] + b[0], a[1] + b[1]}; });
  out.degenerateRest = flat[0], out.collapsed = flat[1];
  out.minAngleRest = smallestAngle(mesh, rest);
  out.minAnglePosed = smallestAngle(mesh, posed);
  out.stretch = edgeStretch(edges, rest, posed);
  return out;
}

std::size_t countFlipped(const Mesh& mesh, Points rest, Points posed, std::span<const Mat3> jacobians) {
  checkCount(mesh, rest.size(), "rest positions"), checkCount(mesh, posed.size(), "posed positions");
  checkCount(mesh, jacobians.size(), "jacobians");
  return flippedWith(mesh, rest, posed, jacobians);
}

std::size_t countFlipped(const Mesh& mesh, Points rest, Points posed) {
  return countFlipped(mesh, EdgeTable(mesh), rest, posed);
}

std::size_t countFlipped(const Mesh& mesh, EdgeTable table, Points rest, Points posed) {
  checkCount(mesh, rest.size(), "rest positions"), checkCount(mesh, posed.size(), "posed positions");
  // The neighbours of each vertex, in the order of their edges.
  std::vector<std::size_t> start(mesh.vertexCount() + 1, 0);
  std::vector<Index> neighbour;
  {
    const EdgeTable edges = std::move(table);  // gone before the fits need room
    for (std::size_t e = 0; e < edges.size(); ++e)
      for (const Index v : edges.vertices(e)) ++start[v + 1];
    for (std::size_t v = 0; v < mesh.vertexCount(); ++v) start[v + 1] += start[v];
    neighbour.resize(start.back());
    std::vector<std::size_t> next(start.begin(), start.end() - 1);
    for (std::size_t e = 0; e < edges.size(); ++e) {
      const auto [a, b] = edges.vertices(e);
      neighbour[next[a]++] = b;
      neighbour[next[b]++] = a;
    }
  }
  std::vector<Mat3> ring(mesh.vertexCount()), fit(mesh.vertexCount());
  const auto forAll = [&](auto&& work) {
    parallelFor(mesh.vertexCount(), 1024, [&](std::size_t begin, std::size_t end) {
      for (std::size_t v = begin; v < end; ++v) work(v);
    });
  };
  forAll([&](std::size_t v) {
    Mat3 sum = Mat3::Zero();
    for (std::size_t i = start[v]; i < start[v + 1]; ++i) {
      const Index u = neighbour[i];
      const Mat3 c = (rest[u] - rest[v]) * (posed[u] - posed[v]).transpose();
      if (c.allFinite()) sum += c;
    }
    ring[v] = sum;
  });
  forAll([&](std::size_t v) {
    Mat3 sum = ring[v];
    for (std::size_t i = start[v]; i < start[v + 1]; ++i) sum += ring[neighbour[i]];
    fit[v] = numeric::kabsch(sum);
  });
  return flippedWith(mesh, rest, posed, fit);
}

}  // namespace fielddeform::mesh
