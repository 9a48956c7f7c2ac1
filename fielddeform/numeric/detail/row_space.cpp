#include <fielddeform/core/parallel.h>
#include <fielddeform/numeric/detail/cholesky.h>
#include <fielddeform/numeric/detail/row_space.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::numeric::detail {
namespace {

constexpr std::size_t kGrain = 16;

void addTo(double* x, double factor, const double* y, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i) x[i] += factor * y[i];
}

double norm(const double* x, std::size_t n) { return std::sqrt(dot(x, x, n)); }

}  // namespace

RowSpace rowSpace(DenseRows a, const DenseRows& excluded, double tolerance) {
  const std::size_t m = a.rows, n = a.columns, most = std::min(m, n);
  RowSpace space;
  std::vector<double> left(m);
  double largest = 0;
  for (std::size_t r = 0; r < m; ++r) largest = std::max(largest, norm(a.row(r), n));
  parallelFor(m, kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t r = begin; r < end; ++r) {
      for (int pass = 0; pass < 2; ++pass)
        for (std::size_t k = 0; k < excluded.rows; ++k)
          addTo(a.row(r), -dot(a.row(r), excluded.row(k), n), excluded.row(k), n);
      left[r] = norm(a.row(r), n);
    }
  });
  std::vector<double> q, coefficient;  // coefficient: column k of L, one after the other
  std::vector<char> used(m, 0);
  while (space.rank < most) {
    std::size_t best = m;
    for (std::size_t r = 0; r < m; ++r)
      if (!used[r] && (best == m || left[r] > left[best])) best = r;
    if (best == m || !(left[best] > tolerance * largest)) break;
    const std::size_t k = space.rank++;
    q.insert(q.end(), a.row(best), a.row(best) + n);
    double* direction = q.data() + k * n;
    // Subtracting row after row leaves rounding in the earlier directions; once more makes them orthogonal to rounding.
    for (std::size_t j = 0; j < excluded.rows; ++j) addTo(direction, -dot(direction, excluded.row(j), n), excluded.row(j), n);
    for (std::size_t j = 0; j < k; ++j) {
      const double c = dot(direction, q.data() + j * n, n);
      addTo(direction, -c, q.data() + j * n, n);
      coefficient[j * m + best] += c;
    }
    const double length = norm(direction, n);
    for (std::size_t i = 0; i < n; ++i) direction[i] /= length;
    coefficient.resize((k + 1) * m, 0.0);
    coefficient[k * m + best] = length;
    used[best] = 1;
    space.pivot.push_back(best);
    parallelFor(m, kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t r = begin; r < end; ++r) {
        if (used[r]) continue;
        const double c = dot(a.row(r), direction, n);
        addTo(a.row(r), -c, direction, n);
        coefficient[k * m + r] = c;
        left[r] = norm(a.row(r), n);
      }
    });
  }
  space.q.rows = space.rank, space.q.columns = n, space.q.value = std::move(q);
  space.l = DenseRows(m, space.rank);
  for (std::size_t k = 0; k < space.rank; ++k)
    for (std::size_t r = 0; r < m; ++r) space.l.row(r)[k] = coefficient[k * m + r];
  return space;
}

std::vector<Vec3> leastSquares(const DenseRows& l, Points b) {
  const std::size_t m = l.rows, n = l.columns;
  // Columns contiguous: n of L, then the three right sides.
  DenseRows c(n + 3, m);
  for (std::size_t r = 0; r < m; ++r) {
    for (std::size_t k = 0; k < n; ++k) c.row(k)[r] = l.row(r)[k];
    for (int j = 0; j < 3; ++j) c.row(n + static_cast<std::size_t>(j))[r] = b[r][j];
  }
  DenseRows upper(n, n + 3);  // R and Q^T b
  for (std::size_t k = 0; k < n; ++k) {
    const double length = norm(c.row(k), m);
    upper.row(k)[k] = length;
    for (std::size_t i = 0; i < m; ++i) c.row(k)[i] /= length;
    parallelFor(n + 3 - (k + 1), kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t j = k + 1 + begin; j < k + 1 + end; ++j) {
        upper.row(k)[j] = dot(c.row(k), c.row(j), m);
        addTo(c.row(j), -upper.row(k)[j], c.row(k), m);
      }
    });
  }
  std::vector<Vec3> z(n);
  for (std::size_t k = n; k-- > 0;) {
    Vec3 sum(upper.row(k)[n], upper.row(k)[n + 1], upper.row(k)[n + 2]);
    for (std::size_t j = k + 1; j < n; ++j) sum -= upper.row(k)[j] * z[j];
    z[k] = sum / upper.row(k)[k];
  }
  return z;
}

}  // namespace fielddeform::numeric::detail
