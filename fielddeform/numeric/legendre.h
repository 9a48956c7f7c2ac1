#pragma once

#include <span>
#include <vector>

namespace fielddeform::numeric {

/// Points and weights of a quadrature over [0, 1].
struct Quadrature {
  std::vector<double> point, weight;
};

/// Gauss-Legendre with n points over [0, 1]: exact to degree 2 n - 1.
/// @throw std::invalid_argument unless 1 <= n <= 200
Quadrature gaussLegendre(int n);

/// Shifted Legendre polynomials P_k(2 u - 1), k = 0 .. out.size() - 1, by their recurrence: well conditioned at any degree
/// for u in [0, 1], and stable somewhat beyond. Orthogonal, integral of P_k^2 over [0, 1] = 1 / (2 k + 1).
void shiftedLegendre(double u, std::span<double> out);

/// Antiderivatives from 0: integral of P_k(2 t - 1) over [0, u].
void shiftedLegendreIntegrals(double u, std::span<double> out);

}  // namespace fielddeform::numeric
