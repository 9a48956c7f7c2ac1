#pragma once

#include <fielddeform/volume/cubic_form.h>
#include <fielddeform/volume/detail/mesh_model.h>
#include <fielddeform/volume/detail/moments.h>

#include <functional>
#include <memory>

namespace fielddeform::volume::detail {

/// One volume to keep: c = (V_region - target) / scale.
struct VolumeTarget {
  std::size_t region = 0;
  double target = 0, scale = 1;
};

/// The nonlinear constraints as functions of the node displacements (world): volumes, then moments.
class NodeConstraints {
 public:
  using Vector = Eigen::VectorXd;
  using Matrix = Eigen::MatrixXd;
  virtual ~NodeConstraints() = default;
  virtual Eigen::Index count() const = 0;
  /// Other target volumes of the same regions and scales.
  virtual void retarget(std::vector<VolumeTarget> volumes) = 0;
  virtual void values(Points d, Vector& c) = 0;
  /// @param jacobian 3N by count(): column k is dc_k/dd
  virtual void derivatives(Points d, Vector& c, Matrix& jacobian) = 0;
  /// c and sum_k w_k dc_k/dd, where the weights are made from c. The default goes by derivatives(). @param out N by 3
  virtual void weightedGradient(Points d, const std::function<Vector(const Vector& c)>& weights, Vector& c, std::span<Vec3> out);
  /// h += Hessian of sum multiplier_k c_k. @param rows as for CubicForm::addHessian(), N
  virtual void addHessian(Points d, const Vector& multiplier, std::span<const Index> rows, Matrix& h) = 0;
  virtual void linearize(Points d, const Vector& multiplier) = 0;
  /// out = that Hessian (of the last linearize()) times p. N by 3
  virtual void hessianTimes(Points p, std::span<Vec3> out) = 0;
  int evaluations = 0;  ///< of values or derivatives
};

/// On a mesh, everything.
class MeshConstraints final : public NodeConstraints {
 public:
  MeshConstraints(const MeshModel& model, std::vector<VolumeTarget> volumes, std::vector<MomentTarget> moments, double size);
  Eigen::Index count() const override { return count_; }
  void retarget(std::vector<VolumeTarget> volumes) override { volumes_ = std::move(volumes), known_ = gradientKnown_ = false; }
  void values(Points d, Vector& c) override;
  void derivatives(Points d, Vector& c, Matrix& jacobian) override;
  void weightedGradient(Points d, const std::function<Vector(const Vector& c)>& weights, Vector& c, std::span<Vec3> out) override;
  void addHessian(Points d, const Vector& multiplier, std::span<const Index> rows, Matrix& h) override;
  void linearize(Points d, const Vector& multiplier) override;
  void hessianTimes(Points p, std::span<Vec3> out) override;
  /// base + B d; kept until asked for another d.
  const std::vector<Vec3>& positions(Points d);
  /// The same, given away.
  std::vector<Vec3> takePositions(Points d);
  /// Of one of the target regions at d, cubic units, if that is known already.
  std::optional<double> knownVolume(Points d, std::size_t region) const;
  const MeshModel& model() const { return model_; }
  /// The one volume, if there is nothing else.
  std::optional<VolumeTarget> single() const {
    return volumes_.size() == 1 && moments_.empty() ? std::optional(volumes_[0]) : std::nullopt;
  }

 private:
  void column(std::size_t region, Points g, Matrix& jacobian, Eigen::Index k) const;
  /// The one volume and its gradient over the nodes (gradient_), both kept for the d they were asked for.
  void singleGradient(Points d, Vector& c);

  const MeshModel& model_;
  std::vector<VolumeTarget> volumes_;
  std::vector<MomentTarget> moments_;
  double size_;
  Eigen::Index count_ = 0;
  std::vector<Vec3> x_, p_, g_, nodes_, scratch_;
  std::vector<Vec3> at_;  ///< the d of x_
  Vector c_, multiplier_;
  std::vector<double> volume_;  ///< of c_'s first entries, cubic units
  std::vector<Vec3> gradient_;  ///< of the single volume, cubic units
  bool known_ = false;          ///< c_ is that of at_
  bool gradientKnown_ = false;  ///< gradient_ too
};

/// Volumes by cubic forms, one a target; without moments.
class FormConstraints final : public NodeConstraints {
 public:
  struct Form {
    CubicForm form;
    std::vector<Vec3> rest;   ///< where its nodes are at d = 0, about the region's centre
    std::vector<Index> node;  ///< of the map, which moves each by its d; kNoIndex: it stands still
  };
  FormConstraints(std::vector<Form> forms, std::vector<VolumeTarget> volumes, std::size_t nodes);
  /// The forms of the target regions of a mesh whose basis is kept as a matrix, for every d.
  /// @param restNodes  N by 3. Where the surface is not these nodes' alone, three nodes more stand for its base
  static FormConstraints ofMesh(const MeshModel& model, Points restNodes, std::vector<VolumeTarget> volumes);
  /// The same while all nodes but `free` stand where `start` has them: what these make of the surface is its base, which takes
  /// three nodes. Much smaller forms where most nodes are pinned; derivatives by the others are left 0.
  /// @param positions  #V by 3, the surface at `start`    @param start N by 3
  static FormConstraints ofFree(const MeshModel& model, Points positions, Points start, std::span<const Index> free,
                                std::vector<VolumeTarget> volumes);

  void retarget(std::vector<VolumeTarget> volumes) override { volumes_ = std::move(volumes); }
  Eigen::Index count() const override { return static_cast<Eigen::Index>(volumes_.size()); }
  void values(Points d, Vector& c) override;
  void derivatives(Points d, Vector& c, Matrix& jacobian) override;
  void addHessian(Points d, const Vector& multiplier, std::span<const Index> rows, Matrix& h) override;
  void linearize(Points d, const Vector& multiplier) override;
  void hessianTimes(Points p, std::span<Vec3> out) override;

 private:
  const std::vector<Vec3>& at(Points d, std::size_t k);

  std::vector<Form> forms_;
  std::vector<VolumeTarget> volumes_;
  std::size_t nodes_ = 0;
  std::vector<Vec3> x_, g_;
  std::vector<Index> rows_;
  Matrix hessian_;
};

}  // namespace fielddeform::volume::detail
