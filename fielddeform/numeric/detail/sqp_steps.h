#pragma once

#include <fielddeform/numeric/sqp.h>

#include <optional>

namespace fielddeform::numeric::detail {

using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;

/// The linear algebra of one iterate: what the dense and the sparse solver do differently.
class SqpSteps {
 public:
  virtual ~SqpSteps() = default;
  /// Multipliers of least squares, and the gradient's part along the null space of the constraints.
  virtual void project(const Vector& gradient, const Matrix& jacobian, Vector& multiplier, Vector& reduced) = 0;
  /// The smallest v with jacobian^T v = -c.
  virtual Vector normal(const Vector& c) = 0;
  /// The Hessian at x with these multipliers serves the next calls.
  virtual void linearize(const Vector& x, const Vector& multiplier) = 0;
  virtual Vector hessianTimes(const Vector& p) = 0;
  /// t in the null space, |t| <= radius, lowering the model from the normal step on.
  virtual Vector tangential(const Vector& gradient, const Vector& normal, double radius) = 0;
  /// A unit vector of negative curvature in the null space.
  virtual std::optional<Vector> negativeCurvature() = 0;
};

SqpReport runSqp(ConstrainedProblem& problem, SqpSteps& steps, Vector& x, const SqpOptions& options, const SqpStep& onStep);

}  // namespace fielddeform::numeric::detail
