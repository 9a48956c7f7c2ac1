#pragma once

#include <fielddeform/field/potential.h>
#include <fielddeform/map/pointwise_map.h>
#include <fielddeform/map/skeleton_motion.h>

#include <vector>

namespace fielddeform::map {

enum class SkinBlend : std::uint8_t {
  Linear,          ///< of the images: x' = sum w_b M_b x                        [Magnenat-Thalmann et al. 1988]
  DualQuaternion,  ///< of the motions as dual quaternions, scales apart          [Kavan et al. 2007]
};

struct SkinOptions {
  SkinBlend blend = SkinBlend::Linear;
  skeleton::Potential potential = skeleton::Potential::Exponential;  ///< of primitives that name none
  double sharpness = 4;  ///< k in x = k d / r, dimensionless
};

/// A bone: a segment of a line, a point of a set, or a vertex of a mesh primitive.
struct Bone {
  Vec3 a = Vec3::Zero(), b = Vec3::Zero();  ///< rest, world; equal for points and vertices
  double radius = 1;                        ///< world
  double mass = 1;                          ///< length / radius, area / radius^2, or 1: cutting a bone in two changes little
  skeleton::Potential potential = skeleton::Potential::Exponential;
  Quat rotation = Quat::Identity();         ///< rest to posed; signs follow from neighbour to neighbour
  double scale = 1;                         ///< posed radius / rest radius
  Vec3 centre = Vec3::Zero(), move = Vec3::Zero();  ///< x -> centre + move + scale rotation (x - centre)
};

/// The bones of a skeleton. A segment turns as the mean of its ends' frames, brought onto its posed direction.
std::vector<Bone> bonesOf(const SkeletonMotion& motion, skeleton::Potential potential = skeleton::Potential::Exponential);

/// Skinning: every bone moves rigidly (and scales with its radius); points follow a weighted mean of them, with smooth
/// weights from the potential of the distance to the bone, sum 1 everywhere:
///   w_b ~ mass_b E(k d_b / r_b), unclipped for exponential and gaussian; points that no metaball or soft object reaches are
/// left alone. Exact for rigid motions of the whole skeleton.
class SkinningMap final : public PointwiseMap {
 public:
  /// @throw std::invalid_argument for no bones or options out of range
  explicit SkinningMap(std::vector<Bone> bones, const SkinOptions& options = {});
  SkinningMap(const SkeletonMotion& motion, const SkinOptions& options = {});

  const std::vector<Bone>& bones() const noexcept { return bones_; }
  /// #B, sum 1; all 0 where nothing reaches.
  std::vector<double> weights(const Vec3& rest) const;

  Vec3 displacement(const Vec3& rest) const override;
  Mat3 jacobian(const Vec3& rest) const override;

 protected:
  std::vector<double> restKey() const override;
  std::shared_ptr<RestSide> keepRest(Points rest) const override;
  Vec3 displacementOf(const RestSide& side, std::size_t i, const Vec3& rest) const override;

 private:
  struct Kept;
  struct Weight {
    Index bone;
    double value;  // sum 1
    Vec3 slope;    // sums to 0; only if asked for
  };
  void weigh(const Vec3& rest, bool slopes, std::vector<Weight>& out) const;
  Vec3 moveOf(const Bone& bone, const Vec3& rest) const;
  template <class Weights>
  Vec3 blended(const Weights& weights, const Vec3& rest) const;

  std::vector<Bone> bones_;
  SkinOptions options_;
  std::vector<field::Kernel> kernels_;  // one a potential
  bool identity_ = false;
};

}  // namespace fielddeform::map
