#include <fielddeform/numeric/augmented_lagrangian.h>
#include <fielddeform/volume/detail/prepared.h>

#include <chrono>
#include <cmath>

namespace fielddeform::volume::detail {
namespace {

numeric::AugmentedLagrangianOptions numericOptions(const AugmentedLagrangianOptions& o) {
  numeric::AugmentedLagrangianOptions out;
  out.inner = o.minimiser == Minimiser::Lbfgs ? numeric::InnerMinimizer::Lbfgs : numeric::InnerMinimizer::ConjugateGradients;
  out.minimize.gradient = o.gradient;
  out.minimize.maxSteps = o.maxSteps;
  out.minimize.firstStep = 0.02;
  out.tolerance = o.tolerance;
  out.largestPenalty = o.largestPenalty;
  return out;
}

double seconds(std::chrono::steady_clock::time_point since) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - since).count();
}

}  // namespace

Solved solveAugmentedLagrangian(const Prepared::Impl& impl, const Core& core, const Options& options, Progress& progress) {
  const AugmentedLagrangianOptions& o = options.augmentedLagrangian;
  Solved solved;
  numeric::AugmentedLagrangianState state;
  state.penalty = o.firstPenalty;
  state.x = core.variablesOf(core.start);
  core.meetLinear(state.x);
  const std::size_t last = impl.levels.size() - 1;
  std::vector<Vec3> d;
  // X, lambda and mu are inherited from level to level. [Hirota et al. 1999, Fig. 4]
  for (std::size_t level = o.multiLevel ? 0 : last; level <= last; ++level) {
    const auto begin = std::chrono::steady_clock::now();
    MeshConstraints constraints(impl.levels[level], impl.targets(level), impl.problem.constraints.moments, impl.extent);
    Reduced reduced(core, constraints, constraints, LinearMode::Projected);
    const Eigen::VectorXd before = state.x;
    int step = 0;
    const auto report = numeric::augmentedLagrangian(reduced, state, numericOptions(o), [&](const Eigen::VectorXd& x, double f, const Eigen::VectorXd& c) {
      progress.throwIfCancelled();
      ++step;
      if (!options.onStep) return;
      core.displacements(x, d);
      options.onStep({level, step, d, f * core.energyUnit, c.size() ? c.cwiseAbs().maxCoeff() : 0});
    });
    LevelReport row;
    row.triangles = impl.levels[level].triangles();
    row.steps = report.steps, row.outer = report.outer, row.evaluations = report.evaluations;
    row.change = state.x.size() ? (state.x - before).cwiseAbs().maxCoeff() * core.size / core.extent : 0;
    row.energy = report.value * core.energyUnit;
    row.deviation = report.constraint;
    row.multiplier = state.multiplier.size() ? state.multiplier[0] * core.energyUnit : 0;
    row.penalty = state.penalty * core.energyUnit;
    row.seconds = seconds(begin);
    solved.levels.push_back(row);
    solved.iterations += report.steps;
    if (level == last) solved.fineEvaluations = report.evaluations;
    solved.converged = report.converged;
    solved.optimality = report.gradient;
    if (solved.levels.size() > 1 && report.converged && row.change < o.levelChange) break;
  }
  solved.starts.push_back({solved.levels.back().energy, solved.iterations, 0, solved.converged ? Outcome::Converged : Outcome::Limited});
  solved.x = std::move(state.x);
  return solved;
}

}  // namespace fielddeform::volume::detail
