#pragma once

#include <fielddeform/map/pointwise_map.h>
#include <fielddeform/map/skeleton_motion.h>
#include <fielddeform/map/spline_curve.h>

#include <vector>

namespace fielddeform::map {

namespace detail {
struct JetVec;
}

/// Axial deformation: a point keeps its coordinates in the frame at the closest point of an axis.
///   x' = C1(t) + s(t) R(t) (x - C0(t)),   t the parameter of the point of C0 that is closest to x
/// C0, C1 the cubic B-splines through a line's points at rest and posed, R from the rotation-minimising frames of both and
/// the line's roll, s the posed influence radius over the rest one. Beyond the ends space follows the end's frame. Several axes:
/// the mean of the motions as dual quaternions, weighted by exp(-k d / r). Zones of influence: ZonedMap. [Lazarus, Coquillart & Jancene 1994]
class AxialMap final : public PointwiseMap {
 public:
  /// @param sharpness  k, > 0
  /// @throw std::invalid_argument if a primitive is no line or has no length
  explicit AxialMap(const SkeletonMotion& motion, double sharpness = 4);
  ~AxialMap() override;

  Vec3 displacement(const Vec3& rest) const override;
  Mat3 jacobian(const Vec3& rest) const override;

 protected:
  std::vector<double> restKey() const override { return restNumbers_; }
  std::shared_ptr<RestSide> keepRest(Points rest) const override;
  Vec3 displacementOf(const RestSide& side, std::size_t i, const Vec3& rest) const override;

 private:
  struct Axis;
  static void alignSigns(std::vector<Axis>& axes);
  detail::JetVec moveOf(const Vec3& rest, const SplineCurve::Foot* feet = nullptr) const;
  std::shared_ptr<const std::vector<Axis>> axes_;
  std::vector<double> restNumbers_;
  double sharpness_;
  bool identity_;
};

}  // namespace fielddeform::map
