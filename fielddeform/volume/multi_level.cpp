#include <fielddeform/numeric/augmented_lagrangian.h>
#include <fielddeform/volume/detail/prepared.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <optional>

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

double volumeError(const Prepared::Impl& impl, std::size_t level, Points d) {
  if (level == 0 || level >= impl.levels.size()) return std::numeric_limits<double>::quiet_NaN();
  double share[2] = {}, triangles[2] = {};
  std::vector<Vec3> x;
  for (std::size_t k = 0; k < 2; ++k) {
    const auto& model = impl.levels[level - 1 + k];
    model.positions(d, x);
    double posed = 0, base = 0;
    for (std::size_t r = 0; r < impl.baseVolume[level].size(); ++r) posed += model.volume().value(x, r), base += impl.baseVolume[level - 1 + k][r];
    share[k] = posed / base;
    triangles[k] = static_cast<double>(model.triangles());
  }
  return std::abs((share[0] - share[1]) / (1 / triangles[0] - 1 / triangles[1]) / triangles[1]);
}

Solved solveAugmentedLagrangian(const Prepared::Impl& impl, const Core& core, MeshConstraints& fine, const Options& options, Progress& progress) {
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
    std::optional<MeshConstraints> own;
    if (level != last) own.emplace(impl.levels[level], impl.targets(level), impl.problem.constraints.moments, impl.extent);
    MeshConstraints& constraints = own ? *own : fine;
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
    solved.converged = report.converged;
    solved.optimality = report.gradient;
    // The nodes stand still and this triangulation's own volume is good enough.
    if (solved.levels.size() > 1 && report.converged && row.change < o.levelChange) {
      core.displacements(state.x, d);
      if (volumeError(impl, level, d) <= o.tolerance) break;
    }
  }
  solved.starts.push_back({solved.levels.back().energy, solved.iterations, 0, solved.converged ? Outcome::Converged : Outcome::Limited});
  solved.x = std::move(state.x);
  return solved;
}

}  // namespace fielddeform::volume::detail
