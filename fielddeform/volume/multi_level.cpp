#include <fielddeform/numeric/augmented_lagrangian.h>
#include <fielddeform/volume/detail/prepared.h>
#include <fielddeform/volume/detail/saddle.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <numeric>
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

double volumeError(const Prepared::Impl& impl, std::size_t level, Points d, std::span<const double> volumes) {
  if (level == 0 || level >= impl.levels.size()) return std::numeric_limits<double>::quiet_NaN();
  double share[2] = {}, triangles[2] = {};
  std::vector<Vec3> x;
  for (std::size_t k = 0; k < 2; ++k) {
    const auto& model = impl.levels[level - 1 + k];
    double posed = std::accumulate(volumes.begin(), volumes.end(), 0.0), base = 0;
    if (k == 0 || volumes.empty()) {
      model.positions(d, x);
      posed = 0;
      for (std::size_t r = 0; r < impl.baseVolume[level].size(); ++r) posed += model.volume().value(x, r);
    }
    for (const double v : impl.baseVolume[level - 1 + k]) base += v;
    share[k] = posed / base;
    triangles[k] = static_cast<double>(model.triangles());
  }
  return std::abs((share[0] - share[1]) / (1 / triangles[0] - 1 / triangles[1]) / triangles[1]);
}

namespace {

constexpr std::size_t kSaddleTriangles = 64;  // of the first level whose saddles mean anything
constexpr double kSaddleStep = 0.02;          // as the exact solver's

/// One run over the levels.
class Levels {
 public:
  Levels(const Prepared::Impl& impl, const Core& core, MeshConstraints& fine, const Options& options, Progress& progress)
      : impl_(impl), core_(core), fine_(fine), options_(options), o_(options.augmentedLagrangian), progress_(progress), saddles_(impl, core.start) {
    state_.penalty = o_.firstPenalty;
    state_.x = core.variablesOf(core.start);
    core.meetLinear(state_.x);
  }

  Solved run() {
    const std::size_t last = impl_.levels.size() - 1;
    // X, lambda and mu are inherited from level to level. [Hirota et al. 1999, Fig. 4]
    for (std::size_t level = o_.multiLevel ? 0 : last; level <= last; ++level)
      if (solve(level)) break;
    solved_.starts.push_back({solved_.levels.back().energy, solved_.iterations, solved_.saddles, solved_.converged ? Outcome::Converged : Outcome::Limited});
    solved_.x = std::move(state_.x);
    return std::move(solved_);
  }

 private:
  /// @return whether the levels end here
  bool solve(std::size_t level) {
    const auto begin = std::chrono::steady_clock::now();
    const bool last = level + 1 == impl_.levels.size();
    std::optional<MeshConstraints> own;
    if (!last) own.emplace(impl_.levels[level], impl_.targets(level), impl_.problem.constraints.moments, impl_.extent);
    MeshConstraints& constraints = own ? *own : fine_;
    Reduced reduced(core_, constraints, constraints, LinearMode::Projected);
    const Eigen::VectorXd before = state_.x;
    step_ = 0;
    row_ = {};
    row_.triangles = impl_.levels[level].triangles();
    bool ends = descend(reduced, level, before);
    // Once on the first level that shows saddles, and where the levels end.
    const bool look = last || ends || (!looked_ && row_.triangles >= kSaddleTriangles);
    while (look && solved_.converged && solved_.saddles < o_.maxSaddles && leaveSaddle(reduced)) ends = descend(reduced, level, before);
    looked_ = looked_ || look;
    row_.seconds = seconds(begin);
    solved_.levels.push_back(row_);
    return ends;
  }

  /// The level's own minimisation, its row brought up to date.
  /// @return whether nodes stand still from level to level and this triangulation's own volume is good enough
  bool descend(Reduced& reduced, std::size_t level, const Eigen::VectorXd& before) {
    const auto report = numeric::augmentedLagrangian(reduced, state_, numericOptions(o_), [&](const Eigen::VectorXd& x, double f, const Eigen::VectorXd& c) {
      progress_.throwIfCancelled();
      ++step_;
      if (!options_.onStep) return;
      core_.displacements(x, d_);
      options_.onStep({level, step_, d_, f * core_.energyUnit, c.size() ? c.cwiseAbs().maxCoeff() : 0});
    });
    row_.steps += report.steps, row_.outer += report.outer, row_.evaluations += report.evaluations;
    row_.change = state_.x.size() ? (state_.x - before).cwiseAbs().maxCoeff() * core_.size / core_.extent : 0;
    row_.energy = report.value * core_.energyUnit;
    row_.deviation = report.constraint;
    row_.multiplier = state_.multiplier.size() ? state_.multiplier[0] * core_.energyUnit : 0;
    row_.penalty = state_.penalty * core_.energyUnit;
    solved_.iterations += report.steps;
    solved_.converged = report.converged;
    solved_.optimality = report.gradient;
    const bool last = level + 1 == impl_.levels.size();
    if (last || solved_.levels.empty() || !report.converged || !(row_.change < o_.levelChange)) return false;
    core_.displacements(state_.x, d_);
    return volumeError(impl_, level, d_) <= o_.tolerance;
  }

  bool leaveSaddle(Reduced& reduced) {
    const auto direction = saddles_.direction(core_, state_.x, state_.multiplier);
    if (!direction) return false;
    ++solved_.saddles;
    Eigen::VectorXd step = kSaddleStep * *direction;
    core_.projectLinear(step);
    const auto merit = [&](const Eigen::VectorXd& x) {
      Eigen::VectorXd c;
      const double f = reduced.values(x, c);
      ++row_.evaluations;
      return f + state_.multiplier.dot(c) + 0.5 * state_.penalty * c.squaredNorm();
    };
    const double ahead = merit(state_.x + step), behind = merit(state_.x - step);
    if (ahead <= behind + 1e-9 * std::abs(behind)) state_.x += step;
    else state_.x -= step;
    return true;
  }

  const Prepared::Impl& impl_;
  const Core& core_;
  MeshConstraints& fine_;
  const Options& options_;
  const AugmentedLagrangianOptions& o_;
  Progress& progress_;
  SaddleTest saddles_;
  numeric::AugmentedLagrangianState state_;
  LevelReport row_;
  Solved solved_;
  std::vector<Vec3> d_;
  int step_ = 0;
  bool looked_ = false;
};

}  // namespace

Solved solveAugmentedLagrangian(const Prepared::Impl& impl, const Core& core, MeshConstraints& fine, const Options& options, Progress& progress) {
  return Levels(impl, core, fine, options, progress).run();
}

}  // namespace fielddeform::volume::detail
