#pragma once

#include <cstddef>
#include <vector>

namespace fielddeform::numeric::detail {

/// Sum of products in eight fixed lanes: the same bits on every CPU, which a library that blocks by the size of the
/// cache does not promise.
double dot(const double* a, const double* b, std::size_t n) noexcept;

/// A dense symmetric matrix, rows stored whole; only the lower triangle is read.
struct Dense {
  std::size_t size = 0;
  std::vector<double> value;  ///< size * size, row by row

  double* row(std::size_t i) { return value.data() + i * size; }
  const double* row(std::size_t i) const { return value.data() + i * size; }
};

/// Replaces the lower triangle by its Cholesky factor, in parallel, the same bits on any thread count. False if the
/// matrix is not positive definite to rounding; the content is then undefined. Cost: size^3 / 3.
bool factorize(Dense& a);

/// Solves L L^T x = b in place, for a factor made by factorize().
void solve(const Dense& factor, double* x);

}  // namespace fielddeform::numeric::detail
