#include <fielddeform/core/random.h>
#include <fielddeform/numeric/sqp.h>
#include <fielddeform/volume/detail/prepared.h>
#include <fielddeform/volume/detail/saddle.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

namespace fielddeform::volume::detail {
namespace {

constexpr std::size_t kCoarseTriangles = 256;   // of the first grid, at least,
constexpr std::size_t kCoarseShare = 64;        // and as many as the surface has over this: fewer evaluations of a large mesh
constexpr std::size_t kDirectTriangles = 1500;  // below, a coarse copy saves nothing
constexpr std::size_t kFormEntries = 16u << 20; // basis entries from which a form is still built
constexpr std::size_t kCheapForm = 20;          // nodes of a form that costs less than the four evaluations of two grids

/// One surface with its constraints, by the form where there is one.
struct Grid {
  std::unique_ptr<MeshModel> own;  ///< made here, not one of the problem's levels
  const MeshModel* model = nullptr;
  std::unique_ptr<NodeConstraints> constraints;
};

class ExactSolve {
 public:
  ExactSolve(const Prepared::Impl& impl, Points start, MeshConstraints& fine, const Options& options, Progress& progress)
      : impl_(impl), fine_(fine), options_(options), progress_(progress), start_(start.begin(), start.end()) {
    dense_ = 3 * static_cast<Eigen::Index>(impl.free.size()) <= kDenseVariables;
    // Pinned nodes are part of the base, unless they move in parts.
    fixed_ = options.exact.loadSteps == 1 && impl.free.size() + 3 < impl.rowOf.size();
    formNodes_ = fixed_ ? impl.free.size() + 3 : impl.rowOf.size();
    form_ = impl.problem.constraints.moments.empty() && formNodes_ <= kFormNodes;
  }

  Solved run() {
    const bool twoGrid = useTwoGrids();
    if (!twoGrid && canFormFine()) {
      Grid form = fineForm();
      Eigen::VectorXd x = firstSolve(*form.constraints, *form.constraints, tolerance(1), impl_.levels.size() - 1, fineVolumes());
      solved_.x = std::move(x);
      return std::move(solved_);
    }
    std::optional<Grid> coarse;
    Eigen::VectorXd x;
    if (twoGrid) {
      coarse = coarseGrid();
      // Where the coarse copy is a caricature (thin parts merged), the first solve is left out.
      x = faithful_ ? firstSolve(*coarse->constraints, *coarse->constraints, tolerance(1e4), coarseLevel_, {coarseTargets_, coarseBase_}) : impl_.core(start_).variablesOf(start_);
    } else {
      x = impl_.core(start_).variablesOf(start_);
    }
    if (!twoGrid || !faithful_) {
      NodeConstraints& curvature = twoGrid ? *coarse->constraints : fine_;
      x = firstSolve(fine_, curvature, tolerance(1), impl_.levels.size() - 1, fineVolumes());
    }
    const Core core = impl_.core(start_);
    auto polish = [&](NodeConstraints& values, NodeConstraints& curvature) {
      numeric::SqpOptions last = tolerance(1);
      last.lookForSaddles = !twoGrid || !faithful_;  // with the same second derivatives as in the first solve
      return minimize(core, values, curvature, x, last, impl_.levels.size() - 1);
    };
    numeric::SqpReport report = polish(fine_, twoGrid ? *coarse->constraints : fine_);
    if (!report.converged && twoGrid) {  // second derivatives of the coarse copy were not good enough
      if (canFormFine()) {
        Grid form = fineForm();
        report = polish(*form.constraints, *form.constraints);
      } else {
        report = polish(fine_, fine_);
      }
    }
    note(report);
    solved_.x = std::move(x);
    return std::move(solved_);
  }

 private:
  /// Target volumes, and what the same surface's regions have at d = 0.
  struct Volumes {
    std::vector<VolumeTarget> target;
    std::vector<double> base;

    /// Part of the way from these to the targets.
    std::vector<VolumeTarget> at(double load) const {
      std::vector<VolumeTarget> out = target;
      for (VolumeTarget& t : out) t.target = base[t.region] + load * (t.target - base[t.region]);
      return out;
    }
  };
  Volumes fineVolumes() const { return {impl_.targets(impl_.levels.size() - 1), impl_.baseVolume.back()}; }

  numeric::SqpOptions tolerance(double factor) const {
    numeric::SqpOptions out;
    out.maxIterations = options_.exact.maxIterations;
    out.gradient = factor * options_.exact.gradient;
    out.constraint = std::min(1e-6, factor * options_.exact.deviation);
    out.maxSaddles = options_.exact.maxSaddles;
    // Lengths are norms over all variables: more nodes, longer vectors for the same move of each.
    const double growth = dense_ ? 1 : std::sqrt(std::max(1.0, static_cast<double>(impl_.free.size()) / 27));
    out.radius *= growth, out.saddleStep *= growth;
    return out;
  }

  bool useTwoGrids() const {
    if (options_.exact.grids != Grids::Auto) return options_.exact.grids == Grids::Two;
    const bool small = impl_.fine().triangles() <= kDirectTriangles;
    return !(small && (form_ || dense_)) && !(canFormFine() && formNodes_ <= kCheapForm);
  }
  bool canFormFine() const {
    return form_ && impl_.fine().basis() && impl_.fine().base().size() * impl_.rowOf.size() <= kFormEntries;
  }
  std::unique_ptr<NodeConstraints> formOf(const MeshModel& model, std::vector<VolumeTarget> targets) {
    if (!fixed_) return std::make_unique<FormConstraints>(FormConstraints::ofMesh(model, impl_.problem.map->restNodes(), std::move(targets)));
    std::vector<Vec3> own;
    const bool fine = &model == &impl_.fine();
    if (!fine) model.positions(start_, own);
    return std::make_unique<FormConstraints>(FormConstraints::ofFree(model, fine ? fine_.positions(start_) : own, start_, impl_.free, std::move(targets)));
  }
  Grid fineForm() {
    Grid g;
    g.model = &impl_.fine();
    g.constraints = formOf(*g.model, impl_.targets(impl_.levels.size() - 1));
    return g;
  }

  /// The problem's first level of enough triangles, else the surface with its vertices merged.
  Grid coarseGrid() {
    Grid g;
    const std::size_t least = std::max(kCoarseTriangles, impl_.fine().triangles() / kCoarseShare);
    g.model = coarseLevel(impl_, least, coarseLevel_);
    if (!g.model) {
      const std::size_t vertices = std::clamp<std::size_t>(std::max(4 * impl_.rowOf.size(), least / 2), 200, 2000);
      g.own = std::make_unique<MeshModel>(clustered(*impl_.problem.map, impl_.problem.surface, impl_.fine(), vertices, impl_.problem.rims));
      g.model = g.own.get();
      coarseLevel_ = impl_.levels.size() - 1;
    }
    coarseBase_ = g.own ? g.model->volume().values(g.model->base()) : impl_.baseVolume[coarseLevel_];
    coarseTargets_ = coarseTargets(impl_, coarseBase_, faithful_);
    if (!impl_.problem.constraints.moments.empty()) faithful_ = faithful_ && !g.own;
    if (form_) g.constraints = formOf(*g.model, coarseTargets_);
    else g.constraints = std::make_unique<MeshConstraints>(*g.model, coarseTargets_, impl_.problem.constraints.moments, impl_.extent);
    return g;
  }

  numeric::SqpReport minimize(const Core& core, NodeConstraints& values, NodeConstraints& curvature, Eigen::VectorXd& x,
                              const numeric::SqpOptions& options, std::size_t level) {
    Reduced reduced(core, values, curvature, LinearMode::AsConstraints);
    int step = 0;
    std::vector<Vec3> d;
    const numeric::SqpStep each = [&](const Eigen::VectorXd& at, double f, const Eigen::VectorXd& c) {
      progress_.throwIfCancelled();
      if (!options_.onStep) return;
      core.displacements(at, d);
      const Eigen::Index volumes = std::min<Eigen::Index>(values.count(), c.size());
      options_.onStep({level, ++step, d, f * core.energyUnit, volumes ? c.head(volumes).cwiseAbs().maxCoeff() : 0});
    };
    return dense_ ? numeric::sqp(reduced, x, options, each) : numeric::sparseSqp(reduced, x, options, each);
  }

  /// From the start, or from jittered ones, in parts of the load: the least energy among those that converged.
  Eigen::VectorXd firstSolve(NodeConstraints& values, NodeConstraints& curvature, const numeric::SqpOptions& options, std::size_t level,
                             const Volumes& volumes) {
    const Core core = impl_.core(start_);
    Eigen::VectorXd best;
    double bestEnergy = 0;
    numeric::SqpReport bestReport;
    for (int s = 0; s < options_.exact.starts; ++s) {
      Eigen::VectorXd x = options_.exact.loadSteps > 1 && s == 0 ? loaded(values, curvature, options, level, volumes) : core.variablesOf(start_);
      if (s > 0) {
        const double width = options_.exact.jitter * impl_.extent / impl_.size;
        for (Eigen::Index k = 0; k < x.size(); ++k)
          x[k] += width * (2 * uniform01(options_.exact.seed + static_cast<std::uint64_t>(s), static_cast<std::uint64_t>(k)) - 1);
      }
      core.meetLinear(x);
      const numeric::SqpReport report = minimize(core, values, curvature, x, options, level);
      solved_.iterations += report.iterations, solved_.saddles += report.saddles;
      const bool met = report.constraint <= 1e-6;
      solved_.starts.push_back({report.value * impl_.energyUnit, report.iterations, report.saddles,
                                report.converged ? Outcome::Converged : met ? Outcome::Limited : Outcome::Unmet});
      const bool better = best.size() == 0 || (met && bestReport.constraint > 1e-6) || (met && report.value < bestEnergy);
      if (better) best = x, bestEnergy = report.value, bestReport = report;
    }
    solved_.converged = bestReport.converged;
    solved_.optimality = bestReport.gradient;
    if (bestReport.saddle) solved_.message = "a direction of descent is left: more saddles than the bound";
    return best;
  }

  /// The pinned nodes, targets and volumes are applied in parts, each solved from the one before.
  Eigen::VectorXd loaded(NodeConstraints& values, NodeConstraints& curvature, const numeric::SqpOptions& options, std::size_t level,
                         const Volumes& volumes) {
    Eigen::VectorXd x;
    const int parts = options_.exact.loadSteps;
    for (int k = 1; k < parts; ++k) {
      const double load = static_cast<double>(k) / parts;
      std::vector<Vec3> part(start_);
      for (Vec3& d : part) d *= load;
      const Core core = impl_.core(part, load);
      values.retarget(volumes.at(load));
      if (k == 1) x = core.variablesOf(part);
      core.meetLinear(x);
      const numeric::SqpReport report = minimize(core, values, curvature, x, options, level);
      solved_.iterations += report.iterations, solved_.saddles += report.saddles;
    }
    values.retarget(volumes.target);
    return x;
  }

  void note(const numeric::SqpReport& report) {
    solved_.converged = report.converged;
    solved_.optimality = report.gradient;
    solved_.iterations += report.iterations, solved_.saddles += report.saddles;
  }

  const Prepared::Impl& impl_;
  MeshConstraints& fine_;
  const Options& options_;
  Progress& progress_;
  std::vector<Vec3> start_;
  bool dense_ = true, form_ = true, fixed_ = false, faithful_ = true;
  std::size_t formNodes_ = 0;
  std::size_t coarseLevel_ = 0;
  std::vector<VolumeTarget> coarseTargets_;
  std::vector<double> coarseBase_;  ///< a region: the coarse copy's volume at d = 0
  Solved solved_;
};

}  // namespace

Solved solveExact(const Prepared::Impl& impl, Points start, MeshConstraints& fine, const Options& options, Progress& progress) {
  return ExactSolve(impl, start, fine, options, progress).run();
}

}  // namespace fielddeform::volume::detail
