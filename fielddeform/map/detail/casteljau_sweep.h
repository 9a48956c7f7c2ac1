#pragma once

#include <fielddeform/map/casteljau.h>
#include <fielddeform/map/detail/casteljau_kernels.h>

namespace fielddeform::map::detail {

/// A piece in closed form: image = c(u) + v S(u) + w T(u), Bernstein control vectors.
struct Sweep {
  std::size_t degree = 1;
  std::vector<Triple<double>> c, s, t;  ///< degree + 1, degree, degree

  explicit Sweep(const CasteljauPiece& piece);
  bool isZero() const;
};
Sweep operator-(const Sweep& a, const Sweep& b);

/// The curves of a sweep at one parameter, along the tangents beyond [0, 1].
struct SweepFrame {
  Vec3 c, s, t, dc, ds, dt;  ///< d: by u of the piece

  SweepFrame(const Sweep& sweep, double u);
  Vec3 image(double v, double w) const { return c + v * s + w * t; }
  /// Derivative of the image by (u, v, w), columns.
  Mat3 jacobian(double v, double w) const;
};

inline constexpr std::size_t kSweepBlock = 8;
/// Images of a block of points with u in [0, 1], the same bits as sweep() gives for each.
/// @param uvw, out  u of all, v of all, w of all; x of all ...
void sweepBlock(const Sweep& sweep, const std::array<double, 3 * kSweepBlock>& uvw, std::array<double, 3 * kSweepBlock>& out);

/// Where a point lies in the space of a curve of several pieces.
struct SweepPlace {
  std::size_t piece = 0;
  Vec3 uvw = Vec3::Zero();    ///< u of the piece; beyond [0, 1] only at the curve's ends
  double distance = 0;        ///< world, from the curve's point c(u)
  bool found = false;
};
/// The nearest place whose cross plane c(u) + span(S, T) holds the point: roots of det[x - c, S, T] along the curve.
SweepPlace locate(const std::vector<Sweep>& curve, const Vec3& x, bool beyondEnds);

}  // namespace fielddeform::map::detail
