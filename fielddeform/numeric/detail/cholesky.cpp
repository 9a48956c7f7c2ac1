#include <fielddeform/core/parallel.h>
#include <fielddeform/numeric/detail/cholesky.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::numeric::detail {
namespace {

constexpr std::size_t kLanes = 8;
constexpr std::size_t kBlock = 48;  // columns whose rows stay in the first cache

double fold(const double (&lane)[kLanes]) {
  return ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]));
}

// One column block of the diagonal: plain Cholesky of rows and columns [begin, end), earlier columns already applied.
bool factorizeDiagonal(Dense& a, std::size_t begin, std::size_t end) {
  for (std::size_t j = begin; j < end; ++j) {
    double* rj = a.row(j);
    for (std::size_t k = begin; k < j; ++k) {
      const double* rk = a.row(k);
      rj[k] = (rj[k] - dot(rj + begin, rk + begin, k - begin)) / rk[k];
    }
    const double before = rj[j];
    const double pivot = before - dot(rj + begin, rj + begin, j - begin);
    // What is left of the diagonal must be more than its rounding.
    if (!(pivot > 0) || !std::isfinite(pivot)) return false;
    rj[j] = std::sqrt(pivot);
  }
  return true;
}

}  // namespace

double dot(const double* a, const double* b, std::size_t n) noexcept {
  double lane[kLanes] = {};
  std::size_t i = 0;
  for (; i + kLanes <= n; i += kLanes)
    for (std::size_t l = 0; l < kLanes; ++l) lane[l] += a[i + l] * b[i + l];
  for (std::size_t l = 0; i < n; ++i, ++l) lane[l] += a[i] * b[i];
  return fold(lane);
}

bool factorize(Dense& a) {
  const std::size_t n = a.size;
  std::vector<double> smallest(n);
  for (std::size_t i = 0; i < n; ++i) smallest[i] = 1e-15 * a.row(i)[i];
  for (std::size_t begin = 0; begin < n; begin += kBlock) {
    const std::size_t end = std::min(n, begin + kBlock);
    // Columns [begin, end) of all rows below, less the products of the columns already done.
    parallelFor(n - begin, 16, [&](std::size_t first, std::size_t last) {
      for (std::size_t j = begin; j < end; ++j)
        for (std::size_t i = std::max(begin + first, j); i < begin + last; ++i)
          a.row(i)[j] -= dot(a.row(i), a.row(j), begin);
    });
    if (!factorizeDiagonal(a, begin, end)) return false;
    for (std::size_t j = begin; j < end; ++j)
      if (!(a.row(j)[j] * a.row(j)[j] > smallest[j])) return false;
    parallelFor(n - end, 16, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = end + first; i < end + last; ++i)
        for (std::size_t j = begin; j < end; ++j) {
          double* ri = a.row(i);
          const double* rj = a.row(j);
          ri[j] = (ri[j] - dot(ri + begin, rj + begin, j - begin)) / rj[j];
        }
    });
  }
  return true;
}

void solve(const Dense& factor, double* x) {
  const std::size_t n = factor.size;
  for (std::size_t i = 0; i < n; ++i) x[i] = (x[i] - dot(factor.row(i), x, i)) / factor.row(i)[i];
  for (std::size_t i = n; i-- > 0;) {
    const double* row = factor.row(i);
    x[i] /= row[i];
    for (std::size_t k = 0; k < i; ++k) x[k] -= row[k] * x[i];
  }
}

}  // namespace fielddeform::numeric::detail
