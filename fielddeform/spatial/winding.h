#pragma once

#include <fielddeform/core/types.h>

#include <array>
#include <memory>

namespace fielddeform::spatial {

/// Generalised winding number of a triangle soup: 1 inside a closed, outward oriented surface, 0 outside, between them
/// near gaps; so "inside" survives small holes, slits and overlaps. Near triangles are summed exactly, far groups by
/// their dipole. [Jacobson et al. 2013; Barill et al. 2018, first order, beta = 2]
/// Error below about 0.1 (exact near the surface); on the surface any value between. Immutable and safe to use from many threads; the same bits on
/// every machine; scaling mesh and query by a power of two changes none.
class WindingNumber {
 public:
  /// @param points  #P by 3, world; triangles: indices into it
  /// @throw std::invalid_argument for an index out of range or a point that is not finite
  WindingNumber(Points points, std::span<const std::array<Index, 3>> triangles);
  ~WindingNumber();
  WindingNumber(WindingNumber&&) noexcept;
  WindingNumber& operator=(WindingNumber&&) noexcept;

  double at(const Vec3& query) const;       ///< 0 for a query that is not finite
  double exactAt(const Vec3& query) const;  ///< sum over all triangles: the reference

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fielddeform::spatial
