#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <fielddeform/numeric/detail/sqp_steps.h>

#include <cmath>

namespace fielddeform::numeric {
namespace {

using detail::Matrix, detail::Vector;

/// Q = [Y Z] of the constraints' gradients as Householder reflections.
class DenseSteps final : public detail::SqpSteps {
 public:
  explicit DenseSteps(ConstrainedProblem& problem) : problem_(problem) {}

  void project(const Vector& gradient, const Matrix& jacobian, Vector& multiplier, Vector& reduced) override {
    n_ = jacobian.rows();
    qr_.compute(jacobian);
    qr_.setThreshold(1e-12);
    rank_ = jacobian.cols() ? qr_.rank() : 0;
    Vector turned = gradient;
    turned.applyOnTheLeft(qr_.householderQ().adjoint());
    reduced = turned.tail(n_ - rank_);
    Vector part = Vector::Zero(jacobian.cols());
    part.head(rank_) = -turned.head(rank_);
    qr_.matrixR().topLeftCorner(rank_, rank_).triangularView<Eigen::Upper>().solveInPlace(part.head(rank_));
    multiplier = qr_.colsPermutation() * part;
  }

  Vector normal(const Vector& c) override {
    Vector out = Vector::Zero(n_);
    if (rank_ == 0) return out;
    const Vector ordered = qr_.colsPermutation().transpose() * (-c);
    out.head(rank_) = ordered.head(rank_);
    qr_.matrixR().topLeftCorner(rank_, rank_).triangularView<Eigen::Upper>().transpose().solveInPlace(out.head(rank_));
    out.applyOnTheLeft(qr_.householderQ());
    return out;
  }

  void linearize(const Vector& x, const Vector& multiplier) override {
    problem_.hessian(x, multiplier, hessian_);
    turned_ = hessian_;
    turned_.applyOnTheLeft(qr_.householderQ().adjoint());
    turned_.applyOnTheRight(qr_.householderQ());
    cholesky_.compute(inner());
    definite_ = n_ == rank_ || (cholesky_.info() == Eigen::Success && cholesky_.matrixL().nestedExpression().diagonal().minCoeff() > 1e-6);
    decomposed_ = false;
  }
  Vector hessianTimes(const Vector& p) override { return hessian_ * p; }

  Vector tangential(const Vector& gradient, const Vector& normal, double radius) override {
    Vector slope = gradient + hessian_ * normal;
    slope.applyOnTheLeft(qr_.householderQ().adjoint());
    const Vector reduced = slope.tail(n_ - rank_);
    Vector t = Vector::Zero(n_);
    if (n_ > rank_) {
      if (definite_) {
        t.tail(n_ - rank_) = -cholesky_.solve(reduced);
      } else if (const auto newton = conjugate(reduced)) {
        t.tail(n_ - rank_) = *newton;
      } else {
        decompose();
        const Vector along = eigen_.eigenvectors().transpose() * reduced;
        t.tail(n_ - rank_) = -(eigen_.eigenvectors() * along.cwiseQuotient(eigen_.eigenvalues().cwiseAbs().cwiseMax(1e-3)));
      }
    }
    if (const double length = t.norm(); length > radius) t *= radius / length;
    t.applyOnTheLeft(qr_.householderQ());
    return t;
  }

  std::optional<Vector> negativeCurvature() override { return negativeCurvature(1e-7); }
  std::optional<Vector> negativeCurvature(double least) {
    if (definite_) return {};
    decompose();
    if (!(eigen_.eigenvalues()[0] < -least)) return {};
    Vector v = Vector::Zero(n_);
    v.tail(n_ - rank_) = eigen_.eigenvectors().col(0);
    v.applyOnTheLeft(qr_.householderQ());
    Eigen::Index k = 0;
    v.cwiseAbs().maxCoeff(&k);
    return v[k] < 0 ? Vector(-v) : v;
  }

 private:
  Matrix inner() const { return turned_.bottomRightCorner(n_ - rank_, n_ - rank_); }
  /// The Newton step by conjugate gradients, if the slope holds nothing of the directions of negative curvature, as on the way
  /// to a symmetric saddle: a tenth of the eigenvectors' work.
  std::optional<Vector> conjugate(const Vector& slope) const {
    const auto h = turned_.bottomRightCorner(n_ - rank_, n_ - rank_);
    Vector t = Vector::Zero(slope.size()), r = slope, p = -slope, hp;
    double rr = r.squaredNorm();
    const double target = 1e-24 * rr;
    for (Eigen::Index i = 0; i < 2 * slope.size(); ++i) {
      if (rr <= target) return t;
      hp.noalias() = h * p;
      const double curvature = p.dot(hp);
      if (!(curvature > 1e-3 * p.squaredNorm())) return {};
      const double alpha = rr / curvature;
      t += alpha * p, r += alpha * hp;
      const double next = r.squaredNorm();
      p = next / rr * p - r;
      rr = next;
    }
    return {};
  }
  void decompose() {
    if (!decomposed_) eigen_.compute(inner());
    decomposed_ = true;
  }

  ConstrainedProblem& problem_;
  Eigen::ColPivHouseholderQR<Matrix> qr_;
  Eigen::Index n_ = 0, rank_ = 0;
  Matrix hessian_, turned_;
  Eigen::LLT<Matrix> cholesky_;
  Eigen::SelfAdjointEigenSolver<Matrix> eigen_;
  bool definite_ = false, decomposed_ = false;
};

}  // namespace

SqpReport sqp(ConstrainedProblem& problem, Vector& x, const SqpOptions& options, const SqpStep& onStep) {
  DenseSteps steps(problem);
  return detail::runSqp(problem, steps, x, options, onStep);
}

std::optional<Vector> negativeCurvature(ConstrainedProblem& problem, const Vector& x, const Vector& multiplier, double least) {
  Vector gradient, c, ignored, reduced;
  Matrix jacobian;
  problem.derivatives(x, gradient, c, jacobian);
  DenseSteps steps(problem);
  steps.project(gradient, jacobian, ignored, reduced);
  steps.linearize(x, multiplier);
  return steps.negativeCurvature(least);
}

}  // namespace fielddeform::numeric
