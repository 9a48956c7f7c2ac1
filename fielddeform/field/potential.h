#pragma once

#include <fielddeform/skeleton/skeleton.h>

namespace fielddeform::field {

/// Potential of one primitive as a function of x = k d / r: distance in falloff lengths, dimensionless, 0 on the
/// primitive, k at the influence radius, negative inside a solid. With u = d / r = x / k:
///
///   Exponential  e^-x - e^-k                                    E(0) = 1 - e^-k   [Qin et al. 2003, eq. (2)]
///   Gaussian     e^(-k u^2) - e^-k                              E(0) = 1 - e^-k   [Blinn 1982]
///   Metaball     1 - 3 u^2 (u <= 1/3), 3/2 (1 - u)^2            E(0) = 1          [Nishimura et al. 1985]
///   SoftObject   1 - (4 u^6 - 17 u^4 + 22 u^2) / 9              E(0) = 1          [Wyvill et al. 1986]
///
/// Zero at and beyond x = k. Inside a solid (x < 0) the exponential goes on, held at x >= -600 so that it stays finite;
/// the others, whose slope is 0 there, go on linearly with their mean slope, E(0) / k (an addition of ours: the papers
/// have no inside). Arithmetic is the project's own: the same bits on every CPU.
class Kernel {
 public:
  /// @param sharpness  k in [1e-3, 500]: beyond, E leaves the range of doubles
  /// @throw std::invalid_argument if it is not
  Kernel(skeleton::Potential potential, double sharpness);

  skeleton::Potential potential() const noexcept { return potential_; }
  double atZero() const noexcept { return atZero_; }  ///< E(0)

  double value(double x) const noexcept;       ///< E(x) >= 0, not increasing
  double derivative(double x) const noexcept;  ///< dE/dx <= 0; one-sided from inside the radius at x = k, from outside at 0
  /// The x with E(x) = s: k for s <= 0, negative for s > E(0). Where the slope vanishes (x = 0, and x = k for metaball
  /// and soft object) it is as exact as s allows, about the square root of the rounding.
  double inverse(double s) const noexcept;
  /// dE/dx at inverse(s), without its rounding.
  double slopeAt(double s) const noexcept;

 private:
  skeleton::Potential potential_;
  double sharpness_;   // k
  double end_;         // e^-k
  double atZero_;
  double meanSlope_;   // E(0) / k
};

}  // namespace fielddeform::field
