#pragma once

#include <fielddeform/skeleton/skeleton.h>

namespace fielddeform::skeleton {

/// Where an object's bulk lies, in the form that the axis rules look at.
struct Bulk {
  Vec3 centre = Vec3::Zero();      ///< centroid, world
  Mat3 covariance = Mat3::Zero();  ///< mean of (x - centre)(x - centre)^T, world units squared
  Box box;                         ///< of all points
};

/// The bulk of some primitives: by length if there are polylines (over these alone), else by area if there are meshes,
/// else (or where there is no length or area) of the points, equally weighted.
/// @throw std::invalid_argument if there are no points
Bulk bulkOf(std::span<const Primitive* const> primitives);

/// The axis "auto": the largest eigenvector of the covariance; if the second eigenvalue is within 1 % of the largest, the
/// coordinate axis of the longest side of the box (sides within 1 %: x before y before z). The component of largest
/// magnitude (within 1 %: the first) is positive, so that like objects are edited alike. Unit length.
Vec3 autoAxis(const Bulk& bulk);

/// The default axis that a bend turns about: the direction of largest variance across `axis`, same rules of tie and
/// sign (a coordinate axis is taken across `axis`). For axis = autoAxis this is the second eigenvector.
/// @param axis unit length
Vec3 autoAbout(const Bulk& bulk, const Vec3& axis);

}  // namespace fielddeform::skeleton
