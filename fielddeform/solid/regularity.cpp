#include <fielddeform/solid/regularity.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>

namespace fielddeform::solid {
namespace {

using Degrees = std::array<int, 3>;

std::size_t countOf(const Degrees& d) { return static_cast<std::size_t>((d[0] + 1) * (d[1] + 1) * (d[2] + 1)); }
std::size_t at(const Degrees& d, int i, int j, int k) { return static_cast<std::size_t>(i + (d[0] + 1) * (j + (d[1] + 1) * k)); }

std::vector<double> binomials(int n) {
  std::vector<double> out{1};
  for (int i = 1; i <= n; ++i) out.push_back(out.back() * (n - i + 1) / i);
  return out;
}

/// A polynomial by control values times their binomials, so that products are convolutions.
template <class Value>
struct Scaled {
  Degrees degree{};
  std::vector<Value> value;

  void scale(bool into) {
    std::array<std::vector<double>, 3> b;
    for (std::size_t a = 0; a < 3; ++a) b[a] = binomials(degree[a]);
    std::size_t next = 0;
    for (const double z : b[2])
      for (const double y : b[1])
        for (const double x : b[0]) {
          const double f = x * (y * z);
          if (into) value[next] *= f;
          else value[next] /= f;
          ++next;
        }
  }
};

template <class A, class B, class C, class Product>
void multiply(const Scaled<A>& a, const Scaled<B>& b, Scaled<C>& out, const C& zero, Product&& product) {
  for (std::size_t k = 0; k < 3; ++k) out.degree[k] = a.degree[k] + b.degree[k];
  out.value.assign(countOf(out.degree), zero);
  std::size_t na = 0;
  for (int z = 0; z <= a.degree[2]; ++z)
    for (int y = 0; y <= a.degree[1]; ++y)
      for (int x = 0; x <= a.degree[0]; ++x, ++na) {
        std::size_t nb = 0;
        for (int k = 0; k <= b.degree[2]; ++k)
          for (int j = 0; j <= b.degree[1]; ++j)
            for (int i = 0; i <= b.degree[0]; ++i, ++nb) out.value[at(out.degree, x + i, y + j, z + k)] += product(a.value[na], b.value[nb]);
      }
}

/// dF/d(axis), scaled.
Scaled<Vec3> derivativeOf(const Solid& solid, Points points, std::size_t axis) {
  Scaled<Vec3> out;
  out.degree = solid.degree;
  --out.degree[axis];
  for (int k = 0; k <= out.degree[2]; ++k)
    for (int j = 0; j <= out.degree[1]; ++j)
      for (int i = 0; i <= out.degree[0]; ++i) {
        std::array<int, 3> next{i, j, k};
        ++next[axis];
        out.value.push_back(solid.degree[axis] * (points[solid.slot(next[0], next[1], next[2])] - points[solid.slot(i, j, k)]));
      }
  out.scale(true);
  return out;
}

struct Cell {
  std::vector<double> value;
  Vec3 low = Vec3::Zero(), high = Vec3::Ones();
  int depth = 0;
};

/// Both halves along an axis, by de Casteljau's algorithm.
std::array<Cell, 2> halved(const Cell& cell, const Degrees& degree, std::size_t axis) {
  std::array<Cell, 2> out{cell, cell};
  const auto a = static_cast<Eigen::Index>(axis);
  const double middle = 0.5 * (cell.low[a] + cell.high[a]);
  out[0].high[a] = out[1].low[a] = middle;
  ++out[0].depth, ++out[1].depth;
  const int n = degree[axis];
  const std::size_t stride = axis == 0 ? 1 : axis == 1 ? static_cast<std::size_t>(degree[0] + 1) : static_cast<std::size_t>((degree[0] + 1) * (degree[1] + 1));
  std::vector<double> row(static_cast<std::size_t>(n) + 1);
  for (std::size_t first = 0; first < cell.value.size(); ++first) {
    if (first / stride % (static_cast<std::size_t>(n) + 1) != 0) continue;
    for (std::size_t i = 0; i < row.size(); ++i) row[i] = cell.value[first + i * stride];
    for (std::size_t k = 0; k < row.size(); ++k) {
      out[0].value[first + k * stride] = row[0];
      out[1].value[first + (row.size() - 1 - k) * stride] = row[row.size() - 1 - k];
      for (std::size_t i = 0; i + 1 + k < row.size(); ++i) row[i] = 0.5 * (row[i] + row[i + 1]);
    }
  }
  return out;
}

}  // namespace

std::string_view toString(Orientation orientation) noexcept {
  return std::array<std::string_view, 3>{"positive", "folded", "undecided"}[static_cast<std::size_t>(orientation)];
}

Regularity checkRegular(const Object& object, std::size_t solid, int maxBoxes) {
  const Solid& s = object.solids[solid];
  const std::vector<Vec3> points = object.pointsOf(solid);
  Scaled<Vec3> cross;
  Scaled<double> det;
  multiply(derivativeOf(s, points, 1), derivativeOf(s, points, 2), cross, Vec3(Vec3::Zero()), [](const Vec3& a, const Vec3& b) { return Vec3(a.cross(b)); });
  multiply(derivativeOf(s, points, 0), cross, det, 0.0, [](const Vec3& a, const Vec3& b) { return a.dot(b); });
  det.scale(false);
  const Degrees& degree = det.degree;
  Regularity out;
  double largest = 0;
  for (const double v : det.value) out.mean += v, largest = std::max(largest, std::abs(v));
  out.mean /= static_cast<double>(det.value.size());
  out.least = std::numeric_limits<double>::infinity();
  const double zero = 1e-9 * largest;
  std::deque<Cell> cells;
  cells.push_back({std::move(det.value), Vec3::Zero(), Vec3::Ones(), 0});
  while (!cells.empty()) {
    const Cell cell = std::move(cells.front());
    cells.pop_front();
    ++out.boxes;
    for (int corner = 0; corner < 8; ++corner) {
      const double v = cell.value[at(degree, corner & 1 ? degree[0] : 0, corner & 2 ? degree[1] : 0, corner & 4 ? degree[2] : 0)];
      if (v >= out.least) continue;
      out.least = v;
      for (Eigen::Index a = 0; a < 3; ++a) out.at[a] = corner >> a & 1 ? cell.high[a] : cell.low[a];
    }
    if (out.least < -zero || largest == 0) {
      out.orientation = Orientation::Folded;
      return out;
    }
    if (*std::min_element(cell.value.begin(), cell.value.end()) >= -zero) continue;
    if (out.boxes + static_cast<int>(cells.size()) >= maxBoxes) {
      out.orientation = Orientation::Undecided;
      return out;
    }
    auto halves = halved(cell, degree, static_cast<std::size_t>(cell.depth % 3));
    for (Cell& half : halves) cells.push_back(std::move(half));
  }
  return out;
}

}  // namespace fielddeform::solid
