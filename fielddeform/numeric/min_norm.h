#pragma once

#include <fielddeform/core/types.h>

#include <vector>

namespace fielddeform::numeric {

/// A sparse matrix by rows, not owned: row r has the entries start[r] .. start[r+1]-1. Columns of a row are distinct.
struct SparseRowsView {
  std::size_t columns = 0;
  std::span<const std::size_t> start;  ///< #R+1
  std::span<const Index> column;
  std::span<const double> value;

  std::size_t rows() const noexcept { return start.empty() ? 0 : start.size() - 1; }
};

enum class MinNormMethod : std::uint8_t {
  Dense,  ///< orthogonal factorisation that reveals the rank
  Lsqr,   ///< Paige & Saunders' iteration: memory of the sparse matrix twice and a few vectors
};

struct MinNormOptions {
  double rankTolerance = 1e-10;  ///< > 0: a row that lies in the others' span but for this share of the largest row adds no rank
  double denseWork = 2e7;        ///< rows * columns * min(rows, columns) up to which the dense method is taken (0: never)
  double fallbackWork = 2e9;     ///< the same, up to which it is taken after all if the iteration does not converge
  double tolerance = 1e-14;      ///< > 0: LSQR stops at this residual (of the right side) or gradient (of matrix * residual)
  /// >= 0, of the largest row's length: |A x - b|^2 + (damping * length)^2 |x|^2 is least instead, by LSQR. What only large x
  /// could reach is then not reached, nor paid for; 0: not.
  double damping = 0;
  int maxIterations = 2000;      ///< >= 1, LSQR
};

struct MinNormReport {
  MinNormMethod method = MinNormMethod::Dense;
  std::size_t rows = 0;        ///< with an entry
  std::size_t columns = 0;     ///< with an entry
  std::size_t rank = 0;        ///< Dense: found; Lsqr: unknown, 0
  int iterations = 0;          ///< Lsqr
  bool converged = true;       ///< false if LSQR's maxIterations came first and the dense method would be too much work
};

/// The x of least norm among those that minimise |A x - b|: x = A^+ b, for any shape and rank; three right sides at once.
/// Columns without an entry get exactly 0. Same bits on every CPU and any number of threads.
/// @param a      #R rows
/// @param b      #R by 3
/// @param fixed  rows C with C x = 0 that hold whatever A asks; x is least within them. Dense: exactly. Lsqr: as rows that
///               weigh 1e4 times the largest row of A.
/// @return #columns by 3
/// @throw std::invalid_argument if sizes differ, an index is out of range, or a number is not finite
/// Cost, dense: rows * columns * rank operations, 8 bytes * rows * (columns + rank); else iterations * entries.
std::vector<Vec3> minNormLeastSquares(const SparseRowsView& a, Points b, const SparseRowsView& fixed,
                                      const MinNormOptions& options = {}, MinNormReport* report = nullptr);

}  // namespace fielddeform::numeric
