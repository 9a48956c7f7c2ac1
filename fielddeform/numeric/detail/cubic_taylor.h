#pragma once

#include <fielddeform/core/types.h>

/// Sums of w |p - c|^3 over centres that are far away, as one polynomial of p - origin: Taylor's, of total degree kTaylorDegree.
namespace fielddeform::numeric::detail {

inline constexpr int kTaylorDegree = 11;
/// Coefficients of x^i y^j z^k, i + j + k <= degree, k fastest, then j.
inline constexpr std::size_t kTaylorTerms = (kTaylorDegree + 1) * (kTaylorDegree + 2) * (kTaylorDegree + 3) / 6;

/// How far a centre's polynomial may be off within `radius` of the origin, the centre `distance` from it, for weight 1.
/// Infinite where distance < 2 radius.
struct TaylorBound {
  double value;
  double gradient;
};
TaylorBound taylorBound(double radius, double distance);

/// Adds the polynomials of `count` blocks of eight centres (cubic_sum.h; unused places hold some centre with weights 0) to the
/// first `components` (1 or 3) times kTaylorTerms coefficients.
void addTaylor(const double* blocks, std::size_t count, const Vec3& origin, std::size_t components, double* terms);

/// The same polynomial of p - (origin + by).
void moveTaylor(const Vec3& by, double* terms);

/// Points to be evaluated together: x, y, z of each in three arrays of `count`, a multiple of kCubicTogether.
inline constexpr std::size_t kCubicTogether = 32;
struct CubicPoints {
  const double* x;
  const double* y;
  const double* z;
  std::size_t count;
};

/// A polynomial (terms null: none) and centres near by: x, y, z and three weights of each.
struct CubicNear {
  const double* terms;
  Vec3 origin;
  const double* centres;
  std::size_t count;
};

/// Sums of the first component and their gradients: `out` holds four arrays of points.count.
void cubicFirstTogether(const CubicNear& near, const CubicPoints& points, double* out);
/// Sums of the three components: `out` holds three arrays of points.count.
void cubicSumsTogether(const CubicNear& near, const CubicPoints& points, double* out);

}  // namespace fielddeform::numeric::detail
