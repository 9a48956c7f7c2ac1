#include <fielddeform/core/error.h>
#include <fielddeform/volume/detail/prepared.h>
#include <fmt/format.h>

#include <cmath>
#include <limits>

namespace fielddeform::volume {
namespace {

using detail::Core, detail::MeshConstraints, detail::Solved;

/// The volume of each region at d, whose positions are x.
std::vector<double> volumesAt(const Prepared::Impl& impl, const MeshConstraints& fine, Points d, Points x) {
  const SurfaceVolume& surface = impl.fine().volume();
  std::vector<double> out(surface.regionCount());
  for (std::size_t r = 0; r < out.size(); ++r) {
    const auto known = fine.knownVolume(d, r);
    out[r] = known ? *known : surface.value(x, r);
  }
  return out;
}

void reportResiduals(const Prepared::Impl& impl, Points d, const Eigen::VectorXd& c, Eigen::Index volumes, Report& report) {
  report.momentResidual = c.size() > volumes ? c.tail(c.size() - volumes).cwiseAbs().maxCoeff() : 0;
  const auto& points = impl.problem.constraints.points;
  if (!points || points->position.empty()) return;
  std::vector<Vec3> moved(points->position.size());
  impl.problem.map->combine(*points->binding, d, moved);
  for (std::size_t q = 0; q < moved.size(); ++q)
    report.pointResidual = std::max(report.pointResidual, (points->base[q] + moved[q] - points->position[q]).norm());
}

/// The outcome in one word and, where it is not plain success, one sentence.
void judge(const Solved& solved, const Eigen::VectorXd& c, double size, Report& report) {
  const double worst = c.size() ? c.cwiseAbs().maxCoeff() : 0;
  report.outcome = solved.converged ? Outcome::Converged : Outcome::Limited;
  report.message = solved.message;
  if (!(worst <= 1e-9) || !(report.pointResidual <= 1e-9 * size)) {
    report.outcome = Outcome::Unmet;
    report.message = fmt::format("a constraint is missed by {:.3g}: free more nodes, or refine the lattice", std::max(worst, report.pointResidual / size));
  } else if (!solved.converged && report.message.empty()) {
    report.message = "the energy is not at its minimum to the tolerance (the volumes are met)";
  }
}

}  // namespace

std::string_view toString(Solver solver) noexcept {
  switch (solver) {
    case Solver::Exact: return "exact";
    case Solver::AugmentedLagrangian: return "augmented-lagrangian";
    case Solver::Projection: return "projection";
  }
  return "";
}
std::string_view toString(Minimiser minimiser) noexcept {
  return minimiser == Minimiser::Lbfgs ? "l-bfgs" : "conjugate-gradients";
}
std::string_view toString(Outcome outcome) noexcept {
  switch (outcome) {
    case Outcome::Converged: return "converged";
    case Outcome::Limited: return "limited";
    case Outcome::Unmet: return "unmet";
  }
  return "";
}

void Options::validate() const {
  const auto& a = augmentedLagrangian;
  requirePositive("tolerance", a.tolerance);
  requirePositive("gradient", a.gradient);
  requirePositive("level_change", a.levelChange);
  requirePositive("first_penalty", a.firstPenalty);
  requireInRange("largest_penalty", a.largestPenalty, a.firstPenalty, 1e30);
  requireInRange("max_steps", a.maxSteps, 1, 1e9);
  requireInRange("max_saddles", a.maxSaddles, 0, 1e6);
  requireInRange("max_iterations", exact.maxIterations, 1, 1e9);
  requirePositive("gradient", exact.gradient);
  requirePositive("deviation", exact.deviation);
  requireInRange("max_saddles", exact.maxSaddles, 0, 1e6);
  requireInRange("load_steps", exact.loadSteps, 1, 1e6);
  requireInRange("starts", exact.starts, 1, 1e6);
  requireInRange("jitter", exact.jitter, 0, 10);
}

Result preserve(const Prepared& prepared, const Options& options, Progress& progress, Points given) {
  options.validate();
  const Prepared::Impl& impl = *prepared.impl();
  std::vector<Vec3> start(given.begin(), given.end());
  if (start.empty()) start = impl.problem.start;
  if (start.empty()) {
    const Points own = impl.problem.map->displacements();
    start.assign(own.begin(), own.end());
  }
  if (start.size() != impl.rowOf.size()) throw std::invalid_argument(fmt::format("start: {} nodes, expected {}", start.size(), impl.rowOf.size()));
  for (const Vec3& d : start)
    if (!d.allFinite()) throw std::invalid_argument("start: a displacement is not finite");
  progress.throwIfCancelled();

  const std::size_t last = impl.levels.size() - 1;
  const auto targets = impl.targets(last);
  MeshConstraints fine(impl.fine(), targets, impl.problem.constraints.moments, impl.extent);
  Result result;
  Report& report = result.report;
  report.size = impl.extent;
  Eigen::VectorXd c;
  fine.values(start, c);
  const auto before = volumesAt(impl, fine, start, fine.positions(start));
  for (std::size_t r = 0; r < before.size(); ++r) report.volumes.push_back({impl.baseVolume.back()[r], before[r], impl.wantedVolume(r, {}), before[r]});
  report.energyBefore = impl.problem.energy->value(start);

  Solved solved;
  const Core core = impl.core(start);
  if (impl.free.empty()) {
    if (c.size() && !(c.cwiseAbs().maxCoeff() <= 1e-12))
      throw InfeasibleError(fmt::format("all {} nodes are pinned: nothing is left to move, and the volume is off by {:.3g}", start.size(), c.cwiseAbs().maxCoeff()));
    solved.converged = true;
    solved.x.resize(0);
  } else if (options.solver == Solver::Exact) {
    solved = detail::solveExact(impl, start, fine, options, progress);
  } else if (options.solver == Solver::AugmentedLagrangian) {
    solved = detail::solveAugmentedLagrangian(impl, core, fine, options, progress);
  } else {
    solved.x = core.variablesOf(start);
    solved.converged = true;
  }
  progress.throwIfCancelled();

  report.projection = detail::projectOnto(core, fine, solved.x);
  report.meshEvaluations = fine.evaluations;
  core.displacements(solved.x, result.displacements);
  fine.values(result.displacements, c);
  const auto after = volumesAt(impl, fine, result.displacements, fine.positions(result.displacements));
  for (std::size_t r = 0; r < after.size(); ++r) report.volumes[r].after = after[r];
  result.positions = fine.takePositions(result.displacements);
  reportResiduals(impl, result.displacements, c, static_cast<Eigen::Index>(targets.size()), report);
  report.energy = impl.problem.energy->value(result.displacements);
  report.optimality = solved.optimality;
  report.iterations = solved.iterations, report.saddles = solved.saddles;
  report.levels = std::move(solved.levels), report.starts = std::move(solved.starts);
  report.errorEstimate = std::numeric_limits<double>::quiet_NaN();
  if (options.solver == Solver::AugmentedLagrangian && !report.levels.empty()) {  // the level it ended at
    const std::size_t end = options.augmentedLagrangian.multiLevel ? report.levels.size() - 1 : last;
    report.errorEstimate = detail::volumeError(impl, end, result.displacements, end == last ? after : std::vector<double>());
  }
  judge(solved, c, impl.extent, report);
  return result;
}

Result preserve(const Problem& problem, const Options& options, Progress& progress) {
  return preserve(Prepared(problem), options, progress);
}

}  // namespace fielddeform::volume
