#pragma once

#include <fielddeform/gffd/detail/local_motion.h>
#include <fielddeform/gffd/detail/mls_kernel.h>
#include <fielddeform/skeleton/frames.h>

#include <vector>

namespace fielddeform::gffd::detail {

/// Moving least squares of rigid motions over the samples of a skeleton, with their frames. [Schaefer et al. 2006 for
/// the rigid fit; weights and frames: docs/tracking.md]
///   w_j ~ a_j exp(-8 |P - p_j| / r_j);   R = Kabsch(C + 0.3 |C| sum w R_j^T);   P -> q* + sum w s_j R (P - p*)
/// with s_j the posed influence radius over the rest one.
class MlsPredictor {
 public:
  explicit MlsPredictor(const skeleton::SampledPair& samples);
  /// The motion near `point` (world).
  LocalMotion at(const Vec3& point) const;
  /// The motions near a block of points: the same mathematics, to rounding; the two differ by some 1e-13 of displacement and
  /// radius where the rotation is well determined. A point's motion does not depend on which points share its block.
  /// @param count  1 to kLanes
  void at(const Block& points, std::size_t count, MlsBlock& out) const;

 private:
  struct Sample {
    Vec3 rest, move;   // q - p
    double mass, inverseRadius, scale;
    Mat3 rotation;
  };
  struct Ball {  // of neighbouring samples
    Vec3 centre;
    double radius, inverseRadiusMax, inverseRadiusMin;
    Index begin, end;
  };
  std::vector<Sample> samples_;
  std::vector<Ball> balls_;
  std::vector<MlsTerm> terms_;  // the samples again, for blocks
};

}  // namespace fielddeform::gffd::detail
