#pragma once

#include <fielddeform/numeric/constrained.h>
#include <fielddeform/volume/detail/constraints.h>

#include <Eigen/SparseCholesky>

#include <memory>

namespace fielddeform::volume::detail {

/// The point targets as independent orthonormal rows over the free nodes: rows * x = value, coordinate by coordinate.
struct LinearRows {
  Eigen::MatrixXd rows;   ///< #Q by #F
  Eigen::MatrixXd value;  ///< #Q by 3, in units of the size
};

/// What does not change while a problem is solved: free nodes, units, targets.
struct Core {
  const Problem* problem = nullptr;
  std::vector<Index> free;            ///< nodes
  std::vector<Index> rowOf;           ///< N: place in `free`, or kNoIndex
  std::vector<Vec3> start;            ///< N by 3: pinned nodes stand here
  double size = 1;                    ///< length unit: the largest extent of the base, a power of two at or below it
  double energyUnit = 1;              ///< the energy's unit, so that its mean curvature per (length unit)^2 is about 1
  double extent = 1;                  ///< the largest extent itself, what tolerances in "the size" mean
  LinearRows linear;

  Eigen::Index variables() const { return 3 * static_cast<Eigen::Index>(free.size()); }
  /// All displacements (world) for free variables x (units of the size).
  void displacements(const Eigen::VectorXd& x, std::vector<Vec3>& d) const;
  Eigen::VectorXd variablesOf(Points d) const;
  /// v - rows^T rows v: the part along which no point target moves.
  void projectLinear(Eigen::VectorXd& v) const;
  /// Moves x the shortest way to where the point targets are met.
  void meetLinear(Eigen::VectorXd& x) const;
};

enum class LinearMode : std::uint8_t {
  AsConstraints,  ///< the rows follow the nonlinear constraints
  Projected,      ///< gradients are projected along the rows: x stays where it meets them
};

/// The problem over the free nodes, in units: x = d / size.
class Reduced final : public numeric::ConstrainedProblem {
 public:
  /// @param values      gives c and its first derivatives    @param curvature gives second ones (may be a coarser copy)
  Reduced(const Core& core, NodeConstraints& values, NodeConstraints& curvature, LinearMode mode);

  Eigen::Index variables() const override { return core_.variables(); }
  Eigen::Index constraints() const override;
  double values(const Vector& x, Vector& c) override;
  double derivatives(const Vector& x, Vector& gradient, Vector& c, Matrix& jacobian) override;
  double weightedGradient(const Vector& x, const std::function<Vector(const Vector& c)>& weights, Vector& gradient, Vector& c) override;
  void hessian(const Vector& x, const Vector& multiplier, Matrix& h) override;
  void linearize(const Vector& x, const Vector& multiplier) override;
  void hessianTimes(const Vector& p, Vector& out) override;
  void precondition(const Vector& r, Vector& out) override;

 private:
  bool rowsCount() const { return mode_ == LinearMode::AsConstraints && core_.linear.rows.rows() > 0; }
  void linearValues(const Vector& x, Vector& c, Eigen::Index from) const;
  double energyGradient(Vector& gradient);
  SparseMatrix freeHessian(Points d) const;

  const Core& core_;
  NodeConstraints &values_, &curvature_;
  LinearMode mode_;
  std::vector<Vec3> d_, g_, p_;
  Matrix jacobian_;
  SparseMatrix hessian_;
  std::unique_ptr<Eigen::SimplicialLDLT<SparseMatrix>> factor_;
};

}  // namespace fielddeform::volume::detail
