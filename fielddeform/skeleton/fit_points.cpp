#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/core/random.h>
#include <fielddeform/mesh/lod.h>
#include <fielddeform/skeleton/fit.h>
#include <fielddeform/skeleton/io.h>
#include <fielddeform/spatial/closest_tree.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

namespace fielddeform::skeleton {
namespace {

// The triangles of all finite faces with the running sum of their areas.
struct AreaTable {
  std::vector<std::array<Index, 3>> triangles;
  std::vector<double> upTo;
};

AreaTable areaTable(const mesh::Mesh& mesh) {
  AreaTable table;
  const std::vector<Vec3>& x = mesh.positions();
  double sum = 0;
  for (std::size_t f = 0; f < mesh.faceCount(); ++f)
    mesh.forEachTriangle(f, [&](Index a, Index b, Index c) {
      const double area = 0.5 * (x[b] - x[a]).cross(x[c] - x[a]).norm();
      if (!std::isfinite(area) || !(area > 0)) return;
      sum += area;
      table.triangles.push_back({a, b, c});
      table.upTo.push_back(sum);
    });
  return table;
}

// One candidate from each of `count` strips of equal area, uniform within its triangle.
std::vector<Vec3> drawByArea(const mesh::Mesh& mesh, const AreaTable& table, std::size_t count, std::uint64_t seed) {
  std::vector<Vec3> out;
  for (std::size_t i = 0; i < count; ++i) {
    const double share = (static_cast<double>(i) + uniform01(seed, 3 * i)) / static_cast<double>(count);
    const auto at = std::upper_bound(table.upTo.begin(), table.upTo.end(), share * table.upTo.back());
    const auto t = std::min<std::size_t>(static_cast<std::size_t>(at - table.upTo.begin()), table.triangles.size() - 1);
    double u = uniform01(seed, 3 * i + 1), v = uniform01(seed, 3 * i + 2);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const auto [a, b, c] = table.triangles[t];
    const Vec3 &p = mesh.positions()[a], &q = mesh.positions()[b], &r = mesh.positions()[c];
    out.push_back(p + u * (q - p) + v * (r - p));
  }
  return out;
}

std::vector<Vec3> finiteVertices(const mesh::Mesh& mesh) {
  std::vector<Vec3> out;
  for (const Vec3& x : mesh.positions())
    if (x.allFinite()) out.push_back(x);
  return out;
}

// Every `step`-th element, so that the work stays proportional to the candidates wanted.
std::vector<Vec3> thinned(std::vector<Vec3> points, std::size_t count) {
  if (points.size() <= count) return points;
  std::vector<Vec3> out;
  for (std::size_t i = 0; i < count; ++i) out.push_back(points[i * points.size() / count]);
  return out;
}

std::vector<Vec3> farthestFirst(const std::vector<Vec3>& candidates, std::size_t count) {
  Vec3 mean = Vec3::Zero();
  for (const Vec3& x : candidates) mean += (x - candidates[0]) / static_cast<double>(candidates.size());
  mean += candidates[0];
  std::vector<double> gap(candidates.size());
  for (std::size_t i = 0; i < gap.size(); ++i) gap[i] = (candidates[i] - mean).squaredNorm();
  std::vector<Vec3> out;
  while (out.size() < count) {
    const auto next = static_cast<std::size_t>(std::max_element(gap.begin(), gap.end()) - gap.begin());
    if (!out.empty() && !(gap[next] > 0)) break;  // all places are taken
    out.push_back(candidates[next]);
    for (std::size_t i = 0; i < gap.size(); ++i) {
      const double d = (candidates[i] - candidates[next]).squaredNorm();
      gap[i] = out.size() == 1 ? d : std::min(gap[i], d);
    }
  }
  return out;
}

spatial::ClosestTree treeOf(const Primitive& p) {
  if (p.type == PrimitiveType::Points) return spatial::ClosestTree::ofPoints(p.points);
  if (p.type == PrimitiveType::Polyline) {
    std::vector<std::array<Index, 2>> segments;
    const auto n = static_cast<Index>(p.points.size());
    for (Index i = 1; i < n; ++i) segments.push_back({i - 1, i});
    if (p.closed) segments.push_back({n - 1, 0});
    return spatial::ClosestTree::ofSegments(p.points, segments);
  }
  std::vector<std::array<Index, 3>> triangles;
  for (const auto& f : p.faces)
    for (std::size_t k = 2; k < f.size(); ++k) triangles.push_back({f[0], f[k - 1], f[k]});
  return spatial::ClosestTree::ofTriangles(p.points, triangles);
}

}  // namespace

Skeleton fitPoints(const mesh::Mesh& mesh, const PointFitOptions& options) {
  requireInRange("points", static_cast<double>(options.points), 1, 100000);
  const AreaTable table = areaTable(mesh);
  const std::size_t wanted = 32 * options.points;
  const std::vector<Vec3> candidates = table.triangles.empty() ? thinned(finiteVertices(mesh), std::max<std::size_t>(wanted, 4096))
                                                               : drawByArea(mesh, table, wanted, options.seed);
  if (candidates.empty()) throw std::invalid_argument("skeleton: the mesh has no finite vertex, needs at least 1");
  Primitive p;
  p.name = options.name;
  p.type = PrimitiveType::Points;
  p.points = farthestFirst(candidates, options.points);
  Skeleton skeleton{{std::move(p)}, {}};
  fillAutomaticRadius(skeleton, mesh.positions(), kFitRadiusFactor);
  validate(skeleton);
  return skeleton;
}

LodFit fitLod(const mesh::Mesh& mesh, const LodFitOptions& options) {
  mesh::Lod lod = mesh::simplify(mesh, options.faces);
  if (lod.mesh.faceCount() == 0)
    throw std::invalid_argument("skeleton: the mesh has no face of three different finite vertices to simplify");
  Primitive p;
  p.name = options.name;
  p.type = PrimitiveType::Mesh;
  p.points = lod.mesh.positions();
  double length = 0;
  for (std::size_t f = 0; f < lod.mesh.faceCount(); ++f) {
    const auto c = lod.mesh.face(f);
    p.faces.emplace_back(c.begin(), c.end());
    for (std::size_t k = 0; k < c.size(); ++k) length += (p.points[c[(k + 1) % c.size()]] - p.points[c[k]]).norm();
  }
  p.closed = boundsSolid(p.faces);
  Skeleton skeleton{{std::move(p)}, {}};
  const double reach = kFitRadiusFactor * greatestDistance(mesh.positions(), skeleton);
  const double radius = std::max(reach, length / static_cast<double>(lod.mesh.cornerCount()) * 3);
  if (radius > 0) skeleton.primitives[0].radius = radius;
  fillAutomaticRadius(skeleton, mesh.positions(), kFitRadiusFactor);
  validate(skeleton);
  return {std::move(skeleton), std::move(lod.message)};
}

double greatestDistance(Points vertices, const Skeleton& skeleton) {
  std::vector<spatial::ClosestTree> trees;
  for (const Primitive& p : skeleton.primitives) trees.push_back(treeOf(p));
  if (trees.empty()) return 0;
  const auto chunk = [&](std::size_t begin, std::size_t end) {
    double greatest = 0;
    for (std::size_t i = begin; i < end; ++i) {
      if (!vertices[i].allFinite()) continue;
      double least = INFINITY;
      for (const spatial::ClosestTree& tree : trees) least = std::min(least, tree.closest(vertices[i], {.maxDistance = least}).distance);
      greatest = std::max(greatest, least);
    }
    return greatest;
  };
  return deterministicReduce(vertices.size(), 4096, 0.0, chunk, [](double a, double b) { return std::max(a, b); });
}

double fillAutomaticRadius(Skeleton& skeleton, Points vertices, double factor) {
  requirePositive("factor", factor);
  double radius = factor * greatestDistance(vertices, skeleton);
  if (!(radius > 0)) radius = 0.01 * mesh::objectSize(vertices);
  if (!(radius > 0)) radius = 1;  // a single point: any radius serves
  for (Primitive& p : skeleton.primitives)
    if (!p.radius && p.pointRadius.empty()) p.radius = radius;
  return radius;
}

}  // namespace fielddeform::skeleton
