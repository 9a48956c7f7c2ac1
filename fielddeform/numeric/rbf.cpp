#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/numeric/detail/cholesky.h>
#include <fielddeform/numeric/detail/cubic_many.h>
#include <fielddeform/numeric/detail/cubic_sum.h>
#include <fielddeform/numeric/rbf.h>
#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace fielddeform::numeric {
namespace {

constexpr double kMerge = 1e-9;  // centres closer than this, of the extent, are one
constexpr double kFlat = 1e-9;   // thinner than this, of the greatest spread: a plane or a line
constexpr std::size_t kLanes = detail::kCubicLanes;
constexpr std::size_t kManyPoints = std::size_t{1} << 17, kManyCentres = 256;  // fewer are quicker one by one
constexpr double kSlopeTolerance = 10;  // of gradients, in those of values

using Column = std::vector<double>;

void requireInput(Points centres, Points values, const RbfOptions& o) {
  if (centres.size() != values.size())
    throw std::invalid_argument(fmt::format("values: {} given, expected {}, one a centre", values.size(), centres.size()));
  if (centres.empty()) throw std::invalid_argument("centres: none given, needs at least 1");
  if (centres.size() > o.maxCentres)
    throw std::invalid_argument(fmt::format("centres: {} given, must be <= {}", centres.size(), o.maxCentres));
  if (!std::isfinite(o.smoothing) || !(o.smoothing >= 0))
    throw std::invalid_argument(fmt::format("smoothing is {}, must be finite and >= 0", o.smoothing));
  if (!std::isfinite(o.tolerance) || !(o.tolerance >= 0))
    throw std::invalid_argument(fmt::format("tolerance is {}, must be finite and >= 0", o.tolerance));
  for (std::size_t i = 0; i < centres.size(); ++i) {
    if (!centres[i].allFinite()) throw std::invalid_argument(fmt::format("centres: point {} is not finite", i));
    if (!values[i].allFinite()) throw std::invalid_argument(fmt::format("values: value {} is not finite", i));
  }
}

// Householder vectors of the columns of P, so that Q = H_1 ... H_m takes span(P) to the first m coordinates.
// The side conditions say: weights = Q (0, gamma).
struct Reflectors {
  std::vector<Column> vector;  // each of length n, zero before its own index; empty: nothing to reflect
  std::vector<double> factor;  // 2 / |v|^2

  explicit Reflectors(std::vector<Column> p) {
    const std::size_t n = p[0].size();
    for (std::size_t k = 0; k < p.size(); ++k) {
      Column v = p[k];
      std::fill(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(k), 0.0);
      const double length = std::sqrt(detail::dot(v.data(), v.data(), n));
      v[k] += v[k] < 0 ? -length : length;
      const double squared = detail::dot(v.data(), v.data(), n);
      vector.push_back(std::move(v));
      factor.push_back(squared > 0 ? 2 / squared : 0);
      for (std::size_t j = k + 1; j < p.size(); ++j) reflect(k, p[j].data());
    }
  }
  std::size_t count() const { return vector.size(); }
  void reflect(std::size_t k, double* x) const {
    const Column& v = vector[k];
    const double s = factor[k] * detail::dot(v.data(), x, v.size());
    for (std::size_t i = k; i < v.size(); ++i) x[i] -= s * v[i];
  }
  void applyTransposed(double* x) const {
    for (std::size_t k = 0; k < count(); ++k) reflect(k, x);
  }
  void apply(double* x) const {
    for (std::size_t k = count(); k-- > 0;) reflect(k, x);
  }
  // Q^T A Q for a symmetric A stored whole.
  void congruence(detail::Dense& a) const {
    const std::size_t n = a.size;
    for (std::size_t k = 0; k < count(); ++k) {
      const Column& v = vector[k];
      Column u(n);
      parallelFor(n, 64, [&](std::size_t first, std::size_t last) {
        for (std::size_t i = first; i < last; ++i) u[i] = factor[k] * detail::dot(a.row(i), v.data(), n);
      });
      const double s = 0.5 * factor[k] * detail::dot(u.data(), v.data(), n);
      for (std::size_t i = 0; i < n; ++i) u[i] -= s * v[i];
      parallelFor(n, 64, [&](std::size_t first, std::size_t last) {
        for (std::size_t i = first; i < last; ++i)
          for (std::size_t j = 0; j < n; ++j) a.row(i)[j] -= u[i] * v[j] + v[i] * u[j];
      });
    }
  }
};

double cube(const Vec3& a, const Vec3& b) {
  const double r2 = (a - b).squaredNorm();
  return r2 * std::sqrt(r2);
}

}  // namespace

struct Rbf::Impl {
  Vec3 origin = Vec3::Zero();
  double scale = 1;            // power of two; q = (p - origin) * scale
  double unit = 1;             // power of two: the values are solved for in units of it
  Vec3 constant = Vec3::Zero();
  Mat3 linear = Mat3::Zero();  // by q
  std::vector<double> blocks;  // see cubic_sum.h: the centres and their weights
  RbfReport report;

  double tolerance = 0;        // of values, absolute

  std::vector<Vec3> centre;    // distinct, normalised
  std::vector<Vec3> value;     // means, in units
  std::vector<Vec3> weight;    // of the centres

  void normalize(Points centres, Points values);
  std::vector<Column> polynomials(Mat3& axes, int& dimensions) const;
  void solve(double smoothing);
  void pack();
  Vec3 local(const Vec3& p) const { return (p - origin) * scale; }
  Vec3 at(const Vec3& q) const;
  double firstAt(const Vec3& q, Vec3& gradient) const;
  bool isQuicker(std::size_t points) const { return points >= kManyPoints && centre.size() >= kManyCentres && tolerance > 0; }
  template <class Take, class One>
  bool together(Points points, std::size_t components, const Take& take, const One& one) const;
};

void Rbf::Impl::normalize(Points centres, Points values) {
  report.centres = centres.size();
  Box box;
  for (const Vec3& c : centres) box.extend(c);
  origin = 0.5 * box.min() + 0.5 * box.max();
  const double extent = (box.max() * 0.5 - box.min() * 0.5).maxCoeff();
  if (extent > 0) scale = std::ldexp(1.0, -std::clamp(std::ilogb(extent), -1022, 1022));
  double largest = 0;
  for (const Vec3& v : values) largest = std::max(largest, v.cwiseAbs().maxCoeff());
  if (largest > 0) unit = std::ldexp(1.0, std::clamp(std::ilogb(largest), -1022, 1022));
  std::vector<int> count;
  for (std::size_t i = 0; i < centres.size(); ++i) {
    const Vec3 q = local(centres[i]);
    std::size_t g = 0;
    while (g < centre.size() && !((centre[g] - q).squaredNorm() <= kMerge * kMerge)) ++g;
    if (g == centre.size()) {
      centre.push_back(q);
      value.push_back(Vec3::Zero());
      count.push_back(0);
    }
    value[g] += values[i] / unit;
    ++count[g];
  }
  for (std::size_t g = 0; g < centre.size(); ++g) value[g] /= count[g];
  report.distinct = centre.size();
}

// Columns 1 and the coordinates along the directions in which the centres spread.
std::vector<Column> Rbf::Impl::polynomials(Mat3& axes, int& dimensions) const {
  Vec3 mean = Vec3::Zero();
  for (const Vec3& c : centre) mean += c;
  mean /= static_cast<double>(centre.size());
  Mat3 covariance = Mat3::Zero();
  for (const Vec3& c : centre) covariance += (c - mean) * (c - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(covariance);
  axes = solver.eigenvectors().rowwise().reverse();  // greatest spread first
  // The covariance's small eigenvalues are rounding; the spread itself tells a thin set from a flat one.
  double spread[3] = {0, 0, 0};
  for (const Vec3& c : centre)
    for (int k = 0; k < 3; ++k) spread[k] = std::max(spread[k], std::abs(axes.col(k).dot(c - mean)));
  dimensions = 0;
  while (dimensions < 3 && spread[dimensions] > kFlat * spread[0]) ++dimensions;
  std::vector<Column> p(1, Column(centre.size(), 1.0));
  for (int k = 0; k < dimensions; ++k) {
    p.emplace_back(centre.size());
    for (std::size_t i = 0; i < centre.size(); ++i) p.back()[i] = axes.col(k).dot(centre[i]);
  }
  return p;
}

void Rbf::Impl::solve(double smoothing) {
  const std::size_t n = centre.size();
  Mat3 axes;
  int dimensions = 0;
  const std::vector<Column> p = polynomials(axes, dimensions);
  const std::size_t m = std::min(p.size(), n);
  report.polynomialTerms = static_cast<int>(m);
  const Reflectors q(p);

  detail::Dense phi{n, std::vector<double>(n * n)};
  parallelFor(n, 16, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i)
      for (std::size_t j = 0; j < n; ++j) phi.row(i)[j] = cube(centre[i], centre[j]);
  });
  q.congruence(phi);
  // On the complement of the polynomials the kernel is positive definite.
  const auto complement = [&](double ridge) {
    detail::Dense a{n - m, std::vector<double>((n - m) * (n - m))};
    for (std::size_t i = m; i < n; ++i) {
      std::copy(phi.row(i) + m, phi.row(i) + n, a.row(i - m));
      a.row(i - m)[i - m] += smoothing + ridge;
    }
    return a;
  };
  detail::Dense factor = complement(0);
  double trace = 0;
  for (std::size_t i = m; i < n; ++i) trace = std::max(trace, phi.row(i)[i]);
  for (double ridge = 1e-14 * trace; !detail::factorize(factor); ridge *= 10) {
    report.ridge = ridge;
    factor = complement(ridge);
  }

  weight.assign(n, Vec3::Zero());
  Column f(n), g(n), w(n);
  for (int component = 0; component < 3; ++component) {
    for (std::size_t i = 0; i < n; ++i) f[i] = value[i][component];
    q.applyTransposed(f.data());
    std::fill(g.begin(), g.end(), 0.0);
    std::copy(f.begin() + static_cast<std::ptrdiff_t>(m), f.end(), g.begin() + static_cast<std::ptrdiff_t>(m));
    detail::solve(factor, g.data() + m);
    // The polynomial takes what is left in its own span: R c = Q1^T (f - Phi w).
    double coefficient[4] = {0, 0, 0, 0};
    for (std::size_t i = 0; i < m; ++i) coefficient[i] = f[i] - detail::dot(phi.row(i) + m, g.data() + m, n - m);
    std::vector<Column> r = p;
    for (Column& column : r) q.applyTransposed(column.data());
    for (std::size_t i = m; i-- > 0;) {
      for (std::size_t j = i + 1; j < m; ++j) coefficient[i] -= r[j][i] * coefficient[j];
      coefficient[i] /= r[i][i];
    }
    w = g;
    q.apply(w.data());
    for (std::size_t i = 0; i < n; ++i) weight[i][component] = w[i];
    constant[component] = coefficient[0];
    for (int k = 0; k + 1 < static_cast<int>(m); ++k)
      linear.row(component) += coefficient[k + 1] * axes.col(k).transpose();
  }
  for (Vec3& x : weight) x *= unit;
  constant *= unit;
  linear *= unit;
  pack();
  for (std::size_t i = 0; i < n; ++i) report.residual = std::max(report.residual, (at(centre[i]) - value[i] * unit).stableNorm());
}

void Rbf::Impl::pack() {
  blocks.assign((centre.size() + kLanes - 1) / kLanes * detail::kCubicBlock, 0.0);
  for (std::size_t i = 0; i < centre.size(); ++i) {
    double* block = blocks.data() + i / kLanes * detail::kCubicBlock + i % kLanes;
    for (std::size_t k = 0; k < 3; ++k) {
      block[k * kLanes] = centre[i][static_cast<int>(k)];
      block[(3 + k) * kLanes] = weight[i][static_cast<int>(k)];
    }
  }
}

double Rbf::Impl::firstAt(const Vec3& q, Vec3& gradient) const {
  const double radial = detail::cubicSum(blocks.data(), blocks.size() / detail::kCubicBlock, q, gradient);
  gradient += linear.row(0).transpose();
  return radial + (constant.x() + linear.row(0).dot(q));
}

Vec3 Rbf::Impl::at(const Vec3& q) const {
  return detail::cubicSums(blocks.data(), blocks.size() / detail::kCubicBlock, q) + (constant + linear * q);
}

// Calls take(i, q, sums of the radial terms), or one(i) where there are none to be had; false: not worth while.
template <class Take, class One>
bool Rbf::Impl::together(Points points, std::size_t components, const Take& take, const One& one) const {
  if (!isQuicker(points.size())) return false;
  constexpr std::size_t kAtOnce = std::size_t{1} << 20;  // points: bounds the memory
  std::vector<Vec3> q;
  for (std::size_t first = 0; first < points.size(); first += kAtOnce) {
    q.resize(std::min(kAtOnce, points.size() - first));
    parallelFor(q.size(), 1024, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        q[i] = local(points[first + i]);
        if (!detail::takesCubicMany(q[i])) one(first + i);
      }
    });
    detail::cubicMany({centre, weight, components}, q, {tolerance, kSlopeTolerance * tolerance},
                      [&](std::size_t i, const double* sums) { take(first + i, q[i], sums); });
  }
  return true;
}

Rbf::Rbf(Points centres, Points values, const RbfOptions& options) : impl_(std::make_unique<Impl>()) {
  requireInput(centres, values, options);
  impl_->normalize(centres, values);
  impl_->solve(options.smoothing);
  impl_->tolerance = options.tolerance * impl_->unit;
}
Rbf::~Rbf() = default;
Rbf::Rbf(Rbf&&) noexcept = default;
Rbf& Rbf::operator=(Rbf&&) noexcept = default;

const RbfReport& Rbf::report() const noexcept { return impl_->report; }

Vec3 Rbf::evaluate(const Vec3& point) const { return impl_->at(impl_->local(point)); }

bool Rbf::togetherIsQuicker(std::size_t points) const noexcept { return impl_->isQuicker(points); }

double Rbf::first(const Vec3& point, Vec3& gradient) const {
  const double value = impl_->firstAt(impl_->local(point), gradient);
  gradient *= impl_->scale;
  return value;
}

Mat3 Rbf::jacobian(const Vec3& point) const {
  const Vec3 q = impl_->local(point);
  Mat3 j = impl_->linear;
  for (const double *b = impl_->blocks.data(), *end = b + impl_->blocks.size(); b != end; b += detail::kCubicBlock)
    for (std::size_t l = 0; l < kLanes; ++l) {
      const Vec3 d = q - Vec3(b[l], b[kLanes + l], b[2 * kLanes + l]);
      const Vec3 w(b[3 * kLanes + l], b[4 * kLanes + l], b[5 * kLanes + l]);
      j += w * (3 * d.norm() * d).transpose();  // grad r^3 = 3 r (p - c)
    }
  return j * impl_->scale;
}

void Rbf::evaluate(Points points, std::span<Vec3> out) const {
  if (points.size() != out.size())
    throw std::invalid_argument(fmt::format("out: {} elements, expected {}", out.size(), points.size()));
  const auto one = [&](std::size_t i) { out[i] = evaluate(points[i]); };
  const auto take = [&](std::size_t i, const Vec3& q, const double* sums) {
    out[i] = Vec3(sums[0], sums[1], sums[2]) + (impl_->constant + impl_->linear * q);
  };
  if (impl_->together(points, 3, take, one)) return;
  parallelFor(points.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) one(i);
  });
}

void Rbf::first(Points points, std::span<double> values, std::span<Vec3> gradients) const {
  if (points.size() != values.size() || points.size() != gradients.size())
    throw std::invalid_argument(
        fmt::format("values and gradients: {} and {} elements, expected {}", values.size(), gradients.size(), points.size()));
  const auto one = [&](std::size_t i) { values[i] = first(points[i], gradients[i]); };
  const Vec3 slope = impl_->linear.row(0).transpose();
  const auto take = [&](std::size_t i, const Vec3& q, const double* sums) {
    values[i] = sums[0] + (impl_->constant.x() + slope.dot(q));
    gradients[i] = impl_->scale * (Vec3(sums[1], sums[2], sums[3]) + slope);
  };
  if (impl_->together(points, 1, take, one)) return;
  parallelFor(points.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) one(i);
  });
}

}  // namespace fielddeform::numeric
