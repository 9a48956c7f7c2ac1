#include <fielddeform/numeric/cubic.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::numeric {
namespace {

double at(const std::array<double, 4>& c, double t) { return c[0] + t * (c[1] + t * (c[2] + t * c[3])); }
double slope(const std::array<double, 4>& c, double t) { return c[1] + t * (2 * c[2] + t * 3 * c[3]); }

double polish(const std::array<double, 4>& c, double t) {
  for (int i = 0; i < 8; ++i) {
    const double s = slope(c, t);
    if (s == 0) break;
    const double next = t - at(c, t) / s;
    if (!std::isfinite(next) || std::abs(at(c, next)) >= std::abs(at(c, t))) break;
    t = next;
  }
  return t;
}

/// The root in [low, high], where the signs differ. Bisection first, so that Newton cannot leave.
double bracketed(const std::array<double, 4>& c, double low, double high) {
  const bool rising = at(c, high) > 0;
  for (int i = 0; i < 200; ++i) {
    const double middle = 0.5 * (low + high);
    if (!(middle > low && middle < high)) break;
    (at(c, middle) > 0) == rising ? high = middle : low = middle;
    if (high - low <= 1e-3 * std::max(std::abs(low), std::abs(high))) break;
  }
  const double t = polish(c, 0.5 * (low + high));
  return t >= low && t <= high ? t : 0.5 * (low + high);
}

}  // namespace

std::vector<double> cubicRoots(const std::array<double, 4>& c) {
  // Where all roots lie: Cauchy's bound about the leading coefficient that is not negligible.
  int degree = 3;
  while (degree > 0 && c[static_cast<std::size_t>(degree)] == 0) --degree;
  if (degree == 0) return {};
  double bound = 0;
  for (int k = 0; k < degree; ++k)
    bound = std::max(bound, std::pow(std::abs(c[static_cast<std::size_t>(k)] / c[static_cast<std::size_t>(degree)]), 1.0 / (degree - k)));
  bound *= 2;  // Fujiwara
  if (bound == 0) return {0.0};
  if (!std::isfinite(bound)) return {};
  // Between the stationary points the cubic is monotonic.
  std::vector<double> cut{-bound, bound};
  const double a = 3 * c[3], b = 2 * c[2];
  if (a != 0) {
    const double discriminant = b * b - 4 * a * c[1];
    if (discriminant > 0) {
      const double q = -0.5 * (b + std::copysign(std::sqrt(discriminant), b));
      for (const double t : {q / a, q != 0 ? c[1] / q : 0.0})
        if (std::abs(t) < bound) cut.push_back(t);
    }
  } else if (b != 0 && std::abs(c[1] / b) < bound) {
    cut.push_back(-c[1] / b);
  }
  std::sort(cut.begin(), cut.end());
  std::vector<double> roots;
  for (std::size_t i = 0; i + 1 < cut.size(); ++i) {
    const double low = at(c, cut[i]), high = at(c, cut[i + 1]);
    if (low == 0) roots.push_back(cut[i]);
    else if (high != 0 && (low > 0) != (high > 0)) roots.push_back(bracketed(c, cut[i], cut[i + 1]));
  }
  if (at(c, cut.back()) == 0) roots.push_back(cut.back());
  return roots;
}

std::optional<double> smallestCubicRoot(const std::array<double, 4>& c) {
  if (c[0] == 0) return 0.0;
  // Roots far beyond the wanted one hide it from the bound's scale only if the leading coefficients are rounding noise:
  // Newton from 0 finds it then.
  std::optional<double> best;
  for (const double t : cubicRoots(c))
    if (!best || std::abs(t) < std::abs(*best)) best = t;
  const double newton = polish(c, 0);
  if (std::abs(at(c, newton)) <= 1e-14 * std::abs(c[0]) && (!best || std::abs(newton) < std::abs(*best))) best = newton;
  return best;
}

}  // namespace fielddeform::numeric
