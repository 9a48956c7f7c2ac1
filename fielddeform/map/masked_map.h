#pragma once

#include <fielddeform/map/linear_map.h>

#include <functional>
#include <vector>

namespace fielddeform::map {

/// Another linear map held back by a factor at every bound point: x' = x + m(x) sum_i phi_i(x) d_i. A point of mask 0 comes
/// back bit for bit; a mask that falls smoothly to 0 keeps a local deformation local where no node could be pinned (a finger
/// beside others has none of its own). The mask is part of a binding, so one map serves any points and masks.
/// Optionally with some of the other map's nodes alone: those left out stay undisplaced.
class MaskedMap final : public LinearMap {
 public:
  /// @param map    shared, kept; its own displacements are this map's at the start
  /// @param nodes  indices into its nodes, ascending, each once; empty: all of them
  /// @throw std::invalid_argument if map is null or a node is out of range or order
  explicit MaskedMap(std::shared_ptr<const LinearMap> map, std::vector<Index> nodes = {});

  /// Binds points with their masks.
  /// @param mask #P, finite
  /// @throw std::invalid_argument if the counts differ or a number is not finite
  std::shared_ptr<const Binding> bind(Points rest, std::span<const double> mask) const;
  /// The same of points and masks that outlive the binding and do not change. @param mask #P, finite, 0 where a point is not finite
  std::shared_ptr<const Binding> bindView(Points rest, std::span<const double> mask) const;
  using LinearMap::bindView;
  /// With mask 1 everywhere.
  std::shared_ptr<const Binding> bind(Points rest) const override;

  /// Status Fixed (and the very bits) for mask 0, Invalid for points that are not finite, else Converged; residuals 0.
  void apply(const Binding& binding, MapOutput out, Progress& progress) const override;
  /// At constant mask: how the mask varies between the points is not known.
  void jacobians(const Binding& binding, std::span<Mat3> out) const override;

  std::size_t nodeCount() const override { return restNodes_->size(); }
  Points restNodes() const override { return *restNodes_; }
  Points displacements() const override { return displacements_; }
  SparseRows basis(const Binding& binding) const override;
  SparseRows basisAt(const Binding& binding, std::span<const Index> points) const override;
  void combine(const Binding& binding, Points nodeValues, std::span<Vec3> out) const override;
  void gather(const Binding& binding, Points pointValues, std::span<Vec3> out) const override;
  std::unique_ptr<LinearMap> withDisplacements(Points displacements) const override;

 private:
  struct Bound;
  const Bound& own(const Binding& binding) const;
  std::vector<Vec3> spread(Points nodeValues) const;
  SparseRows masked(const SparseRows& inner, const std::function<double(std::size_t)>& mask) const;

  std::shared_ptr<const LinearMap> map_;
  std::shared_ptr<const std::vector<Index>> nodes_;  // null: all
  std::shared_ptr<const std::vector<Vec3>> restNodes_;
  std::vector<Vec3> displacements_;
};

}  // namespace fielddeform::map
