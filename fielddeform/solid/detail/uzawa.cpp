#include <fielddeform/solid/detail/prepared.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::solid::detail {
namespace {

/// The method's state: points P, multipliers of the sizes (relative) and of the rows (shares of the size).
class Uzawa {
 public:
  Uzawa(const Prepared& prepared, const Matrix& wanted, const Matrix& values, const std::vector<double>& targets, const UzawaOptions& options)
      : prepared_(prepared), options_(options), targets_(targets), values_(values) {
    const Eigen::Index n = wanted.rows();
    if (options.eliminateRows) {
      start_ = prepared.base(wanted, values);
    } else {
      prepared.space.solve(prepared.rows, values, prepared.size);  // rows that contradict have no multipliers
      start_ = wanted;
      rows_ = Matrix::Zero(static_cast<Eigen::Index>(prepared.rows.size()), n);
      for (std::size_t r = 0; r < prepared.rows.size(); ++r) {
        for (const auto& [i, c] : prepared.rows[r].terms) rows_(static_cast<Eigen::Index>(r), i) += c;
        scale_.push_back(std::max(1e-300, rows_.row(static_cast<Eigen::Index>(r)).norm()));
        rows_.row(static_cast<Eigen::Index>(r)) /= scale_.back();
      }
      // An energy alone leaves translations free: |C P - d|^2 is added, which is 0 at the solution (an augmented Lagrangian; not the paper's).
      if (prepared.problem.objective.leastSquares > 0 || rows_.rows() == 0) {
        factor_.compute(prepared.h);
      } else {
        factor_.compute(prepared.h + rows_.transpose() * rows_);
        Matrix d = values;
        for (std::size_t r = 0; r < scale_.size(); ++r) d.row(static_cast<Eigen::Index>(r)) /= scale_[r];
        start_ = factor_.solve(prepared.h * wanted + rows_.transpose() * d);
      }
    }
    sizeMultiplier_ = Vector::Zero(static_cast<Eigen::Index>(targets.size()));
    rowMultiplier_ = Matrix::Zero(rows_.rows(), 3);
    p_ = start_;
    pointsFrom(p_, points_);
    naturalSteps();
  }

  UzawaStep iterate() {
    UzawaStep step;
    double moved = 0;
    do {
      const Matrix next = start_ - prepared_.size * inverse(pull());
      moved = (next - p_).cwiseAbs().maxCoeff() / prepared_.size;
      p_ = next;
      pointsFrom(p_, points_);
      ++step.inner;
    } while (moved > options_.distanceTolerance && step.inner < options_.maxInner && std::isfinite(moved));
    const Vector c = deviations();
    const Matrix r = residuals();
    step.deviation = c.size() ? c.cwiseAbs().maxCoeff() : 0;
    step.residual = r.size() ? r.cwiseAbs().maxCoeff() : 0;
    done_ = step.deviation <= options_.sizeTolerance && step.residual <= options_.distanceTolerance && moved <= options_.distanceTolerance;
    sizeMultiplier_ += options_.rho1 * sizeStep_ * c;
    if (r.size()) rowMultiplier_ += options_.rho2 * rowStep_ * r;
    if (!std::isfinite(step.deviation)) step.deviation = std::numeric_limits<double>::infinity();
    if (!std::isfinite(step.residual)) step.residual = std::numeric_limits<double>::infinity();
    return step;
  }
  bool done() const { return done_; }
  const std::vector<Vec3>& points() const { return points_; }

 private:
  /// H^-1 g, within the rows if they are kept exactly.
  Matrix inverse(const Matrix& g) const {
    if (options_.eliminateRows) return prepared_.map * (prepared_.map.transpose() * g);
    return factor_.solve(g);
  }
  Matrix sizeGradient(std::size_t k) const {
    std::vector<Vec3> g(points_.size(), Vec3::Zero());
    prepared_.sizes.addGradient(prepared_.held[k], points_, prepared_.size / targets_[k], g);
    return matrixOf(g);
  }
  Matrix pull() const {
    Matrix out = Matrix::Zero(p_.rows(), 3);
    for (std::size_t k = 0; k < targets_.size(); ++k) out += sizeMultiplier_[static_cast<Eigen::Index>(k)] * sizeGradient(k);
    if (rows_.rows()) out += rows_.transpose() * rowMultiplier_;
    return out;
  }
  Vector deviations() const {
    Vector out(static_cast<Eigen::Index>(targets_.size()));
    for (std::size_t k = 0; k < targets_.size(); ++k)
      out[static_cast<Eigen::Index>(k)] = prepared_.sizes.value(prepared_.held[k], points_) / targets_[k] - 1;
    return out;
  }
  Matrix residuals() const {
    if (!rows_.rows()) return Matrix(0, 3);
    Matrix out = rows_ * p_;
    for (std::size_t r = 0; r < scale_.size(); ++r) out.row(static_cast<Eigen::Index>(r)) -= values_.row(static_cast<Eigen::Index>(r)) / scale_[r];
    return out / prepared_.size;
  }

  /// The largest eigenvalue of A H^-1 A^T, A the gradients of sizes and rows in multiples, by power iteration.
  double largestEigenvalue(const std::vector<Matrix>& gradients, double ofSizes, double ofRows) const {
    Vector a = Vector::Ones(static_cast<Eigen::Index>(gradients.size()));
    Matrix b = Matrix::Ones(rows_.rows(), 3);
    for (Eigen::Index i = 0; i < b.size(); ++i) b.data()[i] += 0.1 * std::sin(static_cast<double>(i));  // not orthogonal to anything by symmetry
    for (Eigen::Index i = 0; i < a.size(); ++i) a[i] += 0.1 * static_cast<double>(i);
    double length = 0;
    for (int k = 0; k < 100; ++k) {
      Matrix pull = Matrix::Zero(p_.rows(), 3);
      for (std::size_t i = 0; i < gradients.size(); ++i) pull += ofSizes * a[static_cast<Eigen::Index>(i)] * gradients[i];
      if (rows_.rows()) pull += ofRows * (rows_.transpose() * b);
      const Matrix moved = inverse(pull);
      for (std::size_t i = 0; i < gradients.size(); ++i) a[static_cast<Eigen::Index>(i)] = ofSizes * gradients[i].cwiseProduct(moved).sum();
      if (rows_.rows()) b = ofRows * (rows_ * moved);
      length = std::sqrt(a.squaredNorm() + b.squaredNorm());
      if (!(length > 0)) return 0;
      a /= length, b /= length;
    }
    return length;
  }

  /// Steps of 1 for both together reach the largest that is safe by half: sizes and rows act on the same points.
  void naturalSteps() {
    std::vector<Matrix> g;
    for (std::size_t k = 0; k < targets_.size(); ++k) g.push_back(sizeGradient(k));
    const double sizes = largestEigenvalue(g, 1, 0), rows = rows_.rows() ? largestEigenvalue(g, 0, 1) : 0;
    const double a = sizes > 0 ? 1 / std::sqrt(sizes) : 0, b = rows > 0 ? 1 / std::sqrt(rows) : 0;
    const double both = largestEigenvalue(g, a, b);
    if (!(both > 0)) return;
    sizeStep_ = a * a / both;
    rowStep_ = b * b / both;
  }

  const Prepared& prepared_;
  const UzawaOptions& options_;
  std::vector<double> targets_;
  Matrix start_, values_, rows_, p_;
  std::vector<double> scale_;
  Eigen::LLT<Matrix> factor_;
  Vector sizeMultiplier_;
  Matrix rowMultiplier_;
  double sizeStep_ = 0, rowStep_ = 0;
  std::vector<Vec3> points_;
  bool done_ = false;
};

}  // namespace

Result uzawa(const Prepared& prepared, const Matrix& wanted, const Matrix& values, const std::vector<double>& targets,
             const UzawaOptions& options, Progress& progress) {
  Uzawa method(prepared, wanted, values, targets, options);
  Result out;
  Report& report = out.report;
  double least = std::numeric_limits<double>::infinity();
  while (!method.done() && report.iterations < options.maxOuter) {
    progress.throwIfCancelled();
    report.steps.push_back(method.iterate());
    const UzawaStep& last = report.steps.back();
    ++report.iterations;
    report.inner += last.inner;
    const double worst = std::max(last.deviation, last.residual);
    least = std::min(least, worst);
    if (!std::isfinite(worst) || worst > 1e3 * std::max(1.0, least)) {
      report.message = fmt::format("Uzawa's method diverged after {} iterations: smaller rho1 (now {:.3g}) or rho2 (now {:.3g}) may help", report.iterations, options.rho1, options.rho2);
      break;
    }
  }
  out.points = method.points();
  report.outcome = method.done() ? Outcome::Converged : Outcome::Unmet;
  if (!method.done() && report.message.empty())
    report.message = fmt::format("Uzawa's method stopped after {} iterations: sizes off by {:.2e}, rows by {:.2e} of the size", report.iterations,
                                 report.steps.empty() ? 0 : report.steps.back().deviation, report.steps.empty() ? 0 : report.steps.back().residual);
  return out;
}

}  // namespace fielddeform::solid::detail
