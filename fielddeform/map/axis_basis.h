#pragma once

#include <cstdint>
#include <optional>
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

/// The functions along one axis of a lattice, over the box coordinate u in [0, 1] ("lattice uvw"). Linear precision:
/// sum_i phi_i(u) restNode(i) = u and sum_i phi_i(u) = 1 for every u in [0, 1].
/// For coincident borders the spline's own parameter s differs from u: closed form in the inner segments, exactly affine in
/// the outermost, root finding in the one beside it. [Hsu et al. 1992, section 3]
class AxisBasis {
 public:
  /// @param nodes >= 2, the degree is nodes - 1. Stable for any degree (de Casteljau's recurrence).
  static AxisBasis bernstein(int nodes);
  /// @param nodes  distinct nodes, >= 2; degree 1..3 (lowered to nodes - 1 where there are too few)
  static AxisBasis bspline(int nodes, int degree, Border border);
  /// @param knots  nodes + degree + 1 non-decreasing numbers; the domain knots[degree] .. knots[nodes] becomes [0, 1]
  /// @throw std::invalid_argument if they decrease, are not finite, or an inner knot has a multiplicity above degree
  static AxisBasis withKnots(int degree, std::vector<double> knots);

  BasisKind kind() const noexcept;
  Border border() const noexcept;
  int degree() const noexcept;
  int nodes() const noexcept;
  /// Functions that do not vanish at one point at most: nodes() for Bernstein, degree + 1 for B-splines.
  int support() const noexcept;
  const std::vector<double>& knots() const noexcept;  ///< empty for Bernstein
  double restNode(int i) const;                       ///< box coordinate of node i

  struct Values {
    int first = 0;               ///< node of weight 0
    std::vector<double> weight;  ///< support(): phi_(first + k)(u)
    std::vector<double> slope;   ///< d phi / du
  };
  /// @param u in [0, 1] (clamped)
  Values evaluate(double u) const;

 private:
  AxisBasis() = default;
  BasisKind kind_ = BasisKind::Bernstein;
  Border border_ = Border::Knots;
  int degree_ = 1;
  int nodes_ = 2;
  std::vector<double> knots_, rest_;
};

}  // namespace fielddeform::map
