#pragma once

#include <fielddeform/field/field.h>
#include <fielddeform/map/space_map.h>

namespace fielddeform::map {

/// Another map confined to the influence region of a field, as GFFD is: x' = x + w (f(x) - x), with
///   w = smoothstep(s / band), s = 1 - D / R inside the region, 0 outside; band 0: 1 inside, 0 outside.
/// Axial deformation's zone of influence [Lazarus et al. 1994]: the inner zone is where s >= band.
/// Statuses as the other map's; Fixed (bit for bit) where w = 0.
class ZonedMap final : public SpaceMap {
 public:
  /// @param map, field  not null    @param band  in [0, 1], share of the radius over which the displacement dies out
  /// @throw std::invalid_argument
  ZonedMap(std::shared_ptr<const SpaceMap> map, std::shared_ptr<const field::Field> field, double band);

  std::shared_ptr<const Binding> bind(Points rest) const override;
  /// Keeps w, too, for maps confined by the same field object and band.
  std::shared_ptr<const Binding> bindAgain(const Binding* earlier, Points rest) const override;
  void apply(const Binding& binding, MapOutput out, Progress& progress) const override;
  void jacobians(const Binding& binding, std::span<Mat3> out) const override;
  /// w of every bound point, in [0, 1].
  std::vector<double> weights(const Binding& binding) const;

 private:
  struct Bound;
  const Bound& own(const Binding& binding) const;
  std::shared_ptr<const Binding> bound(Points rest, std::shared_ptr<const Binding> inner) const;
  std::shared_ptr<const SpaceMap> map_;
  std::shared_ptr<const field::Field> field_;
  double band_;
};

}  // namespace fielddeform::map
