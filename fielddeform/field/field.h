#pragma once

#include <fielddeform/skeleton/skeleton.h>

#include <memory>

namespace fielddeform::field {

struct FieldOptions {
  skeleton::Potential potential = skeleton::Potential::Exponential;  ///< for primitives that name none; also the one inverted for the pseudo-distance
  double sharpness = 4;  ///< k in x = k d / r, dimensionless, > 0
  void validate() const;
};

/// Closest point on one primitive.
struct PrimitiveHit {
  Vec3 point;            ///< world
  double distance;       ///< world; negative inside a closed mesh
  Vec3 direction;        ///< unit gradient of the distance (away from the primitive; outward inside a closed mesh); zero if on it and undetermined
  Index element;         ///< point, segment (i: points i, i+1) or triangle (of the fans, in face order)
  Index vertex[3];       ///< the element's points within the primitive (points: 1, segments: 2, triangles: 3; others kNoIndex)
  Vec3 weight;           ///< barycentric weights of `point` on them; sum 1
};

/// Blended field at a point. D is in world units: the distance, were there one primitive with radius R.
struct FieldValue {
  double sum = 0;               ///< S = sum_i w_i E_i, clipped at the radii; dimensionless
  double pseudoDistance = 0;    ///< D, extended beyond the radii
  Vec3 gradient = Vec3::Zero(); ///< dD/dp, dimensionless
  bool inside = false;          ///< S > 0: in the influence region
};

/// The scalar field of a skeleton: exact distance to each primitive, potentials, blend, pseudo-distance.
/// Immutable and safe to use from many threads. [Qin et al. 2003, eqs. (1)-(2); units: docs/field.md]
class Field {
 public:
  /// @throw std::invalid_argument if a primitive has no radius yet, or the skeleton is invalid
  Field(const skeleton::Skeleton& skeleton, const FieldOptions& options);
  ~Field();
  Field(Field&&) noexcept;
  Field& operator=(Field&&) noexcept;

  std::size_t primitiveCount() const noexcept;
  double referenceRadius() const noexcept;          ///< R = max over primitives and their points, world
  double radius(std::size_t primitive) const;       ///< the primitive's greatest radius, world

  FieldValue evaluate(const Vec3& point) const;
  /// Unsigned or signed exact closest point on primitive i; NaN-safe only for finite points.
  PrimitiveHit closest(std::size_t primitive, const Vec3& point) const;
  /// The influence radius of primitive i at a hit: interpolated per-point radius, or the one radius.
  double radiusAt(std::size_t primitive, const PrimitiveHit& hit) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fielddeform::field
