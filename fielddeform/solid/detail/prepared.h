#pragma once

#include <fielddeform/numeric/constrained.h>
#include <fielddeform/solid/size.h>
#include <fielddeform/solid/solve.h>

#include <Eigen/Cholesky>

namespace fielddeform::solid::detail {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

/// Points as a matrix, N by 3, and back.
Matrix matrixOf(Points points);
void pointsFrom(const Matrix& m, std::vector<Vec3>& points);

/// What depends on degrees, rows and objective alone.
struct Prepared {
  Problem problem;
  Sizes sizes;
  std::vector<Row> rows;            ///< the problem's, the joints', the Coons formula's
  RowSpace space;
  double size = 1;                  ///< length unit: the rest's largest extent, a power of two at or below it
  Matrix h;                         ///< N by N, its mean diagonal 1
  double unit = 1;                  ///< the objective's h times this
  Matrix null;                      ///< N by M: Z, orthonormal, the rows' null space
  Eigen::LLT<Matrix> reduced;       ///< of Z^T H Z
  /// N by M: K = Z L^-T. P = base + size K x satisfies the rows for every x, and the objective is constant + size^2 unit |x|^2 / 2.
  Matrix map;
  std::vector<std::size_t> held;    ///< solids with a target

  explicit Prepared(Problem p);
  /// The points closest to `wanted` that satisfy the rows with these values (the optimum without sizes).
  Matrix base(const Matrix& wanted, const Matrix& values) const;
  /// x of the points nearest to given ones.
  Vector variables(const Matrix& base, Points points) const;
  Eigen::Index freePoints() const { return map.cols(); }
};

/// Targets that can be asked for. @throw InfeasibleError, std::invalid_argument
std::vector<double> checkedTargets(const Prepared& prepared, const std::vector<std::optional<double>>& sizes);
/// @throw InfeasibleError if nothing that is free moves a held solid's size
void requireMovable(const Prepared& prepared, Points at);

/// minimise 1/2 |x|^2 so that V_k(base + size K x) = v_k.
class SizeProblem final : public numeric::ConstrainedProblem {
 public:
  SizeProblem(const Prepared& prepared, const Matrix& base, std::vector<double> targets);
  Eigen::Index variables() const override { return 3 * prepared_.freePoints(); }
  Eigen::Index constraints() const override { return static_cast<Eigen::Index>(targets_.size()); }
  double values(const Vector& x, Vector& c) override;
  double derivatives(const Vector& x, Vector& gradient, Vector& c, Matrix& jacobian) override;
  void hessian(const Vector& x, const Vector& multiplier, Matrix& h) override;
  void linearize(const Vector& x, const Vector& multiplier) override;
  void hessianTimes(const Vector& p, Vector& out) override;
  /// Points for variables.
  const std::vector<Vec3>& points(const Vector& x);

 private:
  Vector pulledBack(Points gradient) const;

  const Prepared& prepared_;
  Matrix base_;
  std::vector<double> targets_;
  std::vector<Vec3> points_, direction_, out_;
  Vector multiplier_;
};

Result uzawa(const Prepared& prepared, const Matrix& wanted, const Matrix& values, const std::vector<double>& targets,
             const UzawaOptions& options, Progress& progress);

/// Fills in what every method reports.
void describeResult(const Prepared& prepared, const Matrix& wanted, const Matrix& values, const std::vector<std::optional<double>>& sizes, Result& result);

}  // namespace fielddeform::solid::detail
