#include <fielddeform/map/refine_lattice.h>
#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <stdexcept>

namespace fielddeform::map {
namespace {

// The spline behind an axis: controls of which those at a coincident border are one node, degree times.
struct Spline {
  int degree, nodes, repeats;  // repeats: how often a border node stands
  std::vector<double> knot;

  explicit Spline(const AxisBasis& axis)
      : degree(axis.degree()), nodes(axis.nodes()), repeats(axis.border() == Border::Coincident ? axis.degree() : 1), knot(axis.knots()) {}
  int controls() const { return static_cast<int>(knot.size()) - degree - 1; }
  int node(int control) const { return std::clamp(control - (repeats - 1), 0, nodes - 1); }
  double at(int k) const { return knot[static_cast<std::size_t>(k)]; }
  // Spans of the domain that are not empty, by their first knot.
  std::vector<int> spans() const {
    std::vector<int> s;
    for (int k = degree; k < controls(); ++k)
      if (at(k) < at(k + 1)) s.push_back(k);
    return s;
  }
  std::vector<double> blossom(int span, const double* arguments) const;
};

// Weights, on the controls span - degree .. span, of the blossom of the polynomial over [knot[span], knot[span + 1]].
std::vector<double> Spline::blossom(int span, const double* arguments) const {
  const int p = degree;
  std::vector<std::vector<double>> d(static_cast<std::size_t>(p + 1), std::vector<double>(static_cast<std::size_t>(p + 1), 0.0));
  for (std::size_t k = 0; k <= static_cast<std::size_t>(p); ++k) d[k][k] = 1;
  for (int r = 1; r <= p; ++r)
    for (int j = p; j >= r; --j) {
      const double low = at(span - p + j), high = at(span + 1 + j - r), share = (arguments[r - 1] - low) / (high - low);
      auto& to = d[static_cast<std::size_t>(j)];
      const auto& from = d[static_cast<std::size_t>(j - 1)];
      for (std::size_t k = 0; k < to.size(); ++k) to[k] = (1 - share) * from[k] + share * to[k];
    }
  return d.back();
}

// The span of `fine` that the support of its control j shares with the domain, nearest to the support's middle.
int spanOf(const Spline& fine, int j) {
  const std::vector<int> spans = fine.spans();
  const double middle = j + 0.5 * fine.degree;
  int best = spans.front();
  for (const int s : spans)
    if (std::abs(s - middle) < std::abs(best - middle)) best = s;
  return best;
}

SparseRows rowsOf(const std::vector<std::vector<double>>& dense, int columns) {
  SparseRows rows;
  rows.columns = static_cast<std::size_t>(columns);
  for (const auto& row : dense) {
    for (std::size_t c = 0; c < row.size(); ++c)
      if (row[c] != 0) rows.column.push_back(static_cast<Index>(c)), rows.value.push_back(row[c]);
    rows.start.push_back(rows.column.size());
  }
  return rows;
}

SparseRows insertionMatrix(const Spline& coarse, const Spline& fine) {
  std::vector<std::vector<double>> matrix(static_cast<std::size_t>(fine.nodes), std::vector<double>(static_cast<std::size_t>(coarse.nodes), 0.0));
  const std::vector<int> coarseSpans = coarse.spans();
  for (int n = 0; n < fine.nodes; ++n) {
    const bool border = fine.repeats > 1 && (n == 0 || n == fine.nodes - 1);
    if (border) {
      matrix[static_cast<std::size_t>(n)][n == 0 ? 0 : static_cast<std::size_t>(coarse.nodes - 1)] = 1;
      continue;
    }
    const int control = n + fine.repeats - 1;
    const int span = spanOf(fine, control);
    const double middle = 0.5 * (fine.at(span) + fine.at(span + 1));
    int at = coarseSpans.front();
    for (const int s : coarseSpans)
      if (coarse.at(s) <= middle) at = s;
    const std::vector<double> weight = coarse.blossom(at, &fine.knot[static_cast<std::size_t>(control + 1)]);
    for (int k = 0; k <= coarse.degree; ++k)
      matrix[static_cast<std::size_t>(n)][static_cast<std::size_t>(coarse.node(at - coarse.degree + k))] += weight[static_cast<std::size_t>(k)];
  }
  return rowsOf(matrix, coarse.nodes);
}

std::vector<double> restOf(const AxisBasis& axis) {
  std::vector<double> rest;
  for (int i = 0; i < axis.nodes(); ++i) rest.push_back(axis.restNode(i));
  return rest;
}

std::vector<double> multiply(const SparseRows& m, const std::vector<double>& v) {
  std::vector<double> out;
  for (std::size_t r = 0; r < m.rows(); ++r) {
    double sum = 0;
    for (std::size_t e = m.start[r]; e < m.start[r + 1]; ++e) sum += m.value[e] * v[m.column[e]];
    out.push_back(sum);
  }
  return out;
}

}  // namespace

std::vector<double> breaks(const AxisBasis& axis) {
  if (axis.kind() == BasisKind::Bernstein) return {0, 1};
  const Spline spline(axis);
  const std::vector<double> rest = restOf(axis);
  std::vector<double> at{0};
  const std::vector<int> spans = spline.spans();
  for (std::size_t i = 1; i < spans.size(); ++i) {
    // The curve of the rest nodes at the knot where the span begins.
    const std::vector<double> same(static_cast<std::size_t>(spline.degree), spline.at(spans[i]));
    const std::vector<double> weight = spline.blossom(spans[i], same.data());
    double u = 0;
    for (int k = 0; k <= spline.degree; ++k)
      u += weight[static_cast<std::size_t>(k)] * rest[static_cast<std::size_t>(spline.node(spans[i] - spline.degree + k))];
    at.push_back(u);
  }
  at.push_back(1);
  return at;
}

AxisRefinement insertKnots(const AxisBasis& axis, std::span<const int> pieces) {
  if (axis.kind() != BasisKind::BSpline) throw std::invalid_argument("axis: Bernstein, has no knots to insert");
  const Spline coarse(axis);
  const std::vector<int> spans = coarse.spans();
  Spline fine = coarse;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    if (pieces[i] < 0 || static_cast<std::size_t>(pieces[i]) >= spans.size() || (i > 0 && pieces[i] <= pieces[i - 1]))
      throw std::invalid_argument(fmt::format("pieces: {} at place {}, must ascend and be less than {}", pieces[i], i, spans.size()));
    const int span = spans[static_cast<std::size_t>(pieces[i])];
    const double middle = 0.5 * coarse.at(span) + 0.5 * coarse.at(span + 1);
    if (!(coarse.at(span) < middle) || !(middle < coarse.at(span + 1)))
      throw std::invalid_argument(fmt::format("pieces: no number lies within piece {}", pieces[i]));
    fine.knot.insert(std::upper_bound(fine.knot.begin(), fine.knot.end(), middle), middle);
    ++fine.nodes;
  }
  AxisRefinement out;
  out.matrix = insertionMatrix(coarse, fine);
  out.axis = axis.border() == Border::Coincident && axis.degree() > 1
                 ? AxisBasis::coincident(axis.degree(), fine.knot, multiply(out.matrix, restOf(axis)))
                 : AxisBasis::withKnots(axis.degree(), fine.knot);
  return out;
}

AxisRefinement elevate(const AxisBasis& axis, int nodes) {
  if (axis.kind() != BasisKind::Bernstein) throw std::invalid_argument("axis: a B-spline, its degree is not raised");
  if (nodes <= axis.nodes()) throw std::invalid_argument(fmt::format("nodes: {}, must be > {}", nodes, axis.nodes()));
  const auto columns = static_cast<std::size_t>(axis.nodes());
  std::vector<std::vector<double>> m(columns, std::vector<double>(columns, 0.0));
  for (std::size_t i = 0; i < columns; ++i) m[i][i] = 1;
  for (int degree = axis.nodes(); degree < nodes; ++degree) {
    std::vector<std::vector<double>> next(static_cast<std::size_t>(degree + 1), std::vector<double>(columns, 0.0));
    for (std::size_t i = 0; i < next.size(); ++i) {
      const double share = static_cast<double>(i) / degree;
      for (std::size_t c = 0; c < columns; ++c) next[i][c] = (i > 0 ? share * m[i - 1][c] : 0) + (i < m.size() ? (1 - share) * m[i][c] : 0);
    }
    m = std::move(next);
  }
  return {AxisBasis::bernstein(nodes), rowsOf(m, axis.nodes())};
}

AxisRefinement refineAll(const AxisBasis& axis) {
  if (axis.kind() == BasisKind::Bernstein) return elevate(axis, 2 * axis.nodes() - 1);
  std::vector<int> pieces(breaks(axis).size() - 1);
  std::iota(pieces.begin(), pieces.end(), 0);
  return insertKnots(axis, pieces);
}

Lattice refined(const Lattice& lattice, int axis, const AxisRefinement& refinement) {
  if (axis < 0 || axis > 2) throw std::invalid_argument(fmt::format("axis: {}, must be 0, 1 or 2", axis));
  const auto before = lattice.nodes();
  if (refinement.matrix.columns != static_cast<std::size_t>(before[static_cast<std::size_t>(axis)]))
    throw std::invalid_argument(fmt::format("refinement: of an axis of {} nodes, expected {}", refinement.matrix.columns,
                                            before[static_cast<std::size_t>(axis)]));
  Lattice out = lattice;
  out.axis[static_cast<std::size_t>(axis)] = refinement.axis;
  out.displacements.clear();
  if (lattice.displacements.empty()) return out;
  out.displacements.assign(out.nodeCount(), Vec3::Zero());
  const auto after = out.nodes();
  const SparseRows& m = refinement.matrix;
  std::array<int, 3> at{};
  for (at[2] = 0; at[2] < after[2]; ++at[2])
    for (at[1] = 0; at[1] < after[1]; ++at[1])
      for (at[0] = 0; at[0] < after[0]; ++at[0]) {
        Vec3 sum = Vec3::Zero();
        std::array<int, 3> from = at;
        const auto row = static_cast<std::size_t>(at[static_cast<std::size_t>(axis)]);
        for (std::size_t e = m.start[row]; e < m.start[row + 1]; ++e) {
          from[static_cast<std::size_t>(axis)] = static_cast<int>(m.column[e]);
          sum += m.value[e] * lattice.displacements[lattice.index(from[0], from[1], from[2])];
        }
        out.displacements[out.index(at[0], at[1], at[2])] = sum;
      }
  return out;
}

Lattice refined(const Lattice& lattice) {
  Lattice out = lattice;
  for (int a = 0; a < 3; ++a) out = refined(out, a, refineAll(out.axis[static_cast<std::size_t>(a)]));
  return out;
}

}  // namespace fielddeform::map
