#pragma once

#include <fielddeform/volume/detail/prepared.h>

namespace fielddeform::volume::detail {

/// Looks for directions of descent at stationary points, by the second derivatives of a coarse copy of the surface: a few hundred
/// triangles tell them well enough, and no mesh is evaluated.
class SaddleTest {
 public:
  /// @param start  N by 3: pinned nodes stand here
  SaddleTest(const Prepared::Impl& impl, Points start);
  /// A unit direction of the free variables, or none. @param multiplier  of the constraints at x
  std::optional<Eigen::VectorXd> direction(const Core& core, const Eigen::VectorXd& x, const Eigen::VectorXd& multiplier);

 private:
  void prepare();

  const Prepared::Impl& impl_;
  std::vector<Vec3> start_;
  std::optional<MeshModel> own_;
  std::unique_ptr<NodeConstraints> constraints_;
};

/// The coarsest level of at least so many triangles, and of at most half of the surface's; else none.
const MeshModel* coarseLevel(const Prepared::Impl& impl, std::size_t least, std::size_t& level);
/// Volumes of a model's regions in the same proportion to its own as the surface's targets are to the surface's.
/// @param faithful  set to false if a region's volume is not near that of the surface
std::vector<VolumeTarget> coarseTargets(const Prepared::Impl& impl, const std::vector<double>& base, bool& faithful);

}  // namespace fielddeform::volume::detail
