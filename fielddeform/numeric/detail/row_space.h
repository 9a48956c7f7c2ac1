#pragma once

#include <fielddeform/core/types.h>

#include <vector>

namespace fielddeform::numeric::detail {

/// Rows of equal length, one after the other.
struct DenseRows {
  std::size_t rows = 0, columns = 0;
  std::vector<double> value;

  DenseRows() = default;
  DenseRows(std::size_t r, std::size_t c) : rows(r), columns(c), value(r * c) {}
  double* row(std::size_t r) { return value.data() + r * columns; }
  const double* row(std::size_t r) const { return value.data() + r * columns; }
};

/// An orthonormal basis of the rows' span, by Gram-Schmidt with the largest remainder first, each row made orthogonal
/// twice; A(pivot order) = L Q with L lower trapezoidal. Same bits on any number of threads.
struct RowSpace {
  DenseRows q;                     ///< rank by columns
  DenseRows l;                     ///< rows by rank, in the rows' own order
  std::vector<std::size_t> pivot;  ///< rank: row k of q came from row pivot[k]
  std::size_t rank = 0;
};

/// @param a          consumed
/// @param excluded   an orthonormal set whose span is taken out of the rows first; may be empty
/// @param tolerance  remainders up to this share of the largest row add no rank
RowSpace rowSpace(DenseRows a, const DenseRows& excluded, double tolerance);

/// z that minimises |L z - b|, L of full column rank. [Bjoerck 1967: Gram-Schmidt with b as the last column]
/// @param l  rows by rank @param b  #rows by 3 @return #rank by 3
std::vector<Vec3> leastSquares(const DenseRows& l, Points b);

}  // namespace fielddeform::numeric::detail
