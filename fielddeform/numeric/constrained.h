#pragma once

#include <Eigen/Core>

#include <functional>

namespace fielddeform::numeric {

/// minimise f(x) subject to c(x) = 0, smooth, scaled by the caller: variables of size about 1, f's curvature about 1,
/// constraints with slopes about 1. Not const: a problem may keep what it last computed.
class ConstrainedProblem {
 public:
  using Vector = Eigen::VectorXd;
  using Matrix = Eigen::MatrixXd;

  virtual ~ConstrainedProblem() = default;
  virtual Eigen::Index variables() const = 0;    ///< n
  virtual Eigen::Index constraints() const = 0;  ///< m
  /// @return f    @param c m, overwritten
  virtual double values(const Vector& x, Vector& c) = 0;
  /// @param gradient n    @param c m    @param jacobian n by m: column k is the gradient of c_k
  virtual double derivatives(const Vector& x, Vector& gradient, Vector& c, Matrix& jacobian) = 0;
  /// The Hessian of f + sum_k multiplier_k c_k at x, n by n; may be approximate in its constraint part.
  virtual void hessian(const Vector& x, const Vector& multiplier, Matrix& h) = 0;
  /// out = that Hessian times p; x and multiplier are those of the last call of linearize().
  virtual void linearize(const Vector& x, const Vector& multiplier) = 0;
  virtual void hessianTimes(const Vector& p, Vector& out) = 0;
  /// out = M^-1 r, M a fixed symmetric positive definite matrix near the Hessian of f. The default is r itself.
  virtual void precondition(const Vector& r, Vector& out) { out = r; }

  /// f, c and grad f + sum_k w_k grad c_k, where the weights w are made from c. The default goes by derivatives().
  virtual double weightedGradient(const Vector& x, const std::function<Vector(const Vector& c)>& weights, Vector& gradient, Vector& c) {
    Matrix jacobian;
    const double f = derivatives(x, gradient, c, jacobian);
    if (c.size()) gradient += jacobian * weights(c);
    return f;
  }
};

}  // namespace fielddeform::numeric
