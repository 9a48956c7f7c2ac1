#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <fielddeform/core/random.h>
#include <fielddeform/numeric/detail/sqp_steps.h>

#include <cmath>
#include <utility>
#include <vector>

namespace fielddeform::numeric {
namespace {

using detail::Matrix, detail::Vector;

constexpr Eigen::Index kLanczosSteps = 30;
constexpr double kNegative = 1e-4;  // of the unit of curvature: motions that cost nothing round to less

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

  /// The least Ritz vector of the preconditioned Hessian on the null space, from a start without symmetries.
  std::optional<Vector> negativeCurvature() override {
    const Eigen::Index n = w_.rows();
    std::vector<Vector> basis, dual;  // v_k, and M v_k
    Vector r(n);
    for (Eigen::Index i = 0; i < n; ++i) r[i] = uniform01(1, static_cast<std::uint64_t>(i)) - 0.5;
    Matrix t = Matrix::Zero(kLanczosSteps, kLanczosSteps);
    Eigen::SelfAdjointEigenSolver<Matrix> eigen;
    double least = 0;
    for (Eigen::Index k = 0; k < kLanczosSteps; ++k) {
      const Vector z = projected(r);
      const double square = r.dot(z);
      if (!(square > 1e-24) || !std::isfinite(square)) break;
      const double length = std::sqrt(square);
      if (k > 0) t(k, k - 1) = t(k - 1, k) = length;
      basis.push_back(z / length), dual.push_back(r / length);
      r = hessianTimes(basis.back());
      t(k, k) = basis.back().dot(r);
      for (int pass = 0; pass < 2; ++pass)
        for (std::size_t j = 0; j < basis.size(); ++j) r -= basis[j].dot(r) * dual[j];
      if (k % 5 != 4 && k + 1 < kLanczosSteps) continue;
      eigen.compute(t.topLeftCorner(k + 1, k + 1));
      const double before = std::exchange(least, eigen.eigenvalues()[0]);
      if (std::abs(least - before) <= 1e-2 * std::abs(least)) break;
    }
    if (basis.empty()) return {};
    const auto m = static_cast<Eigen::Index>(basis.size());
    eigen.compute(t.topLeftCorner(m, m));
    Vector v = Vector::Zero(n);
    for (Eigen::Index k = 0; k < m; ++k) v += eigen.eigenvectors()(k, 0) * basis[static_cast<std::size_t>(k)];
    v.normalize();
    if (!(v.dot(hessianTimes(v)) < -kNegative)) return {};
    Eigen::Index first = 0;
    v.cwiseAbs().maxCoeff(&first);
    return v[first] < 0 ? Vector(-v) : v;
  }

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
