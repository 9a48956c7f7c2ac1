#include <fielddeform/map/press_tool.h>
#include <fielddeform/mesh/topology.h>
#include <fielddeform/spatial/closest_tree.h>
#include <fielddeform/spatial/winding.h>
#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

namespace fielddeform::map {
namespace {

struct Solid {
  Box box;
  spatial::ClosestTree tree;
  spatial::WindingNumber winding;
};

std::vector<std::array<Index, 3>> trianglesOf(const mesh::Mesh& mesh) {
  std::vector<std::array<Index, 3>> list;
  for (std::size_t f = 0; f < mesh.faceCount(); ++f)
    mesh.forEachTriangle(f, [&](Index a, Index b, Index c) { list.push_back({a, b, c}); });
  return list;
}

}  // namespace

struct PressTool::Impl {
  Vec3 point = Vec3::Zero(), normal = Vec3::UnitZ();
  std::optional<Solid> solid;
};

PressTool::PressTool(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}
PressTool::~PressTool() = default;
PressTool::PressTool(const PressTool&) = default;
PressTool& PressTool::operator=(const PressTool&) = default;

PressTool PressTool::plane(const Vec3& point, const Vec3& normal) {
  if (!point.allFinite()) throw std::invalid_argument("point: not finite");
  if (!normal.allFinite() || !(normal.stableNorm() > 0)) throw std::invalid_argument("normal: must be finite and have a length");
  auto impl = std::make_shared<Impl>();
  impl->point = point;
  impl->normal = normal.stableNormalized();
  return PressTool(std::move(impl));
}

PressTool PressTool::solid(const mesh::Mesh& mesh) {
  const auto triangles = trianglesOf(mesh);
  if (triangles.empty()) throw std::invalid_argument("tool: has no triangles");
  for (const Vec3& p : mesh.positions())
    if (!p.allFinite()) throw std::invalid_argument("tool: a vertex is not finite");
  const mesh::EdgeCounts edges = mesh::countEdges(mesh::EdgeTable(mesh));
  if (!edges.closed())
    throw std::invalid_argument(fmt::format("tool: the surface is not closed, {} of its edges are open", edges.open));
  auto impl = std::make_shared<Impl>();
  impl->solid.emplace(Solid{mesh::boundingBox(mesh.positions()), spatial::ClosestTree::ofTriangles(mesh.positions(), triangles),
                            spatial::WindingNumber(mesh.positions(), triangles)});
  return PressTool(std::move(impl));
}

bool PressTool::isPlane() const { return !impl_->solid; }

double PressTool::clearance(const Vec3& point, double enough) const {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  if (!point.allFinite()) return kFar;
  if (!impl_->solid) return impl_->normal.dot(point - impl_->point);
  const Solid& s = *impl_->solid;
  const bool within = s.box.contains(point);
  if (!within && s.box.exteriorDistance(point) > enough) return kFar;
  const double distance = s.tree.closest(point).distance;
  return within && std::abs(s.winding.at(point)) > 0.5 ? -distance : distance;
}

PressTool::Contact PressTool::contact(const Vec3& point) const {
  if (!point.allFinite()) return {};
  if (!impl_->solid) {
    const double height = impl_->normal.dot(point - impl_->point);
    if (!(height < 0)) return {};
    return {-height, point - height * impl_->normal, impl_->normal};
  }
  const Solid& s = *impl_->solid;
  if (!s.box.contains(point) || !(std::abs(s.winding.at(point)) > 0.5)) return {};
  const spatial::ClosestPoint nearest = s.tree.closest(point);
  if (!(nearest.distance > 0)) return {};
  return {nearest.distance, nearest.point, -nearest.offset / nearest.distance};
}

}  // namespace fielddeform::map
