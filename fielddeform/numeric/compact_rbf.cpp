#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/numeric/compact_rbf.h>
#include <fielddeform/numeric/detail/cell_list.h>
#include <fielddeform/numeric/detail/cholesky.h>
#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace fielddeform::numeric {
namespace {

using detail::CellList;

constexpr double kMerge = 1e-9;   // centres closer than this, of the extent, are one
constexpr double kFlat = 1e-9;    // thinner than this, of the greatest spread: a plane or a line
constexpr double kCoarsest = 1;   // spacing of the first level, of half the extent
constexpr int kMostLevels = 24;
constexpr double kLoose = 1e-2;   // a coarse level need not do better than this share of what it was given
// With r the distance, s a support: phi(r / s) = 1 - 10 (r / s)^2 + 20 (r / s)^3 - ..., so that s^3 / 20 phi is r^3 to what is
// fine. Both fall off as the sixth power of the frequency.
constexpr double kCubic = 20;
constexpr double kWiden = 4;      // of the first level's support where there is smoothing: it is to be r^3 to all that fits in
constexpr double kSpent = 100;    // a level that the smoothing holds back so much takes nothing, nor do finer ones
constexpr double kSmoothSolved = 1e-5;  // of the gradient at weights 0
constexpr std::size_t kGrain = 256;

void requireInput(Points centres, std::span<const double> values, const CompactRbfOptions& o) {
  if (centres.size() != values.size())
    throw std::invalid_argument(fmt::format("values: {} given, expected {}, one a centre", values.size(), centres.size()));
  if (centres.empty()) throw std::invalid_argument("centres: none given, needs at least 1");
  if (centres.size() >= kNoIndex) throw std::invalid_argument(fmt::format("centres: {} are too many", centres.size()));
  requireInRange("smoothing", o.smoothing, 0, 1e12);
  requirePositive("tolerance", o.tolerance);
  requireInRange("support", o.support, 1.5, 8);
  requireInRange("maxIterations", o.maxIterations, 1, 1e6);
  for (std::size_t i = 0; i < centres.size(); ++i) {
    if (!centres[i].allFinite()) throw std::invalid_argument(fmt::format("centres: point {} is not finite", i));
    if (!std::isfinite(values[i])) throw std::invalid_argument(fmt::format("values: value {} is not finite", i));
  }
}

double kernel(double t) {
  const double u = 1 - t, u2 = u * u;
  return t < 1 ? u2 * u2 * (4 * t + 1) : 0;
}

double greatest(const std::vector<double>& x) {
  double most = 0;
  for (const double v : x) most = std::max(most, std::abs(v));
  return most;
}

// One level: kernels of one support on a subset of the centres.
struct Level {
  CellList cells;
  std::vector<double> weight = {};  // in the cells' order
  double support;
  std::vector<Index> centre = {};   // which they are, likewise
};

// A sparse matrix by rows.
template <class T>
struct Rows {
  std::vector<std::size_t> begin;
  std::vector<Index> column;
  std::vector<T> value;

  /// @param entries  calls its second argument with (column, value) for all entries of a row, the same each time
  template <class Entries>
  Rows(std::size_t n, const Entries& entries) : begin(n + 1, 0) {
    parallelFor(n, kGrain, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) entries(i, [&](std::size_t, double) { ++begin[i + 1]; });
    });
    for (std::size_t i = 0; i < n; ++i) begin[i + 1] += begin[i];
    column.resize(begin[n]);
    value.resize(begin[n]);
    parallelFor(n, kGrain, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) {
        std::size_t at = begin[i];
        entries(i, [&](std::size_t j, double v) {
          column[at] = static_cast<Index>(j);
          value[at++] = static_cast<T>(v);
        });
      }
    });
  }
  void multiply(const std::vector<double>& x, std::vector<double>& y) const {
    parallelFor(begin.size() - 1, kGrain, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) {
        double sum = 0;
        for (std::size_t k = begin[i]; k < begin[i + 1]; ++k) sum += static_cast<double>(value[k]) * x[column[k]];
        y[i] = sum;
      }
    });
  }
};

// Kernels against each other.
Rows<double> symmetricMatrix(const CellList& cells, double support, double diagonal) {
  return {cells.size(), [&](std::size_t i, auto&& take) {
    cells.forEachNear(cells.point(i), support, [&](std::size_t j, const Vec3&, double r2) {
      take(j, kernel(std::sqrt(r2) / support) + (i == j ? diagonal : 0));
    });
  }};
}

// Conjugate gradients until every residual is within the tolerance. @param multiply  the matrix: y = A x. @return iterations
template <class Multiply>
int solve(const Multiply& multiply, const std::vector<double>& b, std::vector<double>& x, double tolerance, int most) {
  const std::size_t n = b.size();
  std::vector<double> r = b, p = b, q(n);
  x.assign(n, 0.0);
  double rho = detail::dot(r.data(), r.data(), n);
  int k = 0;
  for (; k < most && rho > 0 && greatest(r) > tolerance; ++k) {
    multiply(p, q);
    const double curvature = detail::dot(p.data(), q.data(), n);
    if (!(curvature > 0)) break;  // not positive definite to rounding: what there is, is the best
    const double alpha = rho / curvature;
    for (std::size_t i = 0; i < n; ++i) x[i] += alpha * p[i], r[i] -= alpha * q[i];
    const double next = detail::dot(r.data(), r.data(), n);
    for (std::size_t i = 0; i < n; ++i) p[i] = r[i] + next / rho * p[i];
    rho = next;
  }
  return k;
}

}  // namespace

struct CompactRbf::Impl {
  Vec3 origin = Vec3::Zero();
  double scale = 1;             // power of two; q = (p - origin) * scale
  double constant = 0;
  Vec3 linear = Vec3::Zero();   // by q
  std::vector<Level> levels;
  CompactRbfReport report;

  std::vector<Vec3> centre;     // distinct, normalised
  std::vector<double> left;     // what the levels so far leave

  void normalize(Points centres, std::span<const double> values);
  void fitLinear();
  void addLevels(const CompactRbfOptions& options);
  void interpolate(Level& level, double diagonal, bool last, const CompactRbfOptions& options);
  bool approximate(Level& level, double ridge, const CompactRbfOptions& options);
  double at(const Vec3& q, Vec3& gradient) const;
};

void CompactRbf::Impl::normalize(Points centres, std::span<const double> values) {
  report.centres = centres.size();
  Box box;
  for (const Vec3& c : centres) box.extend(c);
  origin = 0.5 * box.min() + 0.5 * box.max();
  const double extent = (box.max() * 0.5 - box.min() * 0.5).maxCoeff();
  if (extent > 0) scale = std::ldexp(1.0, -std::clamp(std::ilogb(extent), -1022, 1022));
  std::vector<Vec3> all(centres.size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = (centres[i] - origin) * scale;
  const std::vector<Index> group = detail::mergeNear(all, kMerge);
  std::vector<Index> number(all.size(), kNoIndex);
  std::vector<double> count;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (group[i] == i) {
      number[i] = static_cast<Index>(centre.size());
      centre.push_back(all[i]);
      left.push_back(0);
      count.push_back(0);
    }
    left[number[group[i]]] += values[i];
    ++count[number[group[i]]];
  }
  for (std::size_t g = 0; g < centre.size(); ++g) left[g] /= count[g];
  report.distinct = centre.size();
}

void CompactRbf::Impl::fitLinear() {
  const double n = static_cast<double>(centre.size());
  Vec3 mean = Vec3::Zero(), product = Vec3::Zero();
  double average = 0;
  for (std::size_t i = 0; i < centre.size(); ++i) mean += centre[i] / n, average += left[i] / n;
  Mat3 covariance = Mat3::Zero();
  for (std::size_t i = 0; i < centre.size(); ++i) {
    const Vec3 d = centre[i] - mean;
    covariance += d * d.transpose();
    product += (left[i] - average) * d;
  }
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(covariance);
  const double flat = kFlat * solver.eigenvalues()[2];
  for (int k = 0; k < 3; ++k) {
    const Vec3 axis = solver.eigenvectors().col(k);
    if (solver.eigenvalues()[k] > flat) linear += axis * (axis.dot(product) / solver.eigenvalues()[k]);
  }
  constant = average - linear.dot(mean);
  for (std::size_t i = 0; i < centre.size(); ++i) left[i] -= constant + linear.dot(centre[i]);
}

void CompactRbf::Impl::addLevels(const CompactRbfOptions& options) {
  double spacing = kCoarsest;
  std::vector<Index> chosen;
  bool last = false;
  for (int k = 0; k < kMostLevels && !last && greatest(left) > options.tolerance; ++k, spacing /= 2) {
    // Each level holds the one before it and what stands far enough from all that it holds.
    chosen = detail::thin(centre, spacing, std::move(chosen));
    last = chosen.size() == centre.size() || k + 1 == kMostLevels;
    std::vector<Vec3> points(chosen.size());
    for (std::size_t i = 0; i < chosen.size(); ++i) points[i] = centre[chosen[i]];
    const double support = options.support * spacing * (k == 0 && options.smoothing > 0 ? kWiden : 1);
    levels.push_back({CellList(points, support), {}, support});
    Level& level = levels.back();
    for (std::size_t i = 0; i < chosen.size(); ++i) level.centre.push_back(chosen[level.cells.original(i)]);
    report.terms += chosen.size();
    const double ridge = options.smoothing * kCubic / (support * support * support);
    if (options.smoothing > 0 && chosen.size() < centre.size()) last = !approximate(level, ridge, options) || last;
    else interpolate(level, ridge, last, options);
  }
  report.levels = static_cast<int>(levels.size());
}

// The level's kernels meet what is left at its own centres; with a diagonal at all of them (the last level) they are the
// minimum that approximate() looks for.
void CompactRbf::Impl::interpolate(Level& level, double diagonal, bool last, const CompactRbfOptions& options) {
  std::vector<double> wanted;
  for (const Index i : level.centre) wanted.push_back(left[i]);
  const Rows<double> matrix = symmetricMatrix(level.cells, level.support, diagonal);
  const double tolerance = 0.5 * options.tolerance;
  report.iterations += solve([&](const auto& x, auto& y) { matrix.multiply(x, y); }, wanted, level.weight,
                             last ? tolerance : std::max(tolerance, kLoose * greatest(wanted)), options.maxIterations);
  parallelFor(centre.size(), kGrain, [&](std::size_t first, std::size_t end) {
    for (std::size_t i = first; i < end; ++i)
      level.cells.forEachNear(centre[i], level.support, [&](std::size_t j, const Vec3&, double r2) {
        left[i] -= level.weight[j] * kernel(std::sqrt(r2) / level.support);
      });
  });
}

// Smoothing: the level's kernels take of what is left at all centres what makes
//   sum_i (left_i - sum_j w_j phi_ij)^2 + ridge sum_jk w_j phi_jk w_k
// least, so that each weighs many centres. @return whether finer levels may have something to take
bool CompactRbf::Impl::approximate(Level& level, double ridge, const CompactRbfOptions& options) {
  const double s = level.support;
  const CellList all(centre, s);
  const Rows<float> down(centre.size(), [&](std::size_t i, auto&& take) {
    level.cells.forEachNear(centre[i], s, [&](std::size_t j, const Vec3&, double r2) { take(j, kernel(std::sqrt(r2) / s)); });
  });
  const Rows<float> up(level.cells.size(), [&](std::size_t j, auto&& take) {
    all.forEachNear(level.cells.point(j), s, [&](std::size_t i, const Vec3&, double r2) { take(all.original(i), kernel(std::sqrt(r2) / s)); });
  });
  const Rows<double> own = symmetricMatrix(level.cells, s, 0);
  const std::size_t m = level.cells.size();
  std::vector<double> values(centre.size()), penalty(m), wanted(m);
  up.multiply(left, wanted);
  const auto multiply = [&](const std::vector<double>& x, std::vector<double>& y) {
    down.multiply(x, values);
    up.multiply(values, y);
    own.multiply(x, penalty);
    for (std::size_t j = 0; j < m; ++j) y[j] += ridge * penalty[j];
  };
  report.iterations += solve(multiply, wanted, level.weight, kSmoothSolved * greatest(wanted), options.maxIterations);
  down.multiply(level.weight, values);
  for (std::size_t i = 0; i < left.size(); ++i) left[i] -= values[i];
  double most = 0;  // of the first term, for one kernel
  for (std::size_t j = 0; j < m; ++j) {
    double sum = 0;
    for (std::size_t k = up.begin[j]; k < up.begin[j + 1]; ++k) sum += static_cast<double>(up.value[k]) * static_cast<double>(up.value[k]);
    most = std::max(most, sum);
  }
  return ridge < kSpent * most;
}

double CompactRbf::Impl::at(const Vec3& q, Vec3& gradient) const {
  double value = constant + linear.dot(q);
  gradient = linear;
  for (const Level& level : levels) {
    const double s = 1 / level.support;
    level.cells.forEachNear(q, level.support, [&](std::size_t j, const Vec3& offset, double r2) {
      const double t = std::sqrt(r2) * s, u = 1 - t, u3 = u * u * u, w = level.weight[j];
      value += w * (u3 * u * (4 * t + 1));
      gradient -= (20 * s * s * w * u3) * offset;  // phi' = -20 t (1 - t)^3
    });
  }
  return value;
}

CompactRbf::CompactRbf(Points centres, std::span<const double> values, const CompactRbfOptions& options)
    : impl_(std::make_unique<Impl>()) {
  requireInput(centres, values, options);
  impl_->normalize(centres, values);
  impl_->fitLinear();
  impl_->addLevels(options);
  impl_->report.residual = greatest(impl_->left);
}
CompactRbf::~CompactRbf() = default;
CompactRbf::CompactRbf(CompactRbf&&) noexcept = default;
CompactRbf& CompactRbf::operator=(CompactRbf&&) noexcept = default;

const CompactRbfReport& CompactRbf::report() const noexcept { return impl_->report; }

double CompactRbf::evaluate(const Vec3& point, Vec3& gradient) const {
  const double value = impl_->at((point - impl_->origin) * impl_->scale, gradient);
  gradient *= impl_->scale;
  return value;
}

}  // namespace fielddeform::numeric
