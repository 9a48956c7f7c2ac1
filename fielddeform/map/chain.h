#pragma once

#include <fielddeform/map/space_map.h>

#include <vector>

namespace fielddeform::map {

/// Maps one after the other: x -> f_n(... f_2(f_1(x))). Binding deforms by all maps but the last.
/// Statuses: Invalid where a map says so, Fixed where all do, else that of the last map that moved the point; residuals
/// are the greatest of all.
class Chain final : public SpaceMap {
 public:
  /// @throw std::invalid_argument if there are none, or one is null
  explicit Chain(std::vector<std::shared_ptr<const SpaceMap>> maps);

  std::shared_ptr<const Binding> bind(Points rest) const override;
  void apply(const Binding& binding, MapOutput out, Progress& progress) const override;
  void jacobians(const Binding& binding, std::span<Mat3> out) const override;

 private:
  class Bound;
  const Bound& own(const Binding& binding) const;
  std::vector<std::shared_ptr<const SpaceMap>> maps_;
};

}  // namespace fielddeform::map
