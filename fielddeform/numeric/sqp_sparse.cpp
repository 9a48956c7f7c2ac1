#include <Eigen/Cholesky>
#include <fielddeform/numeric/detail/sqp_steps.h>

#include <cmath>

namespace fielddeform::numeric {
namespace {

using detail::Matrix, detail::Vector;

/// Null-space projections in the metric M of the preconditioner: with W = M^-1 A^T and C = A W,
/// r -> M^-1 r - W C^-1 W^T r.
class SparseSteps final : public detail::SqpSteps {
 public:
  SparseSteps(ConstrainedProblem& problem, const SqpOptions& options, int& inner) : problem_(problem), options_(options), inner_(inner) {}

  void project(const Vector& gradient, const Matrix& jacobian, Vector& multiplier, Vector& reduced) override {
    jacobian_ = jacobian;
    w_.resize(jacobian.rows(), jacobian.cols());
    Vector column;
    for (Eigen::Index k = 0; k < jacobian.cols(); ++k) {
      problem_.precondition(jacobian.col(k), column);
      w_.col(k) = column;
    }
    if (jacobian.cols()) c_.compute(jacobian.transpose() * w_);
    multiplier = jacobian.cols() ? Vector(-c_.solve(w_.transpose() * gradient)) : Vector();
    reduced = gradient;
    if (jacobian.cols()) reduced += jacobian * multiplier;
  }

  Vector normal(const Vector& c) override {
    if (c.size() == 0) return Vector::Zero(w_.rows());
    return -(w_ * c_.solve(c));
  }
  void linearize(const Vector& x, const Vector& multiplier) override { problem_.linearize(x, multiplier); }
  Vector hessianTimes(const Vector& p) override {
    Vector out;
    problem_.hessianTimes(p, out);
    return out;
  }

  Vector tangential(const Vector& gradient, const Vector& normal, double radius) override {
    Vector r = gradient;
    if (normal.squaredNorm() > 0) r += hessianTimes(normal);
    Vector t = Vector::Zero(r.size()), z = projected(r);
    const double first = r.dot(z);
    // What is left of a gradient within the constraints' span is rounding: conjugate gradients would follow its noise.
    Vector whole;
    problem_.precondition(r, whole);
    const double noise = 1e-28 * r.dot(whole);
    if (!(first > noise)) return t;
    // Only as far as the outer iteration can use it (an inexact Newton method).
    const double target = std::max(noise, first * std::min(1e-2, std::max(1e-20, first)));
    Vector p = -z;
    double rz = first;
    for (int i = 0; i < options_.maxInner; ++i, ++inner_) {
      const Vector hp = hessianTimes(p);
      const double curvature = p.dot(hp);
      if (!(curvature > 0)) return toBoundary(t, p, radius);
      const double alpha = rz / curvature;
      const Vector next = t + alpha * p;
      if (next.norm() >= radius) return toBoundary(t, p, radius);
      t = next;
      r += alpha * hp;
      z = projected(r);
      const double rzNext = r.dot(z);
      if (!(rzNext > target)) break;
      p = rzNext / rz * p - z;
      rz = rzNext;
    }
    return t;
  }

  std::optional<Vector> negativeCurvature() override { return {}; }

 private:
  Vector projected(const Vector& r) {
    Vector z;
    problem_.precondition(r, z);
    for (int pass = 0; pass < 2 && c_.cols() > 0; ++pass) z -= w_ * c_.solve(jacobian_.transpose() * z);  // twice: for the digits
    return z;
  }
  static Vector toBoundary(const Vector& t, const Vector& p, double radius) {
    const double a = p.squaredNorm(), b = t.dot(p), c = t.squaredNorm() - radius * radius;
    return t + (-b + std::sqrt(std::max(0.0, b * b - a * c))) / a * p;
  }

  ConstrainedProblem& problem_;
  const SqpOptions& options_;
  int& inner_;
  Matrix jacobian_, w_;
  Eigen::LDLT<Matrix> c_;
};

}  // namespace

SqpReport sparseSqp(ConstrainedProblem& problem, Vector& x, const SqpOptions& options, const SqpStep& onStep) {
  int inner = 0;
  SparseSteps steps(problem, options, inner);
  SqpReport report = detail::runSqp(problem, steps, x, options, onStep);
  report.inner = inner;
  return report;
}

}  // namespace fielddeform::numeric
