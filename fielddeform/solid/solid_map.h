#pragma once

#include <fielddeform/map/linear_map.h>
#include <fielddeform/solid/object.h>

namespace fielddeform::solid {

/// What is embedded in an object rides in it: free-form deformation by solids of any shape, one in the other. [section 1.2]
/// A point takes its local coordinates in the rest object by a robust inversion and x' = x + sum phi_i(x) d_i, d_i the control points' displacements.
/// Points outside are carried by the nearest solid gone on along its tangents (C1 there), as long as they are within `reach` of it in
/// its own u, v, w; others stay.
/// Statuses: Fixed where the displacement is exactly zero, or out of reach; Invalid; else Converged.
class SolidMap final : public map::LinearMap {
 public:
  /// @param rest    with positive sizes
  /// @param posed   #N by 3: where the rest's points go
  /// @param reach   >= 0
  SolidMap(Object rest, Points posed, double reach = 0.5);

  std::shared_ptr<const map::Binding> bind(Points rest) const override;
  void apply(const map::Binding& binding, map::MapOutput out, Progress& progress) const override;
  void jacobians(const map::Binding& binding, std::span<Mat3> out) const override;
  std::size_t nodeCount() const override;
  Points restNodes() const override;
  Points displacements() const override;
  map::SparseRows basis(const map::Binding& binding) const override;
  void combine(const map::Binding& binding, Points nodeValues, std::span<Vec3> out) const override;
  void gather(const map::Binding& binding, Points pointValues, std::span<Vec3> out) const override;
  std::unique_ptr<map::LinearMap> withDisplacements(Points displacements) const override;

  /// Where a point lies.
  struct Place {
    std::size_t solid = 0;
    Vec3 uvw = Vec3::Zero();
    bool found = false;
    bool inside = false;   ///< within 1e-9 of the cube
  };
  Place locate(const Vec3& x) const;
  static Place place(const map::Binding& binding, std::size_t point);  ///< of a bound point

 private:
  struct Model;
  class Bound;
  const Bound& own(const map::Binding& binding) const;
  std::shared_ptr<const Model> model_;
  std::shared_ptr<const std::vector<Vec3>> displacements_;
};

}  // namespace fielddeform::solid
