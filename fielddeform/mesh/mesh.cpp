#include <fielddeform/mesh/mesh.h>
#include <fmt/format.h>

#include <stdexcept>

namespace fielddeform::mesh {
namespace {

template <class List>
auto findIn(List& list, Element on, std::string_view name) -> decltype(list.data()) {
  for (auto& a : list)
    if (a.on == on && a.name == name) return &a;
  return nullptr;
}

void checkCorners(const std::vector<Index>& corners, std::size_t vertices) {
  for (std::size_t i = 0; i < corners.size(); ++i)
    if (corners[i] >= vertices)
      throw std::invalid_argument(fmt::format("corner {} names vertex {}, expected less than {}", i, corners[i], vertices));
}

}  // namespace

Mesh::Mesh(std::vector<Vec3> positions, std::vector<Index> corners)
    : positions_(std::move(positions)), corners_(std::move(corners)) {
  if (corners_.size() % 3 != 0)
    throw std::invalid_argument(fmt::format("{} corners, expected a multiple of 3", corners_.size()));
  checkCorners(corners_, positions_.size());
}

Mesh::Mesh(std::vector<Vec3> positions, std::vector<Index> corners, std::vector<Index> offsets)
    : positions_(std::move(positions)), corners_(std::move(corners)), offsets_(std::move(offsets)) {
  checkCorners(corners_, positions_.size());
  if (offsets_.empty() || offsets_.front() != 0 || offsets_.back() != corners_.size())
    throw std::invalid_argument("face offsets must start at 0 and end at the number of corners");
  bool triangles = true;
  for (std::size_t f = 0; f + 1 < offsets_.size(); ++f) {
    if (offsets_[f + 1] <= offsets_[f])
      throw std::invalid_argument(fmt::format("face {} has no corner, expected at least one", f));
    triangles = triangles && offsets_[f + 1] - offsets_[f] == 3;
  }
  if (triangles) offsets_.clear();
}

void Mesh::setPositions(std::vector<Vec3> positions) {
  if (positions.size() != positions_.size())
    throw std::invalid_argument(fmt::format("{} positions, expected {}", positions.size(), positions_.size()));
  positions_ = std::move(positions);
}

std::vector<Index> Mesh::triangles() const {
  if (allTriangles()) return corners_;
  std::vector<Index> out;
  out.reserve(corners_.size() * 3 / 2);
  for (std::size_t f = 0; f < faceCount(); ++f)
    forEachTriangle(f, [&](Index a, Index b, Index c) { out.insert(out.end(), {a, b, c}); });
  return out;
}

const Attribute* Mesh::find(Element on, std::string_view name) const noexcept { return findIn(attributes_, on, name); }
Attribute* Mesh::find(Element on, std::string_view name) noexcept { return findIn(attributes_, on, name); }

Box boundingBox(Points positions) {
  Box box;
  for (const Vec3& p : positions)
    if (p.allFinite()) box.extend(p);
  return box;
}

double objectSize(Points positions) {
  const Box box = boundingBox(positions);
  return box.isEmpty() ? 0.0 : box.diagonal().norm();
}

}  // namespace fielddeform::mesh
