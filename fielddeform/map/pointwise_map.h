#pragma once

#include <fielddeform/map/space_map.h>

#include <memory>

namespace fielddeform::map {

/// A map that is a formula of one point: what Barr, axial deformation, wires and skinning share.
/// Statuses: Fixed where the displacement is exactly zero (the input bit for bit); Invalid for points that are not finite
/// or whose image is not (they stay); else Converged. Residuals 0. A binding holds the displacements, so applying is
/// cheap; it fits this map and its copies.
class PointwiseMap : public SpaceMap {
 public:
  /// @param rest world, finite    @return world, what is added to `rest`
  virtual Vec3 displacement(const Vec3& rest) const = 0;
  /// Derivative of the deformed position by the rest position, row = output coordinate.
  virtual Mat3 jacobian(const Vec3& rest) const = 0;
  Vec3 position(const Vec3& rest) const;

  std::shared_ptr<const Binding> bind(Points rest) const override;
  void apply(const Binding& binding, MapOutput out, Progress& progress) const override;
  void jacobians(const Binding& binding, std::span<Mat3> out) const override;

 protected:
  PointwiseMap();

 private:
  struct Bound;
  const Bound& own(const Binding& binding) const;
  std::shared_ptr<const char> token_;  // whose bindings fit
};

}  // namespace fielddeform::map
