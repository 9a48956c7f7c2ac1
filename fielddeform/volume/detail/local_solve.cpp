// The loop of the pass: forces, directions, lengths.
#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/volume/detail/local_solve.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace fielddeform::volume::detail {
namespace {

constexpr std::size_t kGrain = 8192;
constexpr double kExact = 1e-15;     // |dV / V| that rounding allows a sum
constexpr double kPolished = 1e-14;  // well below the 1e-12 that is promised
constexpr int kPolishes = 4;

double evaluate(const std::array<double, 4>& c, double t) { return c[0] + t * (c[1] + t * (c[2] + t * c[3])); }

// The root between a and b, where the signs differ: bisection, then Newton steps that stay between.
double rootBetween(const std::array<double, 4>& c, double a, double b) {
  const bool negative = evaluate(c, a) < 0;
  double t = 0.5 * (a + b);
  for (int i = 0; i < 300 && a < t && t < b; ++i) {
    const double f = evaluate(c, t);
    if (f == 0) return t;
    ((f < 0) == negative ? a : b) = t;
    const double next = t - f / (c[1] + t * (2 * c[2] + 3 * t * c[3]));
    if (std::abs(next - t) <= 1e-16 * std::abs(t)) return t;
    t = i % 8 > 2 && next > a && next < b ? next : 0.5 * (a + b);
  }
  return t;
}

double dot(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i].dot(b[i]);
  return sum;
}

Vec3 rigid(int j, const Vec3& fromCentre) {
  return j < 3 ? Vec3(Vec3::Unit(j)) : Vec3(Vec3(Vec3::Unit(j - 3)).cross(fromCentre));
}

}  // namespace

std::optional<double> rootNearest0(const std::array<double, 4>& c) {
  for (const double x : c)
    if (!std::isfinite(x)) return std::nullopt;
  if (c[0] == 0) return 0.0;
  // A root lies within this of 0, if the leading term is what it is. [Cauchy's bound]
  const double lead = c[3] != 0 ? c[3] : c[2] != 0 ? c[2] : c[1];
  if (lead == 0) return std::nullopt;
  const double bound = 1 + std::max({std::abs(c[0] / lead), std::abs(c[1] / lead), std::abs(c[2] / lead)});
  if (!std::isfinite(bound)) return c[1] != 0 ? std::optional<double>(-c[0] / c[1]) : std::nullopt;
  std::array<double, 4> cut{-bound, bound, bound, bound};
  std::size_t cuts = 1;
  // Between the extrema, at the roots of the derivative, the cubic is monotone.
  const double a = 3 * c[3], b = c[2], discriminant = b * b - a * c[1];
  if (discriminant >= 0) {
    const double q = -(b + std::copysign(std::sqrt(discriminant), b));
    for (const double t : {a != 0 ? q / a : bound, q != 0 ? c[1] / q : bound})
      if (t > -bound && t < bound) cut[cuts++] = t;
  }
  cut[cuts++] = bound;
  std::sort(cut.begin(), cut.begin() + static_cast<std::ptrdiff_t>(cuts));
  std::optional<double> best;
  for (std::size_t i = 0; i + 1 < cuts; ++i) {
    const double low = evaluate(c, cut[i]), high = evaluate(c, cut[i + 1]);
    if ((low < 0) == (high < 0) && low != 0 && high != 0) continue;
    const double t = low == 0 ? cut[i] : high == 0 ? cut[i + 1] : rootBetween(c, cut[i], cut[i + 1]);
    if (!best || std::abs(t) < std::abs(*best)) best = t;
  }
  return best;
}

Gauge::Gauge(const LocalParts& parts, const LocalLattice& lattice, const SparseMatrix& surface) {
  for (const LocalPart& part : parts.part)
    centre_ += deterministicReduce(
        part.size(), kGrain, Vec3(Vec3::Zero()),
        [&](std::size_t begin, std::size_t end) {
          Vec3 sum = Vec3::Zero();
          for (std::size_t i = begin; i < end; ++i) sum += part.area[i] * part.base[i];
          return sum;
        },
        [](const Vec3& a, const Vec3& b) { return Vec3(a + b); });
  const std::size_t n = lattice.active.size();
  Eigen::MatrixX3d nodes(static_cast<Eigen::Index>(n), 3);
  for (int j = 0; j < 6; ++j) {
    for (const Vec3& node : lattice.map->restNodes()) nodes_[j].push_back(rigid(j, node - centre_));
    for (std::size_t i = 0; i < n; ++i) nodes.row(static_cast<Eigen::Index>(i)) = nodes_[j][i].transpose();
    const Eigen::MatrixX3d weighted = surface * nodes;
    for (std::size_t i = 0; i < n; ++i) weighted_[j].push_back(weighted.row(static_cast<Eigen::Index>(i)).transpose());
  }
  Eigen::Matrix<double, 6, 6> square;
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j <= i; ++j) square(i, j) = square(j, i) = dot(weighted_[j], nodes_[i]);
  // A straight or single-point part leaves motions undetermined: those are left alone.
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(square);
  Vec6 inverted = Vec6::Zero();
  for (int j = 0; j < 6; ++j)
    if (eigen.eigenvalues()[j] > 1e-12 * eigen.eigenvalues()[5]) inverted[j] = 1 / eigen.eigenvalues()[j];
  inverse_ = eigen.eigenvectors() * inverted.asDiagonal() * eigen.eigenvectors().transpose();
}

Gauge::Vec6 Gauge::work(const LocalPart& part, Points force) const {
  return deterministicReduce(
      force.size(), kGrain, Vec6(Vec6::Zero()),
      [&](std::size_t begin, std::size_t end) {
        Vec6 sum = Vec6::Zero();
        for (std::size_t i = begin; i < end; ++i) {
          sum.head<3>() += force[i];
          sum.tail<3>() += Vec3(part.base[i] - centre_).cross(force[i]);  // f . (e_j x r) = (r x f)_j
        }
        return sum;
      },
      [](const Vec6& a, const Vec6& b) { return Vec6(a + b); });
}

void Gauge::projectForce(const Vec6& work, std::vector<Vec3>& gathered) const {
  const Vec6 k = inverse_ * work;
  for (int j = 0; j < 6; ++j)
    for (std::size_t n = 0; n < gathered.size(); ++n) gathered[n] -= k[j] * weighted_[j][n];
}

void Gauge::projectMove(std::vector<Vec3>& y) const {
  Vec6 work;
  for (int j = 0; j < 6; ++j) work[j] = dot(weighted_[j], y);
  const Vec6 k = inverse_ * work;
  for (int j = 0; j < 6; ++j)
    for (std::size_t n = 0; n < y.size(); ++n) y[n] -= k[j] * nodes_[j][n];
}

LocalSolve::LocalSolve(const LocalEdit& edit, LocalParts& parts, const LocalLattice& lattice, const SparseMatrix& matrix,
                       const SparseMatrix& surface, bool free)
    : edit_(edit), parts_(parts), lattice_(lattice), factor_(matrix), direction_(parts.part.size()),
      lambda_(Eigen::VectorXd::Zero(static_cast<Eigen::Index>(parts.part.size()))), start_(parts.part.size()), x_(parts.part.size()) {
  if (factor_.info() != Eigen::Success) throw InfeasibleError("the volume lattice's equations are singular: use fewer nodes");
  if (free) gauge_.emplace(parts, lattice, surface);
}

void LocalSolve::startAt(Points displacements) {
  Nodes y(displacements.begin(), displacements.end());
  if (gauge_) gauge_->projectMove(y);
  for (std::size_t c = 0; c < parts_.part.size(); ++c) {
    const LocalPart& part = parts_.part[c];
    start_[c].resize(part.size());
    lattice_.map->combine(*part.binding, y, start_[c]);
    for (std::size_t i = 0; i < part.size(); ++i) start_[c][i] += part.base[i];
    x_[c] = {};
  }
}

void LocalSolve::aim() {
  const auto n = static_cast<Eigen::Index>(lattice_.active.size());
  Eigen::MatrixX3d right(n, 3), solved;
  for (std::size_t c = 0; c < parts_.part.size(); ++c) {
    const LocalPart& part = parts_.part[c];
    work_.resize(part.size());
    part.surface->gradient(positionsOf(c), {}, work_);
    parallelFor(part.size(), kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) work_[i] *= part.share[i];
    });
    Nodes& y = direction_[c];
    y.resize(lattice_.active.size());
    lattice_.map->gather(*part.binding, work_, y);
    if (gauge_) gauge_->projectForce(gauge_->work(part, work_), y);
    for (Eigen::Index i = 0; i < n; ++i) right.row(i) = y[static_cast<std::size_t>(i)].transpose();
    solved = factor_.solve(right);
    for (Eigen::Index i = 0; i < n; ++i) y[static_cast<std::size_t>(i)] = solved.row(i).transpose();
    if (gauge_) gauge_->projectMove(y);
  }
}

LocalSolve::Nodes LocalSolve::total(const Eigen::VectorXd& lambda) const {
  Nodes y(lattice_.active.size(), Vec3::Zero());
  for (std::size_t c = 0; c < direction_.size(); ++c)
    for (std::size_t n = 0; n < y.size(); ++n) y[n] += lambda[static_cast<Eigen::Index>(c)] * direction_[c][n];
  return y;
}

void LocalSolve::moveBy(const Nodes& y) {
  for (std::size_t c = 0; c < parts_.part.size(); ++c) {
    const Points start = startOf(c);
    x_[c].resize(start.size());
    lattice_.map->combine(*parts_.part[c].binding, y, x_[c]);
    for (std::size_t i = 0; i < x_[c].size(); ++i) x_[c][i] += start[i];
  }
}

bool LocalSolve::reachOne() {
  const LocalPart& part = parts_.part[0];
  const Points start = startOf(0), before = positionsOf(0);
  work_.resize(part.size());
  lattice_.map->combine(*part.binding, direction_[0], work_);
  std::array<double, 4> cubic = part.surface->alongLine(start, work_);
  cubic[0] -= part.target;
  const auto t = rootNearest0(cubic);
  if (!t) return false;
  lambda_[0] = *t;
  change_ = deterministicReduce(
      part.size(), kGrain, 0.0,
      [&](std::size_t begin, std::size_t end) {
        double square = 0;
        for (std::size_t i = begin; i < end; ++i) {
          work_[i] = start[i] + *t * work_[i];
          square = std::max(square, (work_[i] - before[i]).squaredNorm());
        }
        return std::sqrt(square);
      },
      [](double a, double b) { return std::max(a, b); });
  std::swap(x_[0], work_);
  return true;
}

// Newton's method on the lengths of all components' directions. A component hardly feels another's, so that few steps do.
bool LocalSolve::reachAll() {
  const auto count = static_cast<Eigen::Index>(parts_.part.size());
  std::vector<std::vector<Vec3>> before;
  for (std::size_t c = 0; c < parts_.part.size(); ++c) before.emplace_back(positionsOf(c).begin(), positionsOf(c).end());
  const auto misses = [&](const Eigen::VectorXd& lambda) {
    moveBy(total(lambda));
    Eigen::VectorXd miss(count);
    for (Eigen::Index c = 0; c < count; ++c) {
      const LocalPart& part = parts_.part[static_cast<std::size_t>(c)];
      miss[c] = part.surface->value(x_[static_cast<std::size_t>(c)]) - part.target;
    }
    return miss;
  };
  Eigen::VectorXd scale(count);
  for (Eigen::Index c = 0; c < count; ++c) {
    const LocalPart& part = parts_.part[static_cast<std::size_t>(c)];
    scale[c] = 1 / std::max({std::abs(part.before), std::abs(part.target), 1e-300});
  }
  Eigen::VectorXd miss = misses(lambda_);
  const auto error = [&](const Eigen::VectorXd& m) { return m.cwiseProduct(scale).lpNorm<Eigen::Infinity>(); };
  for (int step = 0; step < 60 && !(error(miss) <= kExact); ++step) {
    Eigen::MatrixXd slope(count, count);
    for (Eigen::Index c = 0; c < count; ++c) {
      const LocalPart& part = parts_.part[static_cast<std::size_t>(c)];
      std::vector<Vec3> gradient(part.size()), nodes(lattice_.active.size());
      part.surface->gradient(x_[static_cast<std::size_t>(c)], {}, gradient);
      lattice_.map->gather(*part.binding, gradient, nodes);
      for (Eigen::Index d = 0; d < count; ++d) slope(c, d) = dot(nodes, direction_[static_cast<std::size_t>(d)]);
    }
    const Eigen::VectorXd full = (scale.asDiagonal() * slope).partialPivLu().solve(miss.cwiseProduct(scale));
    if (!full.allFinite()) break;
    bool better = false;
    for (double share = 1; share > 1e-3 && !better; share *= 0.5) {
      const Eigen::VectorXd next = lambda_ - share * full, there = misses(next);
      if (!(error(there) < error(miss))) continue;
      better = true;
      lambda_ = next, miss = there;
    }
    if (!better) break;
  }
  misses(lambda_);
  change_ = 0;
  for (std::size_t c = 0; c < before.size(); ++c)
    for (std::size_t i = 0; i < before[c].size(); ++i) change_ = std::max(change_, (x_[c][i] - before[c][i]).norm());
  return error(miss) <= 1e-11;  // rounding is left to polish()
}

bool LocalSolve::reach() { return parts_.part.size() == 1 ? reachOne() : reachAll(); }

bool LocalSolve::iterate(int maxIterations, double tolerance, Progress& progress) {
  for (int i = 0; i < maxIterations; ++i) {
    progress.throwIfCancelled();
    aim();
    if (!reach()) return false;
    ++iterations_;
    if (change_ < tolerance * edit_.size) break;
  }
  return true;
}

double LocalSolve::polish(const ComponentVolumes& volumes, std::span<Vec3> displacement) {
  for (int i = 0;; ++i) {
    for (std::size_t c = 0; c < parts_.part.size(); ++c) {
      const LocalPart& part = parts_.part[c];
      const Points x = positionsOf(c);
      parallelFor(part.size(), kGrain, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k)
          if (part.mask[k] > 0) displacement[part.vertex[k]] = x[k] - part.base[k];
      });
    }
    const auto values = volumes.measureDisplaced(displacement);
    double worst = 0;
    for (const auto& value : values) worst = std::max(worst, value.deviation());
    if (worst <= kPolished || i == kPolishes) return worst;
    for (std::size_t c = 0; c < values.size(); ++c) parts_.part[c].target -= values[c].change();
    if (!reach()) return worst;
  }
}

}  // namespace fielddeform::volume::detail
