#pragma once

#include <fielddeform/map/space_map.h>

#include <vector>

namespace fielddeform::map {

/// A sparse matrix by rows (CSR): row r has the entries start[r] .. start[r+1]-1, columns ascending.
struct SparseRows {
  std::size_t columns = 0;
  std::vector<std::size_t> start{0};  ///< #R+1
  std::vector<Index> column;
  std::vector<double> value;

  std::size_t rows() const noexcept { return start.size() - 1; }
};

/// A map whose displacement is linear in its nodes: x' = x + sum_i phi_i(x) d_i, with node displacements d_i (world).
/// Lattices, B-spline lattices, solids. Direct manipulation and the volume pass need nothing else of a map: they solve
/// for the displacements. The basis phi depends on the point and the rest nodes only, so bindings serve every
/// withDisplacements() of a map.
class LinearMap : public SpaceMap {
 public:
  virtual std::size_t nodeCount() const = 0;  ///< #N
  /// #N by 3, world: where the nodes stand when nothing is deformed.
  virtual Points restNodes() const = 0;
  /// #N by 3, world: how far the nodes were moved from there.
  virtual Points displacements() const = 0;

  /// bind() of points that outlive the binding and do not move: the same bits from it, without memory a point where the map can
  /// find a point's places again at little cost (lattices). By default bind().
  virtual std::shared_ptr<const Binding> bindView(Points rest) const { return bind(rest); }

  /// phi_i of every bound point: #P rows, #N columns, entries that are exactly 0 left out. Memory: 12 bytes an entry; meant
  /// for few points (targets) or few nodes; combine() and gather() need no matrix.
  virtual SparseRows basis(const Binding& binding) const = 0;

  /// The same rows of some bound points alone, in their order: #points rows. By default picked from basis(), which has all.
  /// @param points below the binding's size
  virtual SparseRows basisAt(const Binding& binding, std::span<const Index> points) const;

  /// out_p = sum_i phi_i(p) nodeValues_i: B v.
  /// @param nodeValues #N by 3    @param out #P by 3, overwritten
  virtual void combine(const Binding& binding, Points nodeValues, std::span<Vec3> out) const = 0;
  /// out_i = sum_p phi_i(p) pointValues_p: B^T v, added in a fixed order (the same bits on any number of threads).
  /// @param pointValues #P by 3    @param out #N by 3, overwritten
  virtual void gather(const Binding& binding, Points pointValues, std::span<Vec3> out) const = 0;

  /// The same basis, other node displacements; bindings stay valid.
  /// @param displacements #N by 3, world, finite
  virtual std::unique_ptr<LinearMap> withDisplacements(Points displacements) const = 0;
};

}  // namespace fielddeform::map
