#pragma once

#include <fielddeform/map/linear_map.h>
#include <fielddeform/mesh/mesh.h>
#include <fielddeform/volume/energy.h>
#include <fielddeform/volume/surface_volume.h>

#include <memory>
#include <optional>

namespace fielddeform::volume {

/// A triangle mesh tied to a linear map: x(d) = base + B d. The base is where the points stand when the map's displacements
/// are zero (for a lattice the bound points; for a masked map the posed surface), so a masked map works unchanged.
struct Surface {
  std::shared_ptr<const map::Binding> binding;  ///< of #V points, by Problem::map
  std::vector<Vec3> base;                       ///< #V by 3, world
  std::vector<Index> triangles;                 ///< 3 each, outward
  std::vector<Index> region{};                  ///< #T: 0 .. R-1 or kNoIndex, or empty: one region
};

/// Binds the points of a mesh, polygons as their fans.
Surface makeSurface(const map::LinearMap& map, const mesh::Mesh& mesh, std::vector<Index> region = {});

/// Points that must come to stand at given places: linear rows. Where they cannot all be met (fewer free nodes than
/// targets), InfeasibleError.
struct PointTargets {
  std::shared_ptr<const map::Binding> binding;  ///< of #Q points, by Problem::map
  std::vector<Vec3> base;                       ///< #Q by 3, where they stand when the displacements are zero
  std::vector<Vec3> position;                   ///< #Q by 3, where they must stand
};

/// Centre of mass and inertia of one region's solid, of uniform density: exact for the mesh.
struct MomentTarget {
  std::size_t region = 0;
  std::optional<Vec3> centre{};      ///< of mass, world
  /// About the centre of mass, per unit mass: integral of (x - c)(x - c)^T over the solid / volume, world^2. (The inertia tensor
  /// is trace(J) I - J.)
  std::optional<Mat3> spread{};
};

struct Constraints {
  /// Cubic units, one a region. Empty: as at d = 0. NaN leaves a region free.
  std::vector<double> volume{};
  std::vector<Index> pinned{};       ///< nodes that stay at their start displacement
  std::optional<PointTargets> points{};
  std::vector<MomentTarget> moments{};
};

/// minimise Energy(d) so that the volumes (and whatever else is asked for) are met. [Hirota et al. 1999, section 3.5]
struct Problem {
  std::shared_ptr<const map::LinearMap> map;
  Surface surface;
  std::shared_ptr<const Energy> energy;
  Constraints constraints{};
  /// #N by 3, world: pinned nodes stand here, the others start here. Empty: the map's own displacements.
  std::vector<Vec3> start{};
  /// The same solid in fewer triangles, the coarsest first, regions as in `surface`: for the multi-level augmented Lagrangian
  /// and the two-grid solve. Empty: none (makeLevels() makes them).
  std::vector<Surface> coarser{};
  Rims rims = Rims::Refuse;

  /// @throw std::invalid_argument if sizes do not match or a number is not finite
  void validate() const;
};

struct LevelOptions {
  double ratio = 4;               ///< triangles of one level over those of the next coarser; > 1 [Hirota et al. 1999: 4]
  std::size_t coarsest = 64;      ///< triangles, about; regions keep at least 16 each where they have them
  /// Faces whose edges are longer than this share of the size are split first (a flat face does not stay flat); 0: never.
  double longestEdge = 0.25;
};
/// Coarser copies of a mesh by quadric edge collapse, region by region. Positions of kept vertices are the mesh's own.
std::vector<Surface> makeLevels(const map::LinearMap& map, const mesh::Mesh& mesh, const LevelOptions& options = {},
                                std::span<const Index> region = {});
/// The mesh with faces split (longest edges halved, conforming) until no edge is longer than `length` (world), triangles.
/// New vertices lie on the edges: a flat surface keeps its shape and its volume.
mesh::Mesh refineLongEdges(const mesh::Mesh& mesh, double length);

}  // namespace fielddeform::volume
