#pragma once

#include <fielddeform/map/casteljau.h>
#include <fielddeform/map/skeleton_motion.h>

#include <memory>
#include <vector>

namespace fielddeform::map {

/// The de Casteljau map along one line of a skeleton: cubic pieces through its points at rest and posed, handles by the frames, roll and
/// radii of the motion (curvesAlong). Points that coincide count once; a closed line gives a closed curve, joined C1.
/// @throw std::invalid_argument if the primitive is no line with a length
CasteljauMap casteljauAlong(const SkeletonMotion& motion, Index primitive = 0);

/// Several lines: the mean of what each does to a point, weighted by exp(-k d / r), d the distance to the line's spline at rest and r
/// the influence radius there, as in axial deformation. Lines whose cross planes do not reach the point have no say. Exact
/// for rigid motions of the whole skeleton. The blend is ours: the paper has one curve.
class CasteljauLines final : public SpaceMap {
 public:
  /// @param sharpness  k, > 0
  /// @throw std::invalid_argument if a primitive is no line, or has no length
  explicit CasteljauLines(const SkeletonMotion& motion, double sharpness = 4);
  ~CasteljauLines() override;

  std::shared_ptr<const Binding> bind(Points rest) const override;
  std::shared_ptr<const Binding> bindAgain(const Binding* earlier, Points rest) const override;
  /// Statuses as CasteljauMap's; Stalled where no line reaches, with the least distance.
  void apply(const Binding& binding, MapOutput out, Progress& progress) const override;
  void jacobians(const Binding& binding, std::span<Mat3> out) const override;

 private:
  struct Line;
  class Bound;
  struct Images;
  const Bound& own(const Binding& binding) const;
  Images imagesOf(const Bound& bound, Progress& progress) const;
  std::shared_ptr<const std::vector<Line>> lines_;
  std::vector<double> restNumbers_;  // of the lines: what distances to them depend on
  double sharpness_;
};

/// The map of a skeleton of any number of lines.
std::shared_ptr<const SpaceMap> casteljauBy(const SkeletonMotion& motion);

}  // namespace fielddeform::map
