#pragma once

#include <fielddeform/core/rigid.h>
#include <fielddeform/map/space_map.h>
#include <fielddeform/numeric/rbf.h>

namespace fielddeform::map {

/// What of the centres' motion is taken out before the interpolation, and added everywhere.
enum class RigidPart : std::uint8_t {
  BestRotation,  ///< the best rigid motion of the centres: decides what flat or straight sets of centres leave open, so
                 ///< that rigid motions are exact for them too; no difference for other sets
  None,          ///< the interpolant alone: no change across a plane or a line of centres
};

struct RbfWarpOptions {
  double time = 1;                                  ///< t: 0 the identity, 1 the posed centres, dimensionless
  double smoothing = 0;                             ///< >= 0, dimensionless; 0 meets the centres
  RigidPart rigidPart = RigidPart::BestRotation;
  std::size_t maxCentres = 100000;                  ///< more are refused; above 2000 the interpolant has compact support
  double tolerance = 1e-6;                          ///< above 2000 centres: greatest miss, of the centres' size, > 0
};

/// The warp of corresponding points, [Qin et al. 2003, eqs. (4)-(6)]: W(P_j0, 0) = P_j0, W(P_j0, 1) = P_j1, as
///   W(X, t) = X + t (M X - X + U(X)),
/// M the best rigid motion of the centres and U the interpolant of what it leaves: triharmonic up to 2000 centres, above
/// that of compact support, coarse to fine (numeric/compact_rbf.h). Linear in time (the paper
/// leaves that open), so W(X, 0) = X bit for bit and the eq. (6) direction is that of W(X, 1) - X.
/// Statuses: Fixed where nothing is edited or t = 0, Invalid for points that are not finite, else Converged; residuals 0.
class RbfWarp final : public SpaceMap {
 public:
  /// @param rest, posed  #C by 3, world; centre pairs, 1 to maxCentres
  /// @throw std::invalid_argument if the sizes differ, there are none or too many, a number is not finite, or an option
  ///        is out of range
  RbfWarp(Points rest, Points posed, const RbfWarpOptions& options = {});

  /// The same warp at another time; shares the solved system, and bindings fit both.
  RbfWarp atTime(double time) const;
  double time() const noexcept { return time_; }
  /// How the interpolant was solved; all zero if the motion is rigid and there was nothing to solve.
  const numeric::RbfReport& report() const noexcept;

  Vec3 position(const Vec3& rest) const;  ///< W(rest, t)
  Mat3 jacobian(const Vec3& rest) const;  ///< dW / drest, row = output coordinate

  std::shared_ptr<const Binding> bind(Points rest) const override;
  void apply(const Binding& binding, MapOutput out, Progress& progress) const override;
  void jacobians(const Binding& binding, std::span<Mat3> out) const override;

 private:
  struct Model;
  class Bound;
  std::shared_ptr<const Model> model_;
  double time_;
};

}  // namespace fielddeform::map
