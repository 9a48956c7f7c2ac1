#pragma once

#include <fielddeform/field/field.h>
#include <fielddeform/spatial/closest_tree.h>
#include <fielddeform/spatial/winding.h>

#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

namespace fielddeform::field::detail {

/// What a caller that walks from point to point knows; it changes no answer.
struct ClosestHint {
  Index element = kNoIndex;         ///< probably near
  std::optional<bool> inside = {};  ///< surely
};

/// A ball without surface: all of it on one side.
struct SignedBall {
  Vec3 centre = Vec3::Zero();
  double clear = 0;                 ///< radius
  bool inside = false;
};

/// Exact distance to one primitive, its sign, and its radius at the closest point.
class PrimitiveDistance {
 public:
  /// @throw std::invalid_argument without a radius, or for a mesh without a triangle
  explicit PrimitiveDistance(const skeleton::Primitive& primitive);

  bool isSigned() const noexcept { return winding_.has_value(); }
  double greatestRadius() const noexcept { return greatestRadius_; }

  double leastRadius() const noexcept { return leastRadius_; }
  bool hasPointRadius() const noexcept { return !pointRadius_.empty(); }
  bool isWatertight() const noexcept { return watertight_; }  ///< signed, and every edge has its opposite: the sign changes at the surface alone
  const Box& bounds() const noexcept { return box_; }         ///< of the points, world

  /// Nothing if the point is not finite, or farther than the bound. Signed primitives know no bound, as their inside
  /// counts at any depth, unless the hint names the side.
  std::optional<PrimitiveHit> closest(const Vec3& point, double maxDistance = std::numeric_limits<double>::infinity(),
                                      const ClosestHint& hint = {}) const;

  /// closest() of points that lie near one another in their order, bit for bit; where that finds nothing, the element
  /// is kNoIndex. Spans of one size.
  void closestTogether(Points points, double maxDistance, std::span<PrimitiveHit> out, spatial::ClosestTree::BlockHint& hint) const;
  /// The same, but the bound holds for signed primitives too, on both sides.
  void closestWithin(Points points, double bound, std::span<PrimitiveHit> out, spatial::ClosestTree::BlockHint& hint) const;
  static constexpr std::size_t kTogether = 64;  ///< points whose signs are found together, at most
  /// The side of points that lie near one another, of a signed primitive.
  /// @param distance  of each, exact and unsigned; negative: not asked
  /// @param known     kept from call to call; it changes no answer
  void signsOf(Points points, std::span<const double> distance, std::span<bool> inside, SignedBall& known) const;
  /// Whether the primitive comes so near to a point: unsigned.
  bool reaches(const Vec3& point, double distance) const;

  int corners() const noexcept { return corners_; }                                           ///< of an element: 1, 2 or 3
  const std::vector<Vec3>& points() const noexcept { return points_; }
  const std::vector<std::array<Index, 3>>& elements() const noexcept { return elements_; }  ///< unused corners kNoIndex

  double radiusAt(const PrimitiveHit& hit) const { return radiusAt(hit.element, hit.weight); }
  double radiusAt(Index element, const Vec3& weight) const;
  /// closest() without a bound of a point whose nearest element is known, and whether it is inside.
  PrimitiveHit closestOn(Index element, bool inside, const Vec3& point) const { return hitOf(tree_->closestOn(element, point), inside); }
  /// Derivative of f(p) = distance / radius(closest point) by p. With a radius per point:
  /// n / r - (d / r^2) grad r, where r follows the closest point along its segment or in its triangle.
  Vec3 relativeGradient(const PrimitiveHit& hit, double radius) const;

 private:
  Vec3 radiusGradient(const PrimitiveHit& hit) const;
  PrimitiveHit hitOf(const spatial::ClosestPoint& c, bool inside) const;
  bool contains(const Vec3& point) const { return box_.contains(point) && std::abs(winding_->at(point)) > 0.5; }
  Vec3 signedDirection(const spatial::ClosestPoint& c, bool inside) const;

  int corners_;                                  // per element
  std::vector<Vec3> points_;
  std::vector<std::array<Index, 3>> elements_;   // unused corners kNoIndex
  std::vector<double> pointRadius_;              // empty: one radius
  double greatestRadius_;
  std::optional<spatial::ClosestTree> tree_;
  std::optional<spatial::WindingNumber> winding_;
  Box box_;                                      // of the points; nothing beyond it is inside a closed mesh
  double leastRadius_;
  bool watertight_ = false;
  double orientation_ = 1;                       // -1: the closed mesh is inside out
};

}  // namespace fielddeform::field::detail
