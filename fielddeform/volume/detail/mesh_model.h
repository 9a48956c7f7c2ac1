#pragma once

#include <fielddeform/volume/detail/wedge_plan.h>
#include <fielddeform/volume/problem.h>

#include <Eigen/Core>

#include <memory>
#include <mutex>
#include <optional>

namespace fielddeform::volume::detail {

using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Volumes, moments and their derivatives by the nodes, evaluated on a mesh. Immutable.
class MeshModel {
 public:
  /// Keeps the basis as a matrix where that is small, else goes by the map's combine() and gather().
  MeshModel(const map::LinearMap& map, const Surface& surface, Rims rims);
  /// A mesh that is not bound to a map itself: its basis as a matrix, #V by N.
  MeshModel(RowMatrix basis, std::vector<Vec3> base, std::vector<Index> triangles, std::vector<Index> region, Rims rims);

  std::size_t nodes() const noexcept { return nodes_; }
  std::size_t triangles() const noexcept { return volume_.triangles().size() / 3; }
  const SurfaceVolume& volume() const noexcept { return volume_; }
  const std::vector<Vec3>& base() const noexcept { return base_; }
  const std::optional<RowMatrix>& basis() const noexcept { return basis_; }  ///< columns padded with zeros to a multiple of 4

  /// How the form of a region is summed; vertices by their place in volume().vertices(region). Made when first asked for.
  const WedgePlan& plan(std::size_t region) const;

  /// base + B d. @param x #V by 3, resized
  void positions(Points d, std::vector<Vec3>& x) const;
  /// B p without the base.
  void combine(Points p, std::vector<Vec3>& out) const;
  /// B^T g. @param out N by 3, overwritten
  void gather(Points g, std::span<Vec3> out) const;
  /// B^T g of values at the vertices of one region alone, in their order.
  void gatherRegion(Points g, std::size_t region, std::span<Vec3> out) const;

 private:
  void combineRows(Points p, const Vec3* base, std::vector<Vec3>& out) const;
  void gatherRows(std::size_t count, const Index* vertex, Points g, std::span<Vec3> out) const;

  const map::LinearMap* map_ = nullptr;
  std::shared_ptr<const map::Binding> binding_;
  std::size_t nodes_ = 0;
  std::vector<Vec3> base_;
  SurfaceVolume volume_;
  std::optional<RowMatrix> basis_;
  struct Plans {
    std::once_flag once;
    std::vector<WedgePlan> regions;
  };
  std::shared_ptr<Plans> plans_ = std::make_shared<Plans>();
};

/// The basis of all bound points as a matrix, columns padded to a multiple of 4.
RowMatrix denseBasis(const map::LinearMap& map, const map::Binding& binding);

/// The surface with its vertices merged by the cells of a grid: a cheap coarse copy for second derivatives. Merging keeps a
/// closed surface closed in the sense of its volume.
/// @param vertices  about so many at least, where the surface has them
MeshModel clustered(const map::LinearMap& map, const Surface& surface, const MeshModel& fine, std::size_t vertices, Rims rims);

}  // namespace fielddeform::volume::detail
