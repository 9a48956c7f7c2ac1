#pragma once

#include <fielddeform/solid/object.h>

#include <Eigen/Core>

namespace fielddeform::solid {

/// What a change of an object costs: 1/2 sum_ij H_ij d_i . d_j of the control points' displacements d from where they are wanted.
/// A term is a weight times 1/2 the integral over each solid's cube of the displacement F's derivatives, exact by quadrature:
///   stretch (|F_u|^2 + |F_v|^2 + |F_w|^2) + twist (|F_uv|^2 + |F_uw|^2 + |F_vw|^2) + bend (|F_uu|^2 + |F_vv|^2 + |F_ww|^2)
/// [after Rappoport et al. 1996, section 6; of its formula two constants are legible, so this is a reconstruction], and
/// leastSquares |d_i|^2 summed over the points [section 3].
struct Objective {
  double leastSquares = 0;
  double stretch = 1;
  double twist = 0.1;
  double bend = 0.1;

  static Objective leastSquaresOnly() { return {1, 0, 0, 0}; }
  /// @throw std::invalid_argument unless all are finite, >= 0, and one is positive
  void validate() const;
  bool operator==(const Objective&) const = default;
};

/// The matrix of the energy's terms of one solid, a slot by a slot. A term whose derivative vanishes (bend of degree 1) is 0.
Eigen::MatrixXd energyMatrix(const std::array<int, 3>& degree, const Objective& objective);
/// H of the whole object, N by N.
Eigen::MatrixXd objectiveMatrix(const Object& object, const Objective& objective);

}  // namespace fielddeform::solid
