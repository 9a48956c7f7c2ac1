#include <fielddeform/map/spline_curve.h>
#include <fielddeform/spatial/closest_tree.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

namespace fielddeform::map {
namespace {

constexpr int kChords = 8;  // a span

// Solves the tridiagonal system with one right-hand side a component. [Thomas]
std::vector<Vec3> solve(std::vector<double> low, std::vector<double> middle, const std::vector<double>& high, std::vector<Vec3> right) {
  const std::size_t n = middle.size();
  for (std::size_t i = 1; i < n; ++i) {
    const double f = low[i] / middle[i - 1];
    middle[i] -= f * high[i - 1];
    right[i] -= f * right[i - 1];
  }
  right[n - 1] /= middle[n - 1];
  for (std::size_t i = n - 1; i-- > 0;) right[i] = (right[i] - high[i] * right[i + 1]) / middle[i];
  return right;
}

// Second derivatives of the natural spline.
std::vector<Vec3> naturalCurvature(const std::vector<Vec3>& p, const std::vector<double>& t) {
  const std::size_t n = p.size();
  std::vector<double> low(n, 0.0), middle(n, 1.0), high(n, 0.0);
  std::vector<Vec3> right(n, Vec3::Zero());
  for (std::size_t i = 1; i + 1 < n; ++i) {
    const double a = t[i] - t[i - 1], b = t[i + 1] - t[i];
    low[i] = a / 6;
    middle[i] = (a + b) / 3;
    high[i] = b / 6;
    right[i] = (p[i + 1] - p[i]) / b - (p[i] - p[i - 1]) / a;
  }
  return solve(low, middle, high, right);
}

// Of the periodic spline: the corners of the cyclic system by Sherman and Morrison's formula. p and t end where they start.
std::vector<Vec3> periodicCurvature(const std::vector<Vec3>& p, const std::vector<double>& t) {
  const std::size_t n = p.size() - 1;
  const auto span = [&](std::size_t i) { return t[i % n + 1] - t[i % n]; };
  std::vector<double> low(n), middle(n), high(n);
  std::vector<Vec3> right(n), corner(n, Vec3::Zero());
  for (std::size_t i = 0; i < n; ++i) {
    const double a = span(i + n - 1), b = span(i);
    low[i] = a / 6;
    middle[i] = (a + b) / 3;
    high[i] = b / 6;
    right[i] = (p[(i + 1) % n] - p[i]) / b - (p[i] - p[(i + n - 1) % n]) / a;
  }
  const double gamma = -middle[0], first = low[0], last = high[n - 1];  // the corners
  middle[0] -= gamma;
  middle[n - 1] -= first * last / gamma;
  corner[0].x() = gamma;
  corner[n - 1].x() = last;
  const std::vector<Vec3> x = solve(low, middle, high, right), z = solve(low, middle, high, corner);
  const Vec3 factor = (x[0] + first / gamma * x[n - 1]) / (1 + z[0].x() + first / gamma * z[n - 1].x());
  std::vector<Vec3> m(n + 1);
  for (std::size_t i = 0; i < n; ++i) m[i] = x[i] - z[i].x() * factor;
  m[n] = m[0];
  return m;
}

}  // namespace

struct SplineCurve::Search {
  std::vector<double> parameter;  // of the chords' ends
  spatial::ClosestTree tree;
};

SplineCurve::~SplineCurve() = default;
SplineCurve::SplineCurve(SplineCurve&&) noexcept = default;
SplineCurve& SplineCurve::operator=(SplineCurve&&) noexcept = default;

std::vector<double> SplineCurve::chordParameters(Points points, bool closed) {
  std::vector<double> t;
  for (std::size_t i = 0; i < points.size(); ++i) t.push_back(i == 0 ? 0 : t.back() + (points[i] - points[i - 1]).norm());
  if (closed && !points.empty()) t.push_back(t.back() + (points.front() - points.back()).norm());
  return t;
}

SplineCurve::SplineCurve(Points points, bool closed, std::vector<double> parameter)
    : points_(points.begin(), points.end()), parameter_(std::move(parameter)), closed_(closed) {
  if (points.size() < (closed ? 3u : 2u)) throw std::invalid_argument(fmt::format("points: {}, needs at least {}", points.size(), closed ? 3 : 2));
  if (closed) points_.push_back(points_.front());
  if (parameter_.size() != points_.size())
    throw std::invalid_argument(fmt::format("parameter has {} elements, expected {}", parameter_.size(), points_.size()));
  for (std::size_t i = 0; i < points_.size(); ++i)
    if (!points_[i].allFinite() || !std::isfinite(parameter_[i]) || (i > 0 && !(parameter_[i] > parameter_[i - 1])))
      throw std::invalid_argument(fmt::format("point {} is not finite, or its parameter is not greater than the one before", i));
  curvature_ = closed ? periodicCurvature(points_, parameter_) : naturalCurvature(points_, parameter_);
  std::vector<double> at;
  std::vector<Vec3> chord;
  std::vector<std::array<Index, 2>> segments;
  for (std::size_t i = 0; i + 1 < points_.size(); ++i)
    for (int k = 0; k < kChords; ++k) at.push_back(parameter_[i] + (parameter_[i + 1] - parameter_[i]) * k / kChords);
  at.push_back(parameter_.back());
  for (std::size_t i = 0; i < at.size(); ++i) {
    chord.push_back(i + 1 == at.size() ? points_.back() : this->at(at[i]).point);
    if (i > 0) segments.push_back({static_cast<Index>(i - 1), static_cast<Index>(i)});
  }
  search_ = std::make_unique<const Search>(Search{std::move(at), spatial::ClosestTree::ofSegments(chord, segments)});
}

std::size_t SplineCurve::spanAt(double& t) const {
  if (closed_) {
    const double length = end() - begin();
    t -= length * std::floor((t - begin()) / length);
  }
  t = std::clamp(t, begin(), end());
  const auto above = std::upper_bound(parameter_.begin() + 1, parameter_.end() - 1, t);
  return static_cast<std::size_t>(above - parameter_.begin()) - 1;
}

SplineCurve::Place SplineCurve::at(double t) const {
  const std::size_t i = spanAt(t);
  const double h = parameter_[i + 1] - parameter_[i], b = (t - parameter_[i]) / h, a = 1 - b;
  const Vec3 &p = points_[i], &q = points_[i + 1], &m = curvature_[i], &n = curvature_[i + 1];
  return {a * p + b * q + h * h / 6 * ((a * a * a - a) * m + (b * b * b - b) * n),
          (q - p) / h + h / 6 * ((1 - 3 * a * a) * m + (3 * b * b - 1) * n), a * m + b * n};
}

SplineCurve::Foot SplineCurve::closest(const Vec3& x) const {
  const spatial::ClosestPoint hit = search_->tree.closest(x);
  if (hit.element == kNoIndex) return {begin(), false};
  const std::vector<double>& c = search_->parameter;
  const double step = c[hit.element + 1] - c[hit.element];
  double low = c[hit.element] - step, high = c[hit.element + 1] + step;
  if (!closed_) low = std::max(low, begin()), high = std::min(high, end());
  const auto slope = [&](double t) {
    const Place p = at(t);
    return (p.point - x).dot(p.first);
  };
  if (slope(low) >= 0) return {low, closed_};
  if (slope(high) <= 0) return {high, closed_};
  double t = std::clamp(c[hit.element] + hit.weight[1] * step, low, high);
  for (int i = 0; i < 80; ++i) {
    const Place p = at(t);
    const double g = (p.point - x).dot(p.first), curve = p.first.squaredNorm() + (p.point - x).dot(p.second);
    (g > 0 ? high : low) = t;
    double next = curve > 0 ? t - g / curve : 0.5 * (low + high);
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (next == t || !(high > low) || std::abs(next - t) <= 1e-16 * (end() - begin())) break;
    t = next;
  }
  return {t, true};
}

}  // namespace fielddeform::map
