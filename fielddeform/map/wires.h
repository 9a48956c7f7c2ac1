#pragma once

#include <fielddeform/map/pointwise_map.h>
#include <fielddeform/map/skeleton_motion.h>
#include <fielddeform/map/spline_curve.h>

#include <optional>
#include <vector>

namespace fielddeform::map {

namespace detail {
struct JetVec;
}

struct WireOptions {
  /// How several wires share a point, m >= 0: x' = x + sum D_i |D_i|^m / sum |D_i|^m, so that wires that say the same say it
  /// once; greater m favour the greater displacement. Absent: the sum of all D_i.
  std::optional<double> blend = 1;
  /// Local influence, k >= 0: shares are weighted by F_i^k, too, so that the wire that is nearest in its own radii has its way;
  /// beside a sum it says nothing.
  double local = 0;

  void validate() const;  ///< @throw std::invalid_argument
};

/// Wires: curves that carry what is near them. With R the curve at rest, W posed, p = R(t) the closest point to x,
/// F = f(|x - p| / r), f(u) = (1 - u^2)^2 for u < 1, else 0:
///   1. scale   x1 = x + (s - 1) F (x - p)
///   2. turn    by F times the rotation from R' to W', about p; then by F times the twist, about W'
///   3. move    by F (W(t) - R(t))
/// s is the posed influence radius over the rest one, the twist the line's roll, r the line's radius at t.
/// A line named "NAME.domain" bounds the wire "NAME" on its side: towards it the radius is the distance from the wire to it,
/// r on the other side, between them r + (distance - r) cos^2. [Singh & Fiume 1998; the cosine is ours: the paper's text has a
/// function of the angle, and not which]
/// Beyond all radii space stays, bit for bit. Tangents turned by half a circle have no axis: nothing is turned there.
class WireMap final : public PointwiseMap {
 public:
  /// @throw std::invalid_argument if a primitive is no line, has no length, or is the domain of no wire
  explicit WireMap(const SkeletonMotion& motion, const WireOptions& options = {});
  ~WireMap() override;

  std::size_t wireCount() const noexcept;
  /// D_i at one point: what wire i alone does.
  Vec3 displacementBy(std::size_t wire, const Vec3& rest) const;

  Vec3 displacement(const Vec3& rest) const override;
  Mat3 jacobian(const Vec3& rest) const override;

 protected:
  std::vector<double> restKey() const override { return restNumbers_; }
  std::shared_ptr<RestSide> keepRest(Points rest) const override;
  Vec3 displacementOf(const RestSide& side, std::size_t i, const Vec3& rest) const override;

 private:
  struct Wire;
  detail::JetVec moveOf(const Vec3& rest, const SplineCurve::Foot* feet = nullptr) const;
  std::shared_ptr<const std::vector<Wire>> wires_;
  std::vector<double> restNumbers_;
  WireOptions options_;
  bool identity_;
};

}  // namespace fielddeform::map
