#pragma once

#include <fielddeform/field/distance.h>
#include <fielddeform/skeleton/skeleton.h>
#include <fielddeform/spatial/closest_tree.h>

#include <cmath>
#include <memory>
#include <optional>
#include <vector>

namespace fielddeform::field {

/// What the pseudo-distance is where no primitive reaches.
enum class Extension : std::uint8_t {
  Linear,  ///< min over primitives of R d_i / r_i, so that a tracked point finds its way back
  None,    ///< R, without gradient: the clipped field as the paper prints it
};

struct FieldOptions {
  skeleton::Potential potential = skeleton::Potential::Exponential;  ///< for primitives that name none; also the one inverted for the pseudo-distance
  double sharpness = 4;                      ///< k in x = k d / r, dimensionless, 1e-3 to 500
  Extension extension = Extension::Linear;   ///< beyond all radii
  DistanceOptions distance = {};             ///< exact, or what stands in for it where a primitive reaches
  std::optional<double> referenceRadius = {};  ///< R, the unit of D, world; absent: the field's own greatest radius
  void validate() const;                     ///< @throw std::invalid_argument
  /// The same, for a field whose grids share their memory with another's.
  FieldOptions after(const class Field& other) const;
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
/// Only D / R compares between fields of different R.
struct FieldValue {
  double sum = 0;               ///< S = sum_i w_i E_i, clipped at the radii; dimensionless
  double pseudoDistance = 0;    ///< D, extended beyond the radii as the options say
  Vec3 gradient = Vec3::Zero(); ///< dD/dp, dimensionless
  bool inside = false;          ///< S > 0: in the influence region
};

/// Where a point's closest point on one primitive lies, in four bytes: asked again, it needs no search.
class Foot {
 public:
  Foot() = default;  ///< not known
  explicit Foot(const PrimitiveHit& hit) noexcept
      : code_(hit.element == kNoIndex ? kUnknown : hit.element | (std::signbit(hit.distance) ? kInside : 0)) {}
  bool known() const noexcept { return code_ != kUnknown; }
  Index element() const noexcept { return code_ & ~kInside; }
  bool inside() const noexcept { return (code_ & kInside) != 0; }

 private:
  static constexpr std::uint32_t kInside = std::uint32_t{1} << 31, kUnknown = ~std::uint32_t{0};  // elements are fewer than 2^31
  std::uint32_t code_ = kUnknown;
};

/// Kept by a caller who asks for block after block of points; it changes no value.
using SearchHints = std::vector<spatial::ClosestTree::BlockHint>;

/// The scalar field of a skeleton: exact distance to each primitive, potentials, blend, pseudo-distance.
/// Primitives of weight 0 contribute nothing, neither to the sum nor beyond the radii. Where nothing contributes, and
/// at points that are not finite, D is infinite and the gradient zero.
/// Scaling skeleton and point by a power of two scales D by it and changes no other number, bit for bit.
/// Immutable and safe to use from many threads. [Qin et al. 2003, eqs. (1)-(2); formulas and units: docs/field.md]
class Field {
 public:
  /// Grids and radial functions are made here: that takes time and memory.
  /// @param around  points at which the field will be asked: grids that follow a mesh (GridAround::Mesh) have voxels only
  ///        near them, and elsewhere the field is exact. None: wherever the skeleton reaches
  /// @throw std::invalid_argument if the skeleton is invalid, a primitive has neither radius nor radii per point, a
  ///        weight exceeds 1e40, an option is out of range, or the grids would exceed their memory
  /// @throw std::runtime_error if grids are asked of a build without OpenVDB
  explicit Field(const skeleton::Skeleton& skeleton, const FieldOptions& options = {}, Points around = {});
  ~Field();
  Field(Field&&) noexcept;
  Field& operator=(Field&&) noexcept;

  const FieldOptions& options() const noexcept;
  std::size_t primitiveCount() const noexcept;
  double referenceRadius() const noexcept;          ///< R = max over primitives of positive weight and their points, world
  double radius(std::size_t primitive) const;       ///< the primitive's greatest radius, world
  double weight(std::size_t primitive) const;
  Box bounds() const;                               ///< of the points of all primitives, world

  FieldValue evaluate(const Vec3& point) const;
  /// Many points, in parallel; bit for bit as one by one but where a variational distance by r^3 (256 centres and more) meets
  /// 131,072 points and more: its terms then differ by at most 1e-8 of the greatest distance fitted (numeric/rbf.h).
  /// @throw std::invalid_argument if the sizes differ
  void evaluate(Points points, std::span<FieldValue> out) const;
  /// evaluate() of points that lie near one another in their order (a cell's vertices), bit for bit, on the calling thread: they
  /// share the searches. @throw std::invalid_argument if the sizes differ
  /// @param feet  if not empty, #P by #primitives: their closest points, as far as they were looked for
  void evaluateTogether(Points points, std::span<FieldValue> out, SearchHints& hints, std::span<Foot> feet = {}) const;
  /// D of a sum S > 0, as evaluate() computes it: the inverse of the field's own potential, world.
  double pseudoDistanceOf(double sum) const;

  /// What stands behind the distance of primitive i; exact where one grid holds the whole field.
  const DistanceReport& distanceReport(std::size_t primitive) const;
  /// The grid of the whole field (GridOf::Blend), if there is one.
  const std::optional<DistanceReport>& blendReport() const noexcept;
  double gridMegabytes() const noexcept;            ///< of all its grids

  /// Unsigned or signed exact closest point on primitive i, whatever the distance option. A closed mesh contains the points whose winding number is
  /// beyond 1/2 in either sense, so that small holes and an inside-out orientation do no harm.
  /// @param point  finite; for others the hit's element is kNoIndex
  PrimitiveHit closest(std::size_t primitive, const Vec3& point) const;
  /// closest() of points that lie near one another in their order, bit for bit, on the calling thread.
  /// @param points  all finite. @throw std::invalid_argument if the sizes differ
  void closestTogether(std::size_t primitive, Points points, std::span<PrimitiveHit> out, SearchHints& hints) const;
  /// closest() of a point whose foot on primitive i is known, bit for bit. @param foot  of the same point on this field's primitive
  PrimitiveHit closestAt(std::size_t primitive, const Vec3& point, Foot foot) const;
  /// The influence radius of primitive i at a hit: interpolated per-point radius, or the one radius.
  double radiusAt(std::size_t primitive, const PrimitiveHit& hit) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fielddeform::field
