#pragma once

#include <fielddeform/map/space_map.h>

#include <memory>
#include <vector>

namespace fielddeform::map {

/// What a map keeps of points for other poses of the same rest side.
struct RestSide {
  virtual ~RestSide() = default;
  std::vector<double> key;  ///< the numbers of the rest side that it was made from
  std::size_t size = 0;     ///< #P
};

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
  std::shared_ptr<const Binding> bindAgain(const Binding* earlier, Points rest) const override;
  void apply(const Binding& binding, MapOutput out, Progress& progress) const override;
  void jacobians(const Binding& binding, std::span<Mat3> out) const override;

 protected:
  PointwiseMap();
  /// The numbers that keepRest() depends on: equal for maps that may share what it keeps.
  virtual std::vector<double> restKey() const { return {}; }
  /// The expensive half of displacement() for all points; null where there is none. Non-finite points are skipped.
  virtual std::shared_ptr<RestSide> keepRest(Points) const { return nullptr; }
  /// displacement(), bit for bit, of point i of the rest side that this map, or one of the same key, kept.
  virtual Vec3 displacementOf(const RestSide&, std::size_t, const Vec3& rest) const { return displacement(rest); }

 private:
  struct Bound;
  std::shared_ptr<const Binding> boundBy(Points rest, std::shared_ptr<const RestSide> side) const;
  const Bound& own(const Binding& binding) const;
  std::shared_ptr<const char> token_;  // whose bindings fit
};

}  // namespace fielddeform::map
