#include <fielddeform/core/error.h>
#include <fielddeform/map/axis_basis.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

/// B-spline axes with coincident borders whose knots are not uniform. Controls are the nodes with the outer ones repeated.
namespace fielddeform::map {
namespace {

// The degree + 1 functions that do not vanish over [knot[p], knot[p + 1]], and their slopes, at s there. [de Boor 1972]
void splineFunctions(int p, const double* knot, double s, double* weight, double* slope) {
  weight[0] = 1;
  for (int d = 1; d <= p; ++d) {
    if (d == p) {
      for (int k = 0; k <= p; ++k) {
        const double rising = k > 0 ? weight[k - 1] / (knot[p + k] - knot[k]) : 0;
        const double falling = k < p ? weight[k] / (knot[p + k + 1] - knot[k + 1]) : 0;
        slope[k] = p * (rising - falling);
      }
    }
    double carried = 0;
    for (int k = 0; k < d; ++k) {
      const double low = knot[p - d + 1 + k], high = knot[p + 1 + k], part = weight[k] / (high - low);
      weight[k] = carried + (high - s) * part;
      carried = (s - low) * part;
    }
    weight[d] = carried;
  }
}

}  // namespace

AxisBasis AxisBasis::coincident(int degree, std::vector<double> knots, std::vector<double> rest) {
  if (degree < 2 || degree > 3) throw std::invalid_argument(fmt::format("degree: {}, must be 2 or 3", degree));
  const std::size_t p = static_cast<std::size_t>(degree), nodes = rest.size();
  if (nodes <= p || knots.size() != nodes + 3 * p - 1)
    throw std::invalid_argument(fmt::format("knots: {} for {} nodes, must be nodes + {}, and more nodes than the degree",
                                            knots.size(), nodes, 3 * p - 1));
  for (const auto& [name, list] : {std::pair("knots", &knots), std::pair("rest", &rest)})
    for (std::size_t i = 0; i < list->size(); ++i) {
      requireFinite(name, (*list)[i]);
      if (i > 0 && !((*list)[i - 1] < (*list)[i]))
        throw std::invalid_argument(fmt::format("{}: {} after {}, must ascend", name, (*list)[i], (*list)[i - 1]));
    }
  if (rest.front() != 0 || rest.back() != 1) throw std::invalid_argument("rest: must begin with 0 and end with 1");
  AxisBasis b;
  b.kind_ = BasisKind::BSpline;
  b.border_ = Border::Coincident;
  b.degree_ = degree;
  b.nodes_ = static_cast<int>(nodes);
  b.knots_ = std::move(knots);
  b.rest_ = std::move(rest);
  for (std::size_t k = p; k + p < b.knots_.size(); ++k) {
    double weight[4], slope[4], u = 0;
    const std::size_t span = std::min(k, b.knots_.size() - p - 2);
    splineFunctions(degree, &b.knots_[span - p], b.knots_[k], weight, slope);
    for (std::size_t i = 0; i <= p; ++i) {
      const int control = static_cast<int>(span - p + i);
      u += weight[i] * b.rest_[static_cast<std::size_t>(std::clamp(control - degree + 1, 0, b.nodes_ - 1))];
    }
    b.curve_.push_back(u);
  }
  b.curve_.front() = 0;
  b.curve_.back() = 1;
  for (std::size_t k = 1; k < b.curve_.size(); ++k)
    if (!(b.curve_[k - 1] < b.curve_[k])) throw std::invalid_argument("knots: too near to one another");
  return b;
}

int AxisBasis::evaluateCurve(double u, double* weight, double* slope) const {
  const int p = degree_, last = nodes_ - 1, spans = static_cast<int>(curve_.size()) - 1;
  const auto rest = [&](int node) { return rest_[static_cast<std::size_t>(node)]; };
  const int span = static_cast<int>(std::upper_bound(curve_.begin() + 1, curve_.end() - 1, u) - curve_.begin()) - 1;
  const int first = std::clamp(span - (p - 1), 0, last - p);
  if (!weight) return first;
  double sums[4] = {}, slopes[4] = {};
  if (span == 0 || span == spans - 1) {
    // The outermost pieces depend on two nodes only, and are affine between them.
    const int at = span == 0 ? 0 : last - 1;
    const double length = rest(at + 1) - rest(at);
    sums[at - first] = (rest(at + 1) - u) / length;
    sums[at + 1 - first] = (u - rest(at)) / length;
    slopes[at - first] = -1 / length;
    slopes[at + 1 - first] = 1 / length;
  } else {
    const double* knot = &knots_[static_cast<std::size_t>(span)];
    double low = knot[p], high = knot[p + 1], functions[4], rises[4], rise = 1;
    const double from = curve_[static_cast<std::size_t>(span)], to = curve_[static_cast<std::size_t>(span) + 1];
    double s = low + (high - low) * (u - from) / (to - from);
    for (int step = 0; step < 60; ++step) {
      double miss = -u;
      rise = 0;
      splineFunctions(p, knot, s, functions, rises);
      for (int k = 0; k <= p; ++k) {
        const double x = rest(std::clamp(span + k - (p - 1), 0, last));
        miss += functions[k] * x;
        rise += rises[k] * x;
      }
      if (miss == 0) break;
      (miss < 0 ? low : high) = s;
      double next = s - miss / rise;
      if (!(next >= low && next <= high)) next = 0.5 * (low + high);
      if (next == s) break;
      s = next;
    }
    for (int k = 0; k <= p; ++k) {
      const int node = std::clamp(span + k - (p - 1), 0, last) - first;
      sums[node] += functions[k];
      slopes[node] += rises[k] / rise;
    }
  }
  for (int k = 0; k <= p; ++k) {
    weight[k] = sums[k];
    if (slope) slope[k] = slopes[k];
  }
  return first;
}

}  // namespace fielddeform::map
