#include <fielddeform/core/error.h>
#include <fielddeform/mesh/lod.h>
#include <fielddeform/mesh/topology.h>
#include <fielddeform/volume/problem.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

namespace fielddeform::volume {
namespace {

/// The faces of one region as a mesh of their own.
mesh::Mesh partOf(const mesh::Mesh& mesh, std::span<const Index> region, Index wanted) {
  std::vector<Index> place(mesh.vertexCount(), kNoIndex), corners;
  std::vector<Vec3> positions;
  for (std::size_t f = 0; f < mesh.faceCount(); ++f) {
    if (!region.empty() && region[f] != wanted) continue;
    mesh.forEachTriangle(f, [&](Index a, Index b, Index c) {
      for (const Index v : {a, b, c}) {
        if (place[v] == kNoIndex) place[v] = static_cast<Index>(positions.size()), positions.push_back(mesh.positions()[v]);
        corners.push_back(place[v]);
      }
    });
  }
  return mesh::Mesh(std::move(positions), std::move(corners));
}

double longestSide(const mesh::Mesh& mesh) {
  const Box box = mesh::boundingBox(mesh.positions());
  return box.isEmpty() ? 0 : box.sizes().maxCoeff();
}

/// Splits each triangle by which of its edges have a midpoint: two, three or four triangles, the shorter diagonal of a quad.
void splitTriangle(const std::vector<Vec3>& p, std::array<Index, 3> v, std::array<Index, 3> m, std::vector<Index>& out) {
  const auto add = [&](Index a, Index b, Index c) { out.insert(out.end(), {a, b, c}); };
  const int count = (m[0] != kNoIndex) + (m[1] != kNoIndex) + (m[2] != kNoIndex);
  if (count == 0) return add(v[0], v[1], v[2]);
  // Turned so that with one midpoint it is on edge 0, with two they are on edges 0 and 1.
  while (!(count == 3 || (count == 1 && m[0] != kNoIndex) || (count == 2 && m[2] == kNoIndex))) {
    std::rotate(v.begin(), v.begin() + 1, v.end());
    std::rotate(m.begin(), m.begin() + 1, m.end());
  }
  if (count == 3) {
    add(v[0], m[0], m[2]), add(m[0], v[1], m[1]), add(m[2], m[1], v[2]), add(m[0], m[1], m[2]);
  } else if (count == 1) {
    add(v[0], m[0], v[2]), add(m[0], v[1], v[2]);
  } else {
    add(m[0], v[1], m[1]);
    if ((p[v[0]] - p[m[1]]).squaredNorm() <= (p[m[0]] - p[v[2]]).squaredNorm()) add(v[0], m[0], m[1]), add(v[0], m[1], v[2]);
    else add(v[0], m[0], v[2]), add(m[0], m[1], v[2]);
  }
}

}  // namespace

mesh::Mesh refineLongEdges(const mesh::Mesh& mesh, double length) {
  requirePositive("length", length);
  std::vector<Vec3> p = mesh.positions();
  std::vector<Index> triangles = mesh.triangles();
  // Every round halves what is too long; 40 rounds halve the longest edge by 1e12.
  for (int round = 0; round < 40; ++round) {
    const mesh::EdgeTable table(p.size(), triangles);
    std::vector<Index> middle(table.size(), kNoIndex);
    bool any = false;
    for (std::size_t e = 0; e < table.size(); ++e) {
      const auto [a, b] = table.vertices(e);
      if (!((p[a] - p[b]).norm() > length)) continue;
      any = true;
      middle[e] = static_cast<Index>(p.size());
      p.push_back(0.5 * p[a] + 0.5 * p[b]);
    }
    if (!any) break;
    if (p.size() > 50'000'000) throw std::invalid_argument("length: the mesh would grow beyond 50 million vertices");
    std::vector<Index> next;
    for (std::size_t c = 0; c < triangles.size(); c += 3) {
      const auto at = [&](std::size_t k) { return table.ofCorner(c + k) == kNoIndex ? kNoIndex : middle[table.ofCorner(c + k)]; };
      splitTriangle(p, {triangles[c], triangles[c + 1], triangles[c + 2]}, {at(0), at(1), at(2)}, next);
    }
    triangles = std::move(next);
  }
  return mesh::Mesh(std::move(p), std::move(triangles));
}

std::vector<Surface> makeLevels(const map::LinearMap& map, const mesh::Mesh& mesh, const LevelOptions& options, std::span<const Index> region) {
  if (!(options.ratio > 1)) throw std::invalid_argument(fmt::format("ratio is {}, expected more than 1", options.ratio));
  if (!region.empty() && region.size() != mesh.faceCount())
    throw std::invalid_argument(fmt::format("region: {} labels for {} faces", region.size(), mesh.faceCount()));
  Index regions = 1;
  for (const Index r : region)
    if (r != kNoIndex) regions = std::max(regions, r + 1);
  std::vector<mesh::Mesh> parts;
  std::vector<std::size_t> faces;
  std::size_t total = 0;
  for (Index r = 0; r < regions; ++r) {
    parts.push_back(partOf(mesh, region, r));
    faces.push_back(parts.back().faceCount());
    total += faces.back();
  }
  const double longest = options.longestEdge > 0 ? options.longestEdge * longestSide(mesh) : 0;
  std::vector<Surface> levels;  // the finest first, turned at the end
  double triangles = static_cast<double>(total) / options.ratio;
  for (; triangles >= static_cast<double>(options.coarsest) && total > 0; triangles /= options.ratio) {
    std::vector<Vec3> positions;
    std::vector<Index> corners, label;
    for (Index r = 0; r < regions; ++r) {
      const double share = triangles * static_cast<double>(faces[r]) / static_cast<double>(total);
      const auto wanted = std::min(faces[r], std::max<std::size_t>(16, static_cast<std::size_t>(share)));
      // Each level from the one before: quadrics start anew, but it costs a fraction.
      parts[r] = mesh::simplify(parts[r], std::max<std::size_t>(1, wanted)).mesh;
      const mesh::Mesh level = longest > 0 ? refineLongEdges(parts[r], longest) : parts[r];
      for (const Index v : level.corners()) corners.push_back(v + static_cast<Index>(positions.size()));
      positions.insert(positions.end(), level.positions().begin(), level.positions().end());
      label.insert(label.end(), level.faceCount(), r);
    }
    const mesh::Mesh level(std::move(positions), std::move(corners));
    if (2 * level.faceCount() > total) continue;
    levels.push_back(makeSurface(map, level, regions > 1 ? label : std::vector<Index>()));
  }
  std::reverse(levels.begin(), levels.end());
  return levels;
}

}  // namespace fielddeform::volume
