#pragma once

#include <fielddeform/core/types.h>

#include <memory>

namespace fielddeform::numeric {

struct RbfOptions {
  double smoothing = 0;            ///< >= 0, dimensionless: 0 interpolates, large values give the best linear fit
  std::size_t maxCentres = 2000;   ///< more are refused: the solve is dense, O(n^3) time and 8 n^2 bytes
  double tolerance = 1e-8;         ///< of many points together, >= 0: see Rbf; 0 adds up all centres for each point
};

/// How the system was solved.
struct RbfReport {
  std::size_t centres = 0;   ///< given
  std::size_t distinct = 0;  ///< after centres closer than 1e-9 of the extent were merged and their values averaged
  int polynomialTerms = 0;   ///< 1 + dimensions that the centres span: 4, 3 coplanar, 2 collinear, 1 a point
  double ridge = 0;          ///< added to the diagonal because the matrix was not positive definite to rounding; else 0
  double residual = 0;       ///< largest |f(c_j) - value_j| over the distinct centres, units of the values
};

/// The variational (triharmonic) interpolant of vectors at scattered centres:
///   f(p) = sum_j w_j |p - c_j|^3 + a + B p,  sum_j w_j = 0,  sum_j w_j c_j^T = 0.   [Turk & O'Brien 1999]
/// It reproduces linear functions. Centres that lie in a plane, a line or a point leave B undetermined across; B is then
/// the one of least norm: nothing changes in those directions but by the radial terms.
/// Centres are normalised inside: scaling centres and points by a power of two changes no bit, scaling the values
/// scales the result. Same bits on every CPU and thread count. Immutable, safe to use from many threads.
/// One point adds up all centres. Many points together (from 131,072 points and 256 centres on) share what centres far from them
/// add: their values differ from one point's by at most `tolerance` times the greatest value given, their gradients by at most
/// 20 `tolerance` times that value by half the centres' extent, proven, plus rounding; so their last bits depend on which
/// points are given together.
class Rbf {
 public:
  /// @param centres  #C by 3, at least 1;  @param values  #C by 3
  /// @throw std::invalid_argument if the sizes differ, none or more than maxCentres are given, a number is not finite, or
  ///        the smoothing is negative
  Rbf(Points centres, Points values, const RbfOptions& options = {});
  ~Rbf();
  Rbf(Rbf&&) noexcept;
  Rbf& operator=(Rbf&&) noexcept;

  const RbfReport& report() const noexcept;
  Vec3 evaluate(const Vec3& point) const;
  Mat3 jacobian(const Vec3& point) const;  ///< row = component of the value
  /// The first component and its gradient: scalars are given as (value, 0, 0). Quicker than the two above.
  double first(const Vec3& point, Vec3& gradient) const;
  /// Many points, in parallel. @throw std::invalid_argument if the sizes differ
  void evaluate(Points points, std::span<Vec3> out) const;
  void first(Points points, std::span<double> values, std::span<Vec3> gradients) const;
  bool togetherIsQuicker(std::size_t points) const noexcept;  ///< whether so many are taken together

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fielddeform::numeric
