#pragma once

#include <fielddeform/map/lattice.h>

#include <vector>

/// Generalised de Casteljau free-form deformation. [Chang & Rockwood 1994]
namespace fielddeform::map {

inline constexpr int kMaxCasteljauDegree = 64;

/// A Bezier curve of degree n whose control polygon's segments carry the space along:
///   x_i^0 = p_i,   x_i^j = (1 - u) x_i^{j-1} + u x_{i+1}^{j-1} + v s_i^j + w t_i^j,  i = 0 .. n - j;   the image is x_0^n.
/// Every step is an affine map of (u, v, w). All handles zero above level 1: the maps of the segments are blended. All s (or t)
/// zero: the solid collapses to a patch; both: the classic curve.
struct CasteljauPiece {
  std::vector<Vec3> points;                  ///< p_0 .. p_n, world; n = 1 .. kMaxCasteljauDegree
  /// Handles, world: s[j - 1][i] belongs to level j and segment i, n - j + 1 a level. Levels left out, or empty, are all zero.
  std::vector<std::vector<Vec3>> s{}, t{};
  double length = 1;                         ///< > 0: its share of the parameter range, in proportion to the other pieces'

  int degree() const noexcept { return static_cast<int>(points.size()) - 1; }
  /// @throw std::invalid_argument
  void validate() const;
};

/// Pieces one after the other: the parameter u in [0, 1] runs through them in proportion to their lengths.
struct CasteljauCurve {
  std::vector<CasteljauPiece> pieces;

  /// @throw std::invalid_argument
  void validate() const;
};

/// x_0^j .. x_{n-j}^j at one place by the paper's recurrence, u in [0, 1] along this piece. [the algorithm; Figs 3 and 4]
/// @param level  j, 0 .. n
/// @throw std::invalid_argument
std::vector<Vec3> casteljauLevel(const CasteljauPiece& piece, int level, const Vec3& uvw);

/// The curve that leaves the space of an affine frame as it is: control points evenly along the frame's first edge (u), every
/// handle of level 1 its second (s) or third edge (t), all others zero.
/// @param lengths  one a piece, > 0
CasteljauCurve straightCurve(const LatticeBox& frame, int degree, std::span<const double> lengths);
inline CasteljauCurve straightCurve(const LatticeBox& frame, int degree) {
  const double one = 1;
  return straightCurve(frame, degree, {&one, 1});
}

/// How a frame is laid around an object.
enum class FrameAxis : std::uint8_t {
  Auto,      ///< u along the longest side of its box (ties: x, y, z)
  X, Y, Z,   ///< u along this axis
  Oriented,  ///< u along the greatest variance (fitOrientedBox)
};
std::string_view toString(FrameAxis axis) noexcept;  ///< "auto", "x", "y", "z", "oriented"

/// The frame around points: u from 0 to 1 along its axis through the middle of the box, v and w from -1 to 1 across; right-handed.
LatticeBox fitFrame(Points points, FrameAxis axis = FrameAxis::Auto);

/// How smoothly neighbouring pieces meet, the greatest over the joints, world. The space map is C1 if all four vanish: the
/// image is c(u) + v S(u) + w T(u), polynomials of degree n, n - 1, n - 1 a piece.
struct JointGaps {
  double position = 0, handle = 0;           ///< of c; of S and T
  double slope = 0, handleSlope = 0;         ///< of their derivatives by u
};
JointGaps jointGaps(const CasteljauCurve& curve);

/// The curve with its joints made C1: the common point becomes the mean of its neighbours in proportion to the lengths, and so
/// do the handles of level 1 at the joint. Nothing else moves.
/// @throw std::invalid_argument if a piece with a neighbour has a degree below 3: its middle handles belong to both ends
CasteljauCurve joinC1(CasteljauCurve curve);

/// A C1 curve of cubic pieces through the points of a line, with handles across it.
/// @param line     #L >= 2 points by 3, world, neighbours distinct
/// @param frames   #L: column 1 is the handle s there, column 2 is t; blended between
/// @param lengths  #L - 1, > 0: of the pieces; #L if it is closed
/// @param closed   a last piece goes back to the first point: #L >= 3, C1 there too
CasteljauCurve curveThrough(Points line, std::span<const Mat3> frames, std::span<const double> lengths, bool closed = false);

/// The curves of a skeleton line at rest and posed, to carry space from one to the other (CasteljauMap's second constructor).
/// Rest frames are carried along the line without spin; posed ones are the rest ones rotated.
struct CasteljauPair {
  CasteljauCurve rest, posed;
};
/// @param rest, posed  #L >= 2 by 3, world: the same vertices
/// @param rotation     #L, rest to posed (skeleton::fitFrames gives them, roll included); empty: the least rotation between the
///                     tangents at the first point, carried along without spin
/// @param scale        #L, > 0: how space across the line grows; empty: 1
/// @param closed       as in curveThrough(); what the frames miss after one round is spread along the line
/// @throw std::invalid_argument if counts differ or neighbouring points coincide
CasteljauPair curvesAlong(Points rest, Points posed, std::span<const Quat> rotation = {}, std::span<const double> scale = {}, bool closed = false);

/// x' = x + F_posed(u, v, w) - F_rest(u, v, w), where x = F_rest(u, v, w). Statuses: Fixed where the displacement is exactly zero (always
/// where nothing was edited); Converged; Stalled for points that the rest curve's space does not reach (they stay, with
/// their distance from it as residual); Invalid.
class CasteljauMap final : public SpaceMap {
 public:
  /// Space parametrised by an affine frame: x = origin + u e_0 + v e_1 + w e_2. The cost of binding is a matrix a point.
  /// @param outside  what becomes of points with u outside [0, 1]: carried along the curve's end tangents (C1), or kept
  CasteljauMap(CasteljauCurve posed, const LatticeBox& frame, Outside outside = Outside::Extend);
  /// Space parametrised by another curve, of the same degrees and lengths: each point takes the place where the curve's cross
  /// plane contains it, of several the nearest.
  /// @param closed  the curves' ends are joined: nothing lies beyond them
  CasteljauMap(CasteljauCurve rest, CasteljauCurve posed, Outside outside = Outside::Extend, bool closed = false);

  const CasteljauCurve& posed() const noexcept;
  Vec3 position(const Vec3& rest) const;

  std::shared_ptr<const Binding> bind(Points rest) const override;
  /// Places along the same rest curve (or in the same frame) are taken over.
  std::shared_ptr<const Binding> bindAgain(const Binding* earlier, Points rest) const override;
  void apply(const Binding& binding, MapOutput out, Progress& progress) const override;
  void jacobians(const Binding& binding, std::span<Mat3> out) const override;

  /// Image x_segment^level of every bound point by the paper's recurrence, each in its own piece. Segment n is that of the piece's
  /// degree; points beyond the ends follow the tangents; those that are kept or stay come as they are.
  /// @param level    0 .. the least degree of the pieces     @param segment 0 .. degree - level
  void level(const Binding& binding, int level, int segment, std::span<Vec3> out) const;

 private:
  struct Model;
  class Bound;
  const Bound& own(const Binding& binding) const;
  static void displacements(const Model& model, const Bound& bound, std::size_t first, std::size_t count, Vec3* out);
  std::shared_ptr<const Model> model_;
};

}  // namespace fielddeform::map
