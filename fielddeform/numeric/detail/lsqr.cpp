#include <fielddeform/core/parallel.h>
#include <fielddeform/numeric/detail/lsqr.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::numeric::detail {
namespace {

constexpr std::size_t kGrain = 2048;
using Array3 = Eigen::Array3d;
using Columns3 = std::vector<Vec3>;

// y = A x - shift y, component by component; start, index, value: A's rows (or its columns: A^T).
void multiplySubtract(const std::vector<std::size_t>& start, const std::vector<Index>& index, const std::vector<double>& value,
                      const Columns3& x, const Array3& shift, Columns3& y) {
  parallelFor(y.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t r = begin; r < end; ++r) {
      Vec3 sum = Vec3::Zero();
      for (std::size_t e = start[r]; e < start[r + 1]; ++e) sum += value[e] * x[index[e]];
      y[r] = sum - Vec3(shift * y[r].array());
    }
  });
}

Array3 norms(const Columns3& x) {
  const auto chunk = [&](std::size_t begin, std::size_t end) {
    Vec3 sum = Vec3::Zero();
    for (std::size_t i = begin; i < end; ++i) sum += x[i].cwiseAbs2();
    return sum;
  };
  const Vec3 total =
      deterministicReduce(x.size(), kGrain, Vec3(Vec3::Zero()), chunk, [](const Vec3& p, const Vec3& q) { return Vec3(p + q); });
  return total.array().sqrt();
}

void scale(Columns3& x, const Array3& by) {
  parallelFor(x.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) x[i] = x[i].array() * by;
  });
}

Array3 inverse(const Array3& x) { return (x > 0).select(1 / x, Array3::Zero()); }

}  // namespace

void SparseBoth::finish() {
  columnStart.assign(columns + 1, 0);
  for (const Index c : rowColumn) ++columnStart[c + 1];
  for (std::size_t c = 0; c < columns; ++c) columnStart[c + 1] += columnStart[c];
  columnRow.resize(rowColumn.size());
  columnValue.resize(rowColumn.size());
  std::vector<std::size_t> at(columnStart.begin(), columnStart.end() - 1);
  for (std::size_t r = 0; r < rows; ++r)
    for (std::size_t e = rowStart[r]; e < rowStart[r + 1]; ++e) {
      const std::size_t to = at[rowColumn[e]]++;
      columnRow[to] = static_cast<Index>(r);
      columnValue[to] = rowValue[e];
    }
}

LsqrOutcome lsqr(const SparseBoth& a, Points b, double tolerance, int maxIterations, std::span<Vec3> x) {
  std::fill(x.begin(), x.end(), Vec3::Zero());
  Columns3 u(b.begin(), b.end()), v(a.columns, Vec3::Zero()), w;
  Array3 beta = norms(u);
  const Array3 right = beta;
  scale(u, inverse(beta));
  multiplySubtract(a.columnStart, a.columnRow, a.columnValue, u, Array3::Zero(), v);
  Array3 alpha = norms(v);
  scale(v, inverse(alpha));
  w = v;
  Array3 phiBar = beta, rhoBar = alpha, matrixSquared = alpha.square();
  Eigen::Array<bool, 3, 1> done = (alpha * beta == 0);
  LsqrOutcome outcome;
  while (!done.all() && outcome.iterations < maxIterations) {
    ++outcome.iterations;
    multiplySubtract(a.rowStart, a.rowColumn, a.rowValue, v, alpha, u);
    beta = norms(u);
    scale(u, inverse(beta));
    multiplySubtract(a.columnStart, a.columnRow, a.columnValue, u, beta, v);
    alpha = norms(v);
    scale(v, inverse(alpha));
    const Array3 rho = (rhoBar.square() + beta.square()).sqrt();
    const Array3 c = rhoBar * inverse(rho), s = beta * inverse(rho), theta = s * alpha, phi = c * phiBar;
    rhoBar = -c * alpha;
    phiBar = s * phiBar;
    matrixSquared += alpha.square() + beta.square();
    const Array3 step = done.select(Array3::Zero(), phi * inverse(rho)), turn = theta * inverse(rho);
    parallelFor(x.size(), kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        x[i] += Vec3(step * w[i].array());
        w[i] = v[i] - Vec3(turn * w[i].array());
      }
    });
    // |residual| = phiBar; |A^T residual| = phiBar alpha |c|.
    done = done || phiBar <= tolerance * right || alpha * c.abs() <= tolerance * matrixSquared.sqrt() || rho == 0;
  }
  outcome.converged = done.all();
  return outcome;
}

}  // namespace fielddeform::numeric::detail
