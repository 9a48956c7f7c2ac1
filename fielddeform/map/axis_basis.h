#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

namespace fielddeform::map {

enum class BasisKind : std::uint8_t {
  Bernstein,  ///< one polynomial of degree nodes - 1 [Sederberg & Parry 1986]
  BSpline,    ///< piecewise polynomials of degree 1 to 3 with local support [Griessmair & Purgathofer 1989]
};

/// What stands at the two ends of a B-spline axis.
enum class Border : std::uint8_t {
  Coincident,  ///< border nodes count `degree` times (three for cubics), so that the image fills the nodes' hull [Hsu et al. 1992]
  Free,        ///< every node counts once: the outer nodes stand outside the box
  Knots,       ///< as the given knots say
};

std::string_view toString(BasisKind kind) noexcept;   ///< "bernstein", "bspline"
std::string_view toString(Border border) noexcept;    ///< "coincident", "free", "knots"

/// The functions along one axis of a lattice, over the box coordinate u in [0, 1] ("lattice uvw"). Linear precision:
/// sum_i phi_i(u) restNode(i) = u and sum_i phi_i(u) = 1 for every u in [0, 1].
/// For coincident borders the spline's own parameter s differs from u: closed form in the inner segments, exactly affine in
/// the outermost, root finding in the one beside it. [Hsu et al. 1992, section 3]
class AxisBasis {
 public:
  /// @param nodes >= 2, the degree is nodes - 1. Stable for any degree (de Casteljau's recurrence).
  static AxisBasis bernstein(int nodes);
  /// @param nodes  distinct nodes, >= 2; degree 1..3 (lowered to nodes - 1 where there are too few). Uniform spacing.
  /// @throw std::invalid_argument also for Border::Knots
  static AxisBasis bspline(int nodes, int degree, Border border);
  /// @param knots  nodes + degree + 1 non-decreasing numbers; the domain knots[degree] .. knots[nodes] becomes [0, 1]
  /// @throw std::invalid_argument if they decrease, are not finite, an inner knot has a multiplicity above degree, or an
  ///        end of the domain one above degree + 1
  static AxisBasis withKnots(int degree, std::vector<double> knots);
  /// Coincident borders with knots that need not be uniform, as knot insertion leaves them. The box coordinate of a point is
  /// that of the curve of the rest nodes; its parameter is found by Newton's method.
  /// @param degree  2 or 3
  /// @param knots  nodes + 3 degree - 1 numbers, strictly ascending
  /// @param rest   box coordinates of the nodes, strictly ascending from 0 to 1; more than degree of them
  /// @throw std::invalid_argument
  static AxisBasis coincident(int degree, std::vector<double> knots, std::vector<double> rest);

  BasisKind kind() const noexcept;
  Border border() const noexcept;
  bool uniform() const noexcept { return knots_.empty(); }  ///< no knots were given: nodes, degree and border say it all
  int degree() const noexcept;
  int nodes() const noexcept;
  /// Functions that do not vanish at one point at most: nodes() for Bernstein, degree + 1 for B-splines.
  int support() const noexcept;
  /// Empty for Bernstein. Of a coincident border: uniform, over the nodes with the outer ones repeated `degree` times.
  std::vector<double> knots() const;
  double restNode(int i) const;                       ///< box coordinate of node i

  struct Values {
    int first = 0;               ///< node of weight 0
    std::vector<double> weight;  ///< support(): phi_(first + k)(u)
    std::vector<double> slope;   ///< d phi / du
  };
  /// @param u in [0, 1] (clamped)
  Values evaluate(double u) const;
  /// The same without an allocation. @param weight, slope  support() numbers each; slope may be null
  /// @return the node of weight[0]
  int evaluate(double u, double* weight, double* slope) const;

  bool operator==(const AxisBasis& other) const;

  // For kernels. Axes of degree <= 3 consist of polynomial pieces (equal ones are kept once, so that memory does not grow
  // with a uniform axis). Functions of the left half (2k < degree) are polynomials of 1 - t, the others of t, so that none
  // suffers cancellation: weight_k = sum_m power[m][k] x^m, x = 1 - t or t.
  struct Piece {
    enum class Parameter : std::uint8_t { Straight, RootLeft, RootRight };
    double from = 0;                            // the u where it begins
    double origin = 0, scale = 1, shift = 0;    // t = (u - origin) scale - shift, less the segment's number in the piece
    Parameter parameter = Parameter::Straight;  // or t = the root of 1 + 3t + 3t^2 - t^3 = 6x, x counted from the left or right
    int first = 0;                              // node of weight 0 in its first segment
    int segments = 1;
    std::array<std::array<double, 4>, 4> power{};
  };
  const std::vector<Piece>& pieces() const noexcept { return pieces_; }  // none above degree 3, none of coincident()
  struct Place {
    int piece = 0, first = 0;
    double t = 0;
  };
  Place locate(double u) const;  // clamps; degree <= 3; of coincident() `first` only
  void evaluate(const Place& place, double* weight, double* slope) const;

 private:
  AxisBasis() = default;
  void makeUniformPiece(double firstAt);
  void makeCoincidentEnds();
  int evaluateCurve(double u, double* weight, double* slope) const;
  BasisKind kind_ = BasisKind::Bernstein;
  Border border_ = Border::Coincident;
  int degree_ = 1;
  int nodes_ = 2;
  std::vector<double> knots_, rest_;  // of given knots only
  std::vector<double> curve_;         // made by coincident(): the u of each knot of the domain; else empty
  std::vector<Piece> pieces_;
};

}  // namespace fielddeform::map
