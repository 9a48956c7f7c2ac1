#include <fielddeform/volume/problem.h>
#include <fmt/format.h>

#include <stdexcept>

namespace fielddeform::volume {
namespace {

void checkSurface(const Surface& s, const char* name) {
  if (!s.binding) throw std::invalid_argument(fmt::format("{}: no binding", name));
  if (s.binding->size() != s.base.size())
    throw std::invalid_argument(fmt::format("{}: {} points bound, {} base positions", name, s.binding->size(), s.base.size()));
}

void checkPoints(Points p, std::size_t count, const char* name) {
  if (p.size() != count) throw std::invalid_argument(fmt::format("{}: {} points, expected {}", name, p.size(), count));
  for (std::size_t i = 0; i < p.size(); ++i)
    if (!p[i].allFinite()) throw std::invalid_argument(fmt::format("{}: point {} is not finite", name, i));
}

}  // namespace

Surface makeSurface(const map::LinearMap& map, const mesh::Mesh& mesh, std::vector<Index> region) {
  Surface out;
  out.base = mesh.positions();
  out.binding = map.bind(out.base);
  out.triangles = mesh.triangles();
  if (!region.empty()) {
    if (region.size() != mesh.faceCount()) throw std::invalid_argument(fmt::format("region: {} labels for {} faces", region.size(), mesh.faceCount()));
    for (std::size_t f = 0; f < mesh.faceCount(); ++f) mesh.forEachTriangle(f, [&](Index, Index, Index) { out.region.push_back(region[f]); });
  }
  return out;
}

void Problem::validate() const {
  if (!map) throw std::invalid_argument("map: none given");
  if (!energy) throw std::invalid_argument("energy: none given");
  checkSurface(surface, "surface");
  for (const Surface& s : coarser) checkSurface(s, "coarser");
  const std::size_t n = map->nodeCount();
  if (energy->nodeCount() != n) throw std::invalid_argument(fmt::format("energy: of {} nodes, the map has {}", energy->nodeCount(), n));
  if (!start.empty()) checkPoints(start, n, "start");
  for (const Index i : constraints.pinned)
    if (i >= n) throw std::invalid_argument(fmt::format("pinned: node {} of {}", i, n));
  std::size_t regions = surface.region.empty() ? 1 : 0;
  for (const Index r : surface.region)
    if (r != kNoIndex) regions = std::max<std::size_t>(regions, std::size_t{r} + 1);
  if (!constraints.volume.empty() && constraints.volume.size() != regions)
    throw std::invalid_argument(fmt::format("volume: {} targets for {} regions", constraints.volume.size(), regions));
  if (const auto& points = constraints.points) {
    if (!points->binding) throw std::invalid_argument("points: no binding");
    checkPoints(points->base, points->binding->size(), "points.base");
    checkPoints(points->position, points->binding->size(), "points.position");
  }
  for (const MomentTarget& m : constraints.moments) {
    if (m.region >= regions) throw std::invalid_argument(fmt::format("moments: region {} of {}", m.region, regions));
    if (m.centre && !m.centre->allFinite()) throw std::invalid_argument("moments: the centre is not finite");
    if (m.spread && !m.spread->allFinite()) throw std::invalid_argument("moments: the spread is not finite");
  }
}

}  // namespace fielddeform::volume
