#pragma once

#include <fielddeform/core/types.h>

#include <memory>

namespace fielddeform::numeric {

struct CompactRbfOptions {
  double smoothing = 0;       ///< >= 0, dimensionless, of the strength that it has in Rbf: 0 interpolates
  double tolerance = 1e-6;    ///< greatest residual at the centres, units of the values, > 0
  double support = 4;         ///< of a kernel, in spacings of its level, 1.5 to 8
  int maxIterations = 500;    ///< of the solver, a level
};

struct CompactRbfReport {
  std::size_t centres = 0;    ///< given
  std::size_t distinct = 0;   ///< after centres closer than 1e-9 of the extent were merged and their values averaged
  int levels = 0;
  std::size_t terms = 0;      ///< kernels of all levels
  int iterations = 0;         ///< of all levels
  double residual = 0;        ///< greatest |f(c_j) - value_j|, units of the values; above the tolerance: not reached
};

/// Interpolant of many scattered numbers by compactly supported functions, coarse to fine:
///   f(p) = a + b p + sum_levels sum_j w_j phi(|p - c_j| / s),  phi(t) = (1 - t)^4 (4 t + 1),
/// each level fitted to what the coarser ones leave, on ever denser subsets of the centres with ever smaller supports s.
/// [Wendland 1995; Floater & Iske 1996; Ohtake, Belyaev & Seidel 2003]
/// With smoothing a level is fitted to all centres, by least squares with the penalty 20 smoothing / s^3 on its native norm:
/// s^3 phi / 20 is r^3 to what is fine, so that the smoothing means what it means in Rbf, and levels too fine for it stay away.
/// Memory is linear in the centres; each level's sparse system is solved by conjugate gradients, and its conditioning
/// does not depend on their number. The linear part is the least-squares fit, of least norm where the centres are flat.
/// Same bits on every CPU and thread count. Immutable, safe to use from many threads.
class CompactRbf {
 public:
  /// @param centres  #C by 3, at least 1, values #C
  /// @throw std::invalid_argument if the sizes differ, there are none, a number is not finite, or an option out of range
  CompactRbf(Points centres, std::span<const double> values, const CompactRbfOptions& options = {});
  ~CompactRbf();
  CompactRbf(CompactRbf&&) noexcept;
  CompactRbf& operator=(CompactRbf&&) noexcept;

  const CompactRbfReport& report() const noexcept;
  /// Value and gradient. Cost: the kernels that reach the point, about a hundred a level.
  double evaluate(const Vec3& point, Vec3& gradient) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fielddeform::numeric
