#pragma once

#include <fielddeform/map/skeleton_motion.h>

#include <Eigen/Core>
#include <vector>

/// What the fits of Barr's deformations begin with.
namespace fielddeform::map::detail {

/// The points of a motion that a fit is to meet, and how they lie.
struct BarrProblem {
  PointPairs pairs;
  double size = 1;               ///< diagonal of the rest points' box, > 0
  Vec3 centre = Vec3::Zero();    ///< mean of the skeleton's own rest points
  Mat3 axes = Mat3::Identity();  ///< orthonormal columns, by growing spread of those points about the centre
};

/// @param most  pairs, about
BarrProblem barrProblem(const SkeletonMotion& motion, std::size_t most);

/// How a skeleton turns, grows and stretches along one axis: means over slices.
struct Profile {
  std::vector<double> s, turnAlong, turnAcross, scale, length;  ///< cumulative from the first slice
  Vec3 turn = Vec3::Zero();                                     ///< total, rest frame
  /// The turn across the axis as a bend that came after the twist does it, cumulative along its total direction.
  std::vector<double> bend;
  Vec3 bendTotal = Vec3::Zero();
};

Profile profileAlong(const SkeletonMotion& motion, const Vec3& centre, const Vec3& axis);

/// Where a cumulative profile goes from its first to its last value: the line through its tenths.
void rangeOf(const std::vector<double>& s, const std::vector<double>& value, double& begin, double& end);

/// The best rigid motion behind images of the pairs' rest points: posed ~ pivot + shift + turn image.
struct RigidFit {
  Quat turn = Quat::Identity();
  Vec3 shift = Vec3::Zero();
  double cost = 0;  ///< weighted sum of squares
};
/// @param image     #C, from the pivot
/// @param residual  if given, 3 a pair, weighted
RigidFit fitRigid(const PointPairs& pairs, const std::vector<Vec3>& image, const Vec3& pivot, Eigen::VectorXd* residual);

}  // namespace fielddeform::map::detail
