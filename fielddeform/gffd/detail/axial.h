#pragma once

#include <fielddeform/field/field.h>
#include <fielddeform/gffd/detail/local_motion.h>
#include <fielddeform/skeleton/frames.h>

#include <memory>
#include <vector>

namespace fielddeform::gffd::detail {

/// Closest-frame prediction: the foot of the point on a primitive carries the point with its frame, at a distance that grows
/// with the influence radius there; several primitives
/// are blended with exp(-4 d_i / r_i) as dual quaternions. [Lazarus et al. 1994, for any primitive]
class AxialPredictor {
 public:
  /// @param field  of the rest primitives that `samples` samples, in the same order
  AxialPredictor(std::shared_ptr<const field::Field> field, const skeleton::SampledPair& samples);
  LocalMotion at(const Vec3& point) const;
  /// at() of points that lie near one another in their order, all finite, bit for bit; they share the searches.
  struct Searches {
    field::SearchHints hints;
    std::vector<field::PrimitiveHit> hits;
  };
  void at(Points points, std::span<LocalMotion> out, Searches& searches) const;
  /// at() of a point with its feet on the primitives, bit for bit. @param feet  as field::Field::closestAt()
  LocalMotion at(const Vec3& point, std::span<const field::Foot> feet) const;
  /// min_i |d_i| / r_i: how near the skeleton is, in radii.
  double nearness(const Vec3& point) const;

 private:
  struct Frame {
    Vec3 rest, move;
    Quat rotation;
    double scale;
  };
  // From the closest points on the primitives, `stride` apart.
  LocalMotion from(const Vec3& point, const field::PrimitiveHit* hits, std::size_t stride) const;
  Frame frameAt(std::size_t primitive, const field::PrimitiveHit& hit) const;

  std::shared_ptr<const field::Field> field_;
  skeleton::SampleSet set_;
  std::vector<Frame> frames_;  // one a sample
};

}  // namespace fielddeform::gffd::detail
