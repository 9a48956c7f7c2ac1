#pragma once

#include <fielddeform/core/random.h>
#include <fielddeform/map/lattice.h>

#include <Eigen/LU>
#include <cmath>
#include <vector>

/// Lattices for tests, and slow evaluations that share nothing with the library's.
namespace fielddeform::test {

inline Vec3 randomPoint(std::uint64_t seed, std::uint64_t i) {
  return {2 * uniform01(seed, 3 * i) - 1, 2 * uniform01(seed, 3 * i + 1) - 1, 2 * uniform01(seed, 3 * i + 2) - 1};
}

inline std::vector<Vec3> cloud(std::uint64_t seed, std::size_t n) {
  std::vector<Vec3> p(n);
  for (std::size_t i = 0; i < n; ++i) p[i] = randomPoint(seed, i);
  return p;
}

/// A skew, left-handed box about the origin that holds [-1, 1]^3.
inline map::LatticeBox skewBox() {
  map::LatticeBox box;
  box.axes << 4, 0.5, 0.2, 0.3, -3.5, 0.4, -0.1, 0.6, 3;
  box.origin = -0.5 * (box.axes.col(0) + box.axes.col(1) + box.axes.col(2));
  return box;
}

/// Every node moved at random by up to `size` along each axis.
inline map::Lattice shaken(map::Lattice lattice, std::uint64_t seed, double size) {
  lattice.displacements = cloud(seed, lattice.nodeCount());
  for (Vec3& d : lattice.displacements) d *= size;
  return lattice;
}

/// Cox and de Boor's recurrence as printed, 0/0 = 0. The last knot span is closed.
inline double deBoor(const std::vector<double>& knots, int i, int degree, double s) {
  const auto k = [&](int j) { return knots[static_cast<std::size_t>(j)]; };
  if (degree == 0) {
    int last = static_cast<int>(knots.size()) - 1;
    while (last > 0 && k(last - 1) == k(last)) --last;
    const bool end = s == k(last) && k(i + 1) == s && k(i) < s;
    return (k(i) <= s && s < k(i + 1)) || end ? 1 : 0;
  }
  const double a = k(i + degree) - k(i), b = k(i + degree + 1) - k(i + 1);
  return (a > 0 ? (s - k(i)) / a * deBoor(knots, i, degree - 1, s) : 0) +
         (b > 0 ? (k(i + degree + 1) - s) / b * deBoor(knots, i + 1, degree - 1, s) : 0);
}

/// All weights of an axis at u, by the textbook: binomials; de Boor's recurrence; for coincident borders the spline over
/// repeated nodes with its parameter found by bisection.
inline std::vector<double> slowWeights(const map::AxisBasis& axis, double u) {
  const int n = axis.nodes(), p = axis.degree();
  std::vector<double> w(static_cast<std::size_t>(n), 0.0);
  if (axis.kind() == map::BasisKind::Bernstein) {
    for (int i = 0; i < n; ++i)
      w[i] = std::exp(std::lgamma(n) - std::lgamma(i + 1) - std::lgamma(n - i)) * std::pow(u, i) * std::pow(1 - u, p - i);
    return w;
  }
  const std::vector<double>& knots = axis.knots();
  const int controls = static_cast<int>(knots.size()) - p - 1;
  const auto nodeOf = [&](int c) { return std::min(n - 1, std::max(0, c - (controls - n) / 2)); };
  const double low = knots[p], high = knots[controls];
  const auto at = [&](double s) {
    std::fill(w.begin(), w.end(), 0.0);
    for (int c = 0; c < controls; ++c) w[nodeOf(c)] += deBoor(knots, c, p, s);
    double x = 0;
    for (int i = 0; i < n; ++i) x += w[i] * axis.restNode(i);
    return x;
  };
  if (axis.border() != map::Border::Coincident) {
    at(low + u * (high - low));
    return w;
  }
  double a = low, b = high;
  for (int step = 0; step < 100; ++step) (at(0.5 * (a + b)) < u ? a : b) = 0.5 * (a + b);
  at(0.5 * (a + b));
  return w;
}

/// The displacement of a point inside the box as a plain sum over all nodes.
inline Vec3 slowDisplacement(const map::Lattice& lattice, const Vec3& x) {
  const Vec3 u = lattice.box.axes.fullPivLu().solve(x - lattice.box.origin);
  const std::vector<double> a = slowWeights(lattice.axis[0], u[0]), b = slowWeights(lattice.axis[1], u[1]),
                            c = slowWeights(lattice.axis[2], u[2]);
  const auto [n0, n1, n2] = lattice.nodes();
  Vec3 sum = Vec3::Zero();
  for (int k = 0; k < n2; ++k)
    for (int j = 0; j < n1; ++j)
      for (int i = 0; i < n0; ++i) sum += a[i] * b[j] * c[k] * lattice.displacements[lattice.index(i, j, k)];
  return sum;
}

/// One axis of every sort.
inline std::vector<map::AxisBasis> everyAxis() {
  using map::AxisBasis, map::Border;
  std::vector<AxisBasis> axes;
  for (const int n : {2, 3, 4, 5, 8, 13}) axes.push_back(AxisBasis::bernstein(n));
  for (const int degree : {1, 2, 3})
    for (const int n : {2, 3, 4, 5, 6, 9})
      for (const Border border : {Border::Coincident, Border::Free}) axes.push_back(AxisBasis::bspline(n, degree, border));
  axes.push_back(AxisBasis::withKnots(1, {0, 0, 0.1, 2, 2}));
  axes.push_back(AxisBasis::withKnots(2, {-3, -1, 0, 1.5, 1.75, 4, 4, 4}));
  axes.push_back(AxisBasis::withKnots(2, {0, 0, 0, 1, 1, 2, 2, 2}));
  axes.push_back(AxisBasis::withKnots(3, {0, 0, 0, 0, 1, 1, 1, 1}));
  axes.push_back(AxisBasis::withKnots(3, {-1, 0, 0, 0, 0.3, 0.35, 2, 2, 2.5, 3, 7, 9, 9}));
  axes.push_back(AxisBasis::withKnots(3, {10, 10, 10, 10, 11, 11, 11, 12, 13, 13, 13, 13}));
  return axes;
}

}  // namespace fielddeform::test
