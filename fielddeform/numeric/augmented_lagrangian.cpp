#include <fielddeform/numeric/augmented_lagrangian.h>

#include <cmath>
#include <limits>

namespace fielddeform::numeric {
namespace {

double largest(const Eigen::VectorXd& v) { return v.size() ? v.cwiseAbs().maxCoeff() : 0; }

}  // namespace

AugmentedLagrangianReport augmentedLagrangian(ConstrainedProblem& problem, AugmentedLagrangianState& state,
                                              const AugmentedLagrangianOptions& options, const ConstrainedStep& onStep) {
  AugmentedLagrangianReport report;
  if (state.multiplier.size() != problem.constraints()) state.multiplier.setZero(problem.constraints());
  // The line search's last evaluation is that of the point it takes, or close to it: values of the step are read off here.
  Eigen::VectorXd c, lastX;
  double value = 0;
  const GradientFunction lagrangian = [&](const Eigen::VectorXd& x, Eigen::VectorXd& gradient) {
    value = problem.weightedGradient(
        x, [&](const Eigen::VectorXd& at) { return Eigen::VectorXd(state.multiplier + state.penalty * at); }, gradient, c);
    lastX = x;
    return value + state.multiplier.dot(c) + 0.5 * state.penalty * c.squaredNorm();
  };
  const StepFunction step = [&](const Eigen::VectorXd& x, double) {
    if (onStep) onStep(x, value, c);
    return true;
  };
  double before = std::numeric_limits<double>::infinity();
  while (report.outer < options.maxOuter) {
    ++report.outer;
    MinimizeOptions inner = options.minimize;
    inner.maxSteps = options.minimize.maxSteps - report.steps;
    // A stiffer penalty makes the gradient larger for the same distance from the minimum.
    const auto minimize = options.inner == InnerMinimizer::Lbfgs ? lbfgs : conjugateGradients;
    const MinimizeReport done = minimize(lagrangian, state.x, inner, step);
    report.steps += done.steps, report.evaluations += done.evaluations;
    report.gradient = done.gradient;
    if (lastX != state.x) report.value = problem.values(state.x, c), ++report.evaluations;
    else report.value = value;
    report.constraint = largest(c);
    report.converged = report.constraint <= options.tolerance;
    if (report.converged) state.multiplier += state.penalty * c;  // the gradient's own, for whoever goes on from here
    if (report.converged || report.steps >= options.minimize.maxSteps || !std::isfinite(report.constraint)) break;
    if (report.constraint > 0.5 * before && state.penalty < options.largestPenalty) {
      state.penalty = std::min(2 * state.penalty, options.largestPenalty);
      continue;
    }
    before = report.constraint;
    state.multiplier += state.penalty * c;
  }
  return report;
}

}  // namespace fielddeform::numeric
