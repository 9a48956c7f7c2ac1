#pragma once

#include <fielddeform/core/types.h>

#include <vector>

namespace fielddeform::numeric::detail {

/// A matrix by rows and, for products with its transpose in a fixed order, by columns.
struct SparseBoth {
  std::size_t rows = 0, columns = 0;
  std::vector<std::size_t> rowStart{0}, columnStart;
  std::vector<Index> rowColumn, columnRow;
  std::vector<double> rowValue, columnValue;

  void endRow() { rowStart.push_back(rowColumn.size()), ++rows; }
  void finish();  ///< makes the columns of the rows
};

struct LsqrOutcome {
  int iterations = 0;
  bool converged = true;
};

/// The least-norm least-squares solution for three right sides, each with its own iteration. [Paige & Saunders 1982]
/// Started from zero, every iterate lies in the rows' span, so the limit has the least norm.
LsqrOutcome lsqr(const SparseBoth& a, Points b, double tolerance, int maxIterations, std::span<Vec3> x);

}  // namespace fielddeform::numeric::detail
