#pragma once

#include <fielddeform/field/detail/primitive_distance.h>

#include <vector>

namespace fielddeform::field::detail {

/// Where a distance is sampled, and what it is there.
struct Stencil {
  std::vector<Vec3> points;
  std::vector<double> values;  ///< d / r times the primitive's greatest radius, world
};

/// Points on the primitive (value 0), and on surfaces around it from 1.2 radii down to 0.1, as many of these as fit: shells
/// around points, tubes with round ends around curves, both sides and the rim of patches, outside and inside of solids.
/// Points of a surface stand a share of its offset apart, and so do the surfaces: half of it (1.2, 0.6, 0.3, 0.15), or what
/// `most` allows; down to 0.08 of it if more than 2000 are allowed.
Stencil sampleDistance(const PrimitiveDistance& distance, const skeleton::Primitive& primitive, std::size_t most);

}  // namespace fielddeform::field::detail
