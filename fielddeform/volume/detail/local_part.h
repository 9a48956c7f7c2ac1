#pragma once

#include <fielddeform/map/masked_map.h>
#include <fielddeform/volume/detail/local_mask.h>
#include <fielddeform/volume/surface_volume.h>

#include <memory>
#include <optional>

namespace fielddeform::volume::detail {

/// The surface around the vertices of one component that the pass may move: they and the others of their triangles, scaled.
struct LocalPart {
  std::vector<Index> vertex;      ///< #P, in the mesh, ascending
  std::vector<Vec3> base;         ///< #P by 3, posed
  std::vector<double> mask;       ///< #P
  std::vector<double> area;       ///< #P, a third of the triangles around it, at rest, over the sum of all parts' moved vertices
  std::vector<double> share;      ///< #P, s: how much of the correction it takes
  std::optional<SurfaceVolume> surface;  ///< its triangles, of #P
  std::shared_ptr<const map::Binding> binding;  ///< a view of `base` and `mask`
  double before = 0;              ///< volume at `base`, by `surface`
  double target = 0;

  std::size_t size() const noexcept { return vertex.size(); }
};

/// The parts of all held components, in their order, and the sum of the moved vertices' rest areas (scaled units).
struct LocalParts {
  std::vector<LocalPart> part;
  double area = 0;
};

/// What the edit did to the areas around vertices, of the held components. The last that needs the mesh's edges.
struct AreaChanges {
  std::vector<double> rest;          ///< #V, a third of the triangles around each, scaled
  std::vector<double> logRatio;      ///< #V, ln(A' / A)
  std::vector<double> smoothed;      ///< #V, of it
};
AreaChanges measureAreas(const LocalEdit& edit, const LocalMask& mask, const std::vector<ComponentVolumes::Value>& volumes);

LocalParts makeParts(const LocalEdit& edit, const LocalMask& mask, const std::vector<ComponentVolumes::Value>& volumes, AreaChanges areas);
LocalParts makeParts(const LocalEdit& edit, const LocalMask& mask, const std::vector<ComponentVolumes::Value>& volumes);

}  // namespace fielddeform::volume::detail
