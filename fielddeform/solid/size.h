#pragma once

#include <fielddeform/solid/object.h>
#include <fielddeform/volume/cubic_form.h>

#include <memory>

namespace fielddeform::solid {

/// Sizes of an object's solids as exact cubic forms of the control points, made once for their degrees: the integral of det(dF/du)
/// over the cube. [Rappoport et al. 1996, section 4]. By the divergence theorem the form is the sum of six, one a side,
///   V = sum +- 1/3 int int F . (F_s x F_t) ds dt,
/// so that c_ijk vanishes not only where an index is an inner point's, as the paper says, but unless all three lie on one side: a
/// tricubic solid needs 3360 numbers for 27 720. Immutable, safe from many threads.
class Sizes {
 public:
  explicit Sizes(const Object& object);

  std::size_t count() const noexcept { return solids_.size(); }
  /// Cubic units, positive where u, v, w are right-handed. @param points #N by 3
  double value(std::size_t solid, Points points) const;
  /// @param gradient #N by 3: the solid's is added, times weight    @return the value
  double addGradient(std::size_t solid, Points points, double weight, std::span<Vec3> gradient) const;
  /// out += weight Hessian direction. @param direction, out #N by 3
  void addHessianTimes(std::size_t solid, Points points, double weight, Points direction, std::span<Vec3> out) const;
  /// h += weight Hessian, 3N by 3N.
  void addHessian(std::size_t solid, Points points, double weight, Eigen::MatrixXd& h) const;

 private:
  struct Face {
    std::shared_ptr<const volume::CubicForm> form;
    std::vector<Index> points;
    double sign = 1;
  };
  std::vector<std::vector<Face>> solids_;
};

/// The form of a Bezier patch of two degrees: 1/3 int int F . (F_s x F_t) ds dt, exact by Gauss quadrature in one variable.
/// @param first, second  degrees; node (i, j) is i + (first + 1) j
volume::CubicForm patchForm(int first, int second);

}  // namespace fielddeform::solid
