#pragma once

#include <fielddeform/field/detail/grid_common.h>
#include <fielddeform/field/detail/primitive_distance.h>
#include <fielddeform/field/distance.h>

#include <memory>
#include <optional>

namespace fielddeform::field::detail {

/// A primitive's distance in units of its radius at the closest point: f = d / r, and its gradient by p.
struct Relative {
  double value;
  Vec3 gradient;
};

/// Stands in for the exact distance where it can. Immutable and safe to use from many threads.
class DistanceSource {
 public:
  virtual ~DistanceSource() = default;
  /// Nothing: the exact distance is to be taken here.
  virtual std::optional<Relative> at(const Vec3& point) const = 0;
  /// Whether at() of so many points is quicker together.
  virtual bool togetherIsQuicker(std::size_t) const { return false; }
  /// at() of many finite points, in parallel, where that is quicker: equal to within what the source says.
  virtual void atMany(Points points, std::span<std::optional<Relative>> out) const {
    for (std::size_t i = 0; i < points.size(); ++i) out[i] = at(points[i]);
  }
};

inline Relative exactRelative(const PrimitiveDistance& distance, const PrimitiveHit& hit) {
  const double r = distance.radiusAt(hit);
  return {hit.distance / r, distance.relativeGradient(hit, r)};
}

/// (1 - w(s)) a + w(s) b with w the smooth step of s = from 0 to 1, and its gradient. @param ds  gradient of s
Relative mix(const Relative& a, const Relative& b, double s, const Vec3& ds);

/// Samples a primitive's distance in a grid.
/// @param around  keep only voxels near these points; none: wherever the primitive reaches
/// @param budget  what the grid may take; reduced by what it took
/// @throw std::invalid_argument if it would take more; std::runtime_error in a build without OpenVDB
std::unique_ptr<DistanceSource> makeGridDistance(const PrimitiveDistance& distance, const std::string& name,
                                                 const GridOptions& options, Points around, GridBudget& budget,
                                                 DistanceReport& report);

/// Fits radial functions to samples of a primitive's distance.
std::unique_ptr<DistanceSource> makeVariationalDistance(const PrimitiveDistance& distance, const skeleton::Primitive& primitive,
                                                        const VariationalOptions& options, DistanceReport& report);

}  // namespace fielddeform::field::detail
