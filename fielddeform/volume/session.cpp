#include <fielddeform/core/error.h>
#include <fielddeform/numeric/sqp.h>
#include <fielddeform/volume/detail/prepared.h>
#include <fmt/format.h>

namespace fielddeform::volume {

using namespace detail;

struct Session::Impl {
  Prepared prepared;
  Options options;
  std::unique_ptr<FormConstraints> form;  ///< null: the volumes are taken on the mesh
  std::unique_ptr<MeshConstraints> mesh;
  std::vector<double> targets;
  Eigen::VectorXd x;
  std::vector<Vec3> start, displacements;
  Report report;

  Impl(const Prepared& p, const Options& o) : prepared(p), options(o) {
    options.validate();
    const Prepared::Impl& impl = *prepared.impl();
    if (impl.free.empty()) throw InfeasibleError("all nodes are pinned: nothing is left to move");
    makeForm();
    report.size = impl.extent;
  }

  void makeForm() {
    const Prepared::Impl& impl = *prepared.impl();
    const std::size_t last = impl.levels.size() - 1;
    const auto volumes = impl.targets(last, targets);
    mesh = std::make_unique<MeshConstraints>(impl.fine(), volumes, impl.problem.constraints.moments, impl.extent);
    if (form) form->retarget(volumes);
    else if (impl.problem.constraints.moments.empty() && impl.rowOf.size() <= kFormNodes && impl.fine().basis())
      form = std::make_unique<FormConstraints>(FormConstraints::ofMesh(impl.fine(), impl.problem.map->restNodes(), volumes));
  }
};

Session::Session(const Prepared& prepared, const Options& options) : impl_(std::make_unique<Impl>(prepared, options)) {}
Session::~Session() = default;
Session::Session(Session&&) noexcept = default;
Session& Session::operator=(Session&&) noexcept = default;

const std::vector<Vec3>& Session::solve(Points displacements, std::span<const double> targets) {
  Impl& s = *impl_;
  const Prepared::Impl& impl = *s.prepared.impl();
  if (displacements.size() != impl.rowOf.size())
    throw std::invalid_argument(fmt::format("displacements: {} nodes, expected {}", displacements.size(), impl.rowOf.size()));
  for (const Vec3& d : displacements)
    if (!d.allFinite()) throw std::invalid_argument("displacements: one is not finite");
  if (!targets.empty()) {
    if (targets.size() != impl.fine().volume().regionCount()) throw std::invalid_argument("targets: expected one a region");
    s.targets.assign(targets.begin(), targets.end());
    s.makeForm();
  }
  s.start.assign(displacements.begin(), displacements.end());
  const Core core = impl.core(s.start);
  if (s.x.size() == 0) s.x = core.variablesOf(s.start);
  NodeConstraints& constraints = s.form ? static_cast<NodeConstraints&>(*s.form) : *s.mesh;
  Reduced reduced(core, constraints, constraints, LinearMode::AsConstraints);
  numeric::SqpOptions options;
  options.maxIterations = s.options.exact.maxIterations;
  options.gradient = s.options.exact.gradient, options.constraint = s.options.exact.deviation;
  options.maxSaddles = s.options.exact.maxSaddles;
  const auto done = core.variables() <= kDenseVariables ? numeric::sqp(reduced, s.x, options) : numeric::sparseSqp(reduced, s.x, options);
  s.report.iterations = done.iterations, s.report.saddles = done.saddles;
  s.report.optimality = done.gradient;
  s.report.energy = done.value * impl.energyUnit;
  s.report.outcome = done.converged ? Outcome::Converged : done.constraint <= 1e-9 ? Outcome::Limited : Outcome::Unmet;
  core.displacements(s.x, s.displacements);
  return s.displacements;
}

const Report& Session::report() const noexcept { return impl_->report; }

Result Session::finish(Progress& progress) {
  Impl& s = *impl_;
  progress.throwIfCancelled();
  if (s.displacements.empty()) throw std::invalid_argument("finish: nothing has been solved yet");
  const Prepared::Impl& impl = *s.prepared.impl();
  const Core core = impl.core(s.start);
  Result out;
  out.report = s.report;
  out.report.projection = projectOnto(core, *s.mesh, s.x);
  core.displacements(s.x, out.displacements);
  impl.fine().positions(out.displacements, out.positions);
  const auto after = impl.fine().volume().values(out.positions);
  for (std::size_t r = 0; r < after.size(); ++r) {
    const double wanted = impl.wantedVolume(r, s.targets);
    out.report.volumes.push_back({impl.baseVolume.back()[r], after[r], wanted, after[r]});
  }
  return out;
}

}  // namespace fielddeform::volume
