#include <fielddeform/core/error.h>
#include <fielddeform/numeric/sqp.h>
#include <fielddeform/solid/detail/prepared.h>
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <stdexcept>

namespace fielddeform::solid {

using detail::Matrix, detail::Prepared, detail::SizeProblem, detail::Vector;

namespace {

constexpr Eigen::Index kDense = 120;  // variables up to which the dense solver, which also tells saddles, is as quick
constexpr int kLoadSteps = 12;        // parts of a change of size that does not succeed at once

numeric::SqpOptions sqpOptions(const Options& options, Effort effort) {
  numeric::SqpOptions out;
  out.maxIterations = options.maxIterations;
  out.gradient = effort == Effort::Drag ? 1e-5 : options.optimality;
  out.constraint = effort == Effort::Drag ? 1e-6 : 1e-12;
  return out;
}

/// One solve from x.
numeric::SqpReport minimise(const Prepared& prepared, const Matrix& base, const std::vector<double>& targets, const numeric::SqpOptions& options, Vector& x) {
  SizeProblem problem(prepared, base, targets);
  return problem.variables() <= kDense ? numeric::sqp(problem, x, options) : numeric::sparseSqp(problem, x, options);
}

/// The same; if it fails, the sizes are led to their targets in steps.
numeric::SqpReport minimiseInSteps(const Prepared& prepared, const Matrix& base, const std::vector<double>& targets, const numeric::SqpOptions& options, Vector& x, Progress& progress) {
  const Vector start = x;
  numeric::SqpReport report = minimise(prepared, base, targets, options, x);
  if (report.converged || report.constraint <= 1e-9) return report;
  int iterations = report.iterations;
  x = start;
  SizeProblem at(prepared, base, targets);
  const std::vector<Vec3> points = at.points(x);
  std::vector<double> from;
  for (const std::size_t s : prepared.held) {
    const double v = prepared.sizes.value(s, points);
    from.push_back(v > 0 ? v : prepared.sizes.value(s, prepared.problem.object.points));
  }
  for (int k = 1; k <= kLoadSteps; ++k) {
    progress.throwIfCancelled();
    std::vector<double> now;
    for (std::size_t i = 0; i < targets.size(); ++i) now.push_back(from[i] * std::pow(targets[i] / from[i], static_cast<double>(k) / kLoadSteps));
    report = minimise(prepared, base, k == kLoadSteps ? targets : now, options, x);
    iterations += report.iterations;
    if (!(report.constraint <= 1e-6)) break;
  }
  report.iterations = iterations;
  return report;
}

Outcome outcomeOf(const numeric::SqpReport& report) {
  return report.converged ? Outcome::Converged : report.constraint <= 1e-9 ? Outcome::Limited : Outcome::Unmet;
}

std::string messageOf(const Report& report) {
  if (report.outcome == Outcome::Limited) return "the iterations ran out before the objective was least; sizes and constraints hold";
  if (report.outcome != Outcome::Unmet) return {};
  std::string worst;
  double off = -1;
  for (const SizeReport& s : report.sizes)
    if (s.target && std::abs(s.after / *s.target - 1) > off)
      off = std::abs(s.after / *s.target - 1), worst = fmt::format("solid \"{}\" reaches the size {:.6g} instead of {:.6g}", s.name, s.after, *s.target);
  return fmt::format("no shape was found within the constraints: {}", worst);
}

}  // namespace

void Problem::validate() const {
  object.validate();
  const std::size_t n = object.points.size();
  if (!wanted.empty() && wanted.size() != n) throw std::invalid_argument(fmt::format("wanted: {} points, expected {}", wanted.size(), n));
  for (const Vec3& p : wanted)
    if (!p.allFinite()) throw std::invalid_argument("wanted: a point is not finite");
  objective.validate();
  if (rows.size() > kMaxPoints) throw std::invalid_argument(fmt::format("rows: {}, at most {}", rows.size(), kMaxPoints));
  for (const Row& row : rows) {
    if (!row.value.allFinite()) throw std::invalid_argument(fmt::format("rows: the value of \"{}\" is not finite", row.name));
    for (const auto& [i, c] : row.terms)
      if (i >= n || !std::isfinite(c)) throw std::invalid_argument(fmt::format("rows: \"{}\" has a term out of range", row.name));
  }
  if (!sizes.empty() && sizes.size() != object.solids.size()) throw std::invalid_argument(fmt::format("sizes: {}, expected {}, one a solid", sizes.size(), object.solids.size()));
}

std::string_view toString(Method method) noexcept { return method == Method::Exact ? "exact" : "uzawa"; }
std::string_view toString(Outcome outcome) noexcept {
  return std::array<std::string_view, 3>{"converged", "limited", "unmet"}[static_cast<std::size_t>(outcome)];
}

void Options::validate() const {
  requirePositive("rho1", uzawa.rho1);
  requirePositive("rho2", uzawa.rho2);
  requirePositive("size_tolerance", uzawa.sizeTolerance);
  requirePositive("distance_tolerance", uzawa.distanceTolerance);
  requirePositive("optimality", optimality);
  requireInRange("max_outer", uzawa.maxOuter, 1, 1e6);
  requireInRange("max_inner", uzawa.maxInner, 1, 1e6);
  requireInRange("max_iterations", maxIterations, 1, 1e6);
}

Result solve(const Problem& problem, const Options& options, Progress& progress) {
  options.validate();
  const Prepared prepared(problem);
  const Matrix wanted = detail::matrixOf(prepared.problem.wanted), values = valuesOf(prepared.rows);
  const std::vector<double> targets = detail::checkedTargets(prepared, prepared.problem.sizes);
  const Matrix base = prepared.base(wanted, values);
  progress.throwIfCancelled();
  Result out;
  detail::pointsFrom(base, out.points);
  detail::requireMovable(prepared, out.points);
  if (options.method == Method::Uzawa) {
    out = detail::uzawa(prepared, wanted, values, targets, options.uzawa, progress);
  } else if (!targets.empty()) {
    Vector x = Vector::Zero(3 * prepared.freePoints());
    SizeProblem at(prepared, base, targets);
    Vector c;
    at.values(x, c);
    // What was as wanted already keeps its bits.
    const bool moved = base != wanted || !(c.cwiseAbs().maxCoeff() <= 1e-15);
    numeric::SqpReport report;
    report.converged = true;
    if (moved) {
      report = minimiseInSteps(prepared, base, targets, sqpOptions(options, Effort::Release), x, progress);
      out.points = at.points(x);
    }
    out.report.iterations = report.iterations, out.report.inner = report.inner;
    out.report.optimality = report.gradient;
    out.report.outcome = outcomeOf(report);
  }
  detail::describeResult(prepared, wanted, values, prepared.problem.sizes, out);
  if (out.report.message.empty()) out.report.message = messageOf(out.report);
  return out;
}

struct Session::Impl {
  Prepared prepared;
  Options options;
  Matrix wanted, values;
  std::vector<std::optional<double>> sizes;
  std::vector<Vec3> points;
  Report report;

  Impl(const Problem& problem, const Options& o) : prepared(problem), options(o), wanted(detail::matrixOf(prepared.problem.wanted)), values(valuesOf(prepared.rows)), sizes(prepared.problem.sizes) {
    options.validate();
    detail::checkedTargets(prepared, sizes);
    detail::pointsFrom(prepared.base(wanted, values), points);
    detail::requireMovable(prepared, points);
  }
};

Session::Session(const Problem& problem, const Options& options) : impl_(std::make_unique<Impl>(problem, options)) {}
Session::~Session() = default;
Session::Session(Session&&) noexcept = default;
Session& Session::operator=(Session&&) noexcept = default;

void Session::setWanted(Points wanted) {
  if (wanted.size() != impl_->points.size()) throw std::invalid_argument(fmt::format("wanted: {} points, expected {}", wanted.size(), impl_->points.size()));
  for (const Vec3& p : wanted)
    if (!p.allFinite()) throw std::invalid_argument("wanted: a point is not finite");
  impl_->wanted = detail::matrixOf(wanted);
}

void Session::setValues(std::span<const Vec3> values) {
  const std::size_t own = impl_->prepared.problem.rows.size();
  if (values.size() != own) throw std::invalid_argument(fmt::format("values: {}, expected {}", values.size(), own));
  Matrix next = impl_->values;
  for (std::size_t r = 0; r < own; ++r) {
    if (!values[r].allFinite()) throw std::invalid_argument("values: one is not finite");
    next.row(static_cast<Eigen::Index>(r)) = values[r].transpose();
  }
  impl_->prepared.space.solve(impl_->prepared.rows, next, impl_->prepared.size);
  impl_->values = next;
}

void Session::setSizes(std::span<const std::optional<double>> sizes) {
  std::vector<std::optional<double>> next(sizes.begin(), sizes.end());
  detail::checkedTargets(impl_->prepared, next);
  impl_->sizes = std::move(next);
}

const std::vector<Vec3>& Session::solve(Effort effort) {
  Impl& s = *impl_;
  const Matrix base = s.prepared.base(s.wanted, s.values);
  s.report = {};
  Progress silent;
  if (effort == Effort::Edit || s.prepared.held.empty()) {
    detail::pointsFrom(base, s.points);
  } else {
    const std::vector<double> targets = detail::checkedTargets(s.prepared, s.sizes);
    Vector x = s.prepared.variables(base, s.points);
    const numeric::SqpReport report = minimiseInSteps(s.prepared, base, targets, sqpOptions(s.options, effort), x, silent);
    s.points = SizeProblem(s.prepared, base, targets).points(x);
    s.report.iterations = report.iterations, s.report.inner = report.inner;
    s.report.optimality = report.gradient;
    s.report.outcome = outcomeOf(report);
    if (effort == Effort::Drag && report.constraint <= 1e-6) s.report.outcome = Outcome::Converged;
  }
  Result result{std::move(s.points), std::move(s.report)};
  detail::describeResult(s.prepared, s.wanted, s.values, s.sizes, result);
  result.report.message = effort == Effort::Edit ? "" : messageOf(result.report);
  s.points = std::move(result.points), s.report = std::move(result.report);
  return s.points;
}

const Report& Session::report() const noexcept { return impl_->report; }

}  // namespace fielddeform::solid
