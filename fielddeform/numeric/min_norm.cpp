#include <fielddeform/core/error.h>
#include <fielddeform/numeric/detail/lsqr.h>
#include <fielddeform/numeric/detail/row_space.h>
#include <fielddeform/numeric/min_norm.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace fielddeform::numeric {
namespace {

constexpr double kFixedWeight = 1e4;
constexpr double kDenseEntries = 1.6e7;  // 128 MB

void requireMatrix(const char* name, const SparseRowsView& a) {
  if (!a.start.empty() && (a.start.front() != 0 || a.start.back() > a.column.size() || a.column.size() != a.value.size()))
    throw std::invalid_argument(fmt::format("{}: the rows' starts do not fit the {} entries", name, a.column.size()));
  for (std::size_t r = 0; r < a.rows(); ++r)
    if (a.start[r] > a.start[r + 1]) throw std::invalid_argument(fmt::format("{}: row {} ends before it starts", name, r));
  for (std::size_t e = 0; e < a.column.size(); ++e) {
    if (a.column[e] >= a.columns)
      throw std::invalid_argument(fmt::format("{}: column {}, must be less than {}", name, a.column[e], a.columns));
    if (!std::isfinite(a.value[e])) throw std::invalid_argument(fmt::format("{}: entry {} is not finite", name, e));
  }
}

// The columns that have an entry, and where each of them went.
struct Touched {
  std::vector<Index> column;
  std::vector<Index> place;  // of a column, or kNoIndex

  Touched(const SparseRowsView& a, const SparseRowsView& fixed) : place(a.columns, kNoIndex) {
    for (const SparseRowsView* m : {&a, &fixed})
      for (std::size_t e = 0; e < m->column.size(); ++e) place[m->column[e]] = 0;
    for (std::size_t c = 0; c < place.size(); ++c)
      if (place[c] == 0) place[c] = static_cast<Index>(column.size()), column.push_back(static_cast<Index>(c));
  }
};

detail::DenseRows dense(const SparseRowsView& a, const std::vector<std::size_t>& rows, const Touched& touched) {
  detail::DenseRows d(rows.size(), touched.column.size());
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (std::size_t e = a.start[rows[i]]; e < a.start[rows[i] + 1]; ++e) d.row(i)[touched.place[a.column[e]]] += a.value[e];
  return d;
}

std::vector<std::size_t> rowsWithEntries(const SparseRowsView& a) {
  std::vector<std::size_t> rows;
  for (std::size_t r = 0; r < a.rows(); ++r)
    if (std::any_of(a.value.begin() + static_cast<std::ptrdiff_t>(a.start[r]),
                    a.value.begin() + static_cast<std::ptrdiff_t>(a.start[r + 1]), [](double v) { return v != 0; }))
      rows.push_back(r);
  return rows;
}

std::vector<Vec3> solveDense(detail::DenseRows a, const std::vector<Vec3>& b, detail::DenseRows fixed, double tolerance,
                             std::size_t& rank) {
  const std::size_t n = a.columns, m = a.rows;
  const detail::DenseRows original = a;
  const detail::RowSpace held = detail::rowSpace(std::move(fixed), {}, tolerance);
  const detail::RowSpace space = detail::rowSpace(std::move(a), held.q, tolerance);
  rank = space.rank;
  std::vector<Vec3> x(n, Vec3::Zero()), left = b;
  // The second pass takes the rounding of the first.
  for (int pass = 0; pass < 2; ++pass) {
    const std::vector<Vec3> z = detail::leastSquares(space.l, left);
    for (std::size_t k = 0; k < space.rank; ++k)
      for (std::size_t i = 0; i < n; ++i) x[i] += space.q.row(k)[i] * z[k];
    for (std::size_t r = 0; r < m; ++r) {
      left[r] = b[r];
      for (std::size_t i = 0; i < n; ++i) left[r] -= original.row(r)[i] * x[i];
    }
  }
  return x;
}

void append(const SparseRowsView& a, const std::vector<std::size_t>& rows, double weight, const Touched& touched,
            detail::SparseBoth& to) {
  for (const std::size_t r : rows) {
    for (std::size_t e = a.start[r]; e < a.start[r + 1]; ++e) {
      to.rowColumn.push_back(touched.place[a.column[e]]);
      to.rowValue.push_back(weight * a.value[e]);
    }
    to.endRow();
  }
}

struct Rows {
  const SparseRowsView& a;
  const std::vector<std::size_t>& rows;
  const SparseRowsView& fixed;
  const std::vector<std::size_t>& fixedRows;
  const Touched& touched;
};

double largestRow(const SparseRowsView& a) {
  double largest = 0;
  for (std::size_t r = 0; r < a.rows(); ++r) {
    double sum = 0;
    for (std::size_t e = a.start[r]; e < a.start[r + 1]; ++e) sum += a.value[e] * a.value[e];
    largest = std::max(largest, sum);
  }
  return std::sqrt(largest);
}

std::vector<Vec3> solveSparse(const Rows& r, std::vector<Vec3> right, const MinNormOptions& options, MinNormReport& out) {
  out.method = MinNormMethod::Lsqr;
  detail::SparseBoth both;
  both.columns = r.touched.column.size();
  append(r.a, r.rows, 1, r.touched, both);
  if (!r.fixedRows.empty()) append(r.fixed, r.fixedRows, kFixedWeight * largestRow(r.a) / largestRow(r.fixed), r.touched, both);
  if (options.damping > 0) {
    const double weight = options.damping * largestRow(r.a);
    for (std::size_t c = 0; c < both.columns; ++c) {
      both.rowColumn.push_back(static_cast<Index>(c));
      both.rowValue.push_back(weight);
      both.endRow();
    }
  }
  both.finish();
  right.resize(both.rows, Vec3::Zero());
  std::vector<Vec3> y(both.columns);
  const detail::LsqrOutcome outcome = detail::lsqr(both, right, options.tolerance, options.maxIterations, y);
  out.iterations = outcome.iterations;
  out.converged = outcome.converged;
  return y;
}

std::vector<Vec3> spread(const std::vector<Vec3>& y, const Touched& touched, std::vector<Vec3> x) {
  for (std::size_t i = 0; i < y.size(); ++i) x[touched.column[i]] = y[i];
  return x;
}

}  // namespace

std::vector<Vec3> minNormLeastSquares(const SparseRowsView& a, Points b, const SparseRowsView& fixed,
                                      const MinNormOptions& options, MinNormReport* report) {
  requireMatrix("a", a);
  requireMatrix("fixed", fixed);
  requirePositive("rankTolerance", options.rankTolerance);
  requirePositive("tolerance", options.tolerance);
  requireInRange("damping", options.damping, 0, 1e6);
  if (b.size() != a.rows()) throw std::invalid_argument(fmt::format("b: {} rows, expected {}", b.size(), a.rows()));
  if (fixed.rows() > 0 && fixed.columns != a.columns)
    throw std::invalid_argument(fmt::format("fixed: {} columns, expected {}", fixed.columns, a.columns));
  const Touched touched(a, fixed);
  const std::vector<std::size_t> rows = rowsWithEntries(a), fixedRows = rowsWithEntries(fixed);
  std::vector<Vec3> right;
  for (const std::size_t r : rows) {
    if (!b[r].allFinite()) throw std::invalid_argument(fmt::format("b: row {} is not finite", r));
    right.push_back(b[r]);
  }
  MinNormReport local;
  MinNormReport& out = report ? *report : local;
  out = {};
  out.rows = rows.size(), out.columns = touched.column.size();
  std::vector<Vec3> x(a.columns, Vec3::Zero());
  if (rows.empty()) return x;

  const double m = static_cast<double>(rows.size() + fixedRows.size()), n = static_cast<double>(touched.column.size());
  const double work = m * (n + std::min(m, n)) <= kDenseEntries ? m * n * std::min(m, n) : std::numeric_limits<double>::infinity();
  std::vector<Vec3> y;
  if (options.damping > 0 || !(work <= options.denseWork)) {
    y = solveSparse({a, rows, fixed, fixedRows, touched}, right, options, out);
    if (out.converged || options.damping > 0 || !(work <= options.fallbackWork)) return spread(y, touched, std::move(x));
  }
  out.method = MinNormMethod::Dense;
  out.converged = true;
  y = solveDense(dense(a, rows, touched), right, dense(fixed, fixedRows, touched), options.rankTolerance, out.rank);
  return spread(y, touched, std::move(x));
}

}  // namespace fielddeform::numeric
