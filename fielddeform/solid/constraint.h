#pragma once

#include <fielddeform/solid/object.h>

#include <Eigen/Core>

namespace fielddeform::solid {

/// One linear equation of the control points, the same for x, y and z: sum coefficient_i P_i = value. [Rappoport et al. 1996, section 5]
struct Row {
  std::string name;                                ///< for messages
  std::vector<std::pair<Index, double>> terms;
  Vec3 value = Vec3::Zero();                       ///< world
};

/// A point (a control point, or one of the solid) stands at a place.
Row fixedPoint(const Object& object, const PointRef& point, const Vec3& at);
/// Two points coincide.
Row attached(const Object& object, const PointRef& a, const PointRef& b);
/// b - a = by.
Row fixedDifference(const Object& object, const PointRef& a, const PointRef& b, const Vec3& by);
/// Every control point of a side stands where `points` has it. @param points #N by 3
std::vector<Row> fixedSide(const Object& object, const FaceRef& side, Points points);
/// C^1 .. C^k across a joint: sum_i (-1)^(r-i) binomial(r, i) of the r + 1 layers, scaled by n! / (n - r)!, on both sides.
/// [section 5.1; orders above 0, which is the sharing of points]
std::vector<Row> continuity(const Object& object, const Joint& joint);
/// Every inner control point is that of the Coons formula.
std::vector<Row> coonsInside(const Object& object);

/// Rows reduced to independent ones. Which rows are redundant depends on them alone; whether they contradict, on the values.
class RowSpace {
 public:
  /// @param tolerance  a row whose remainder is below this share of its length lies in the span of those before it
  RowSpace(const std::vector<Row>& rows, std::size_t points, double tolerance = 1e-10);

  Eigen::Index rank() const noexcept { return basis_.rows(); }
  const Eigen::MatrixXd& basis() const noexcept { return basis_; }      ///< rank by N, orthonormal rows Q
  const std::vector<std::size_t>& redundant() const noexcept { return redundant_; }  ///< rows that follow from earlier ones
  /// y with Q P = y for every P that satisfies the rows.
  /// @param values  a row a row, world    @param size  misses up to 1e-9 of it are rounding
  /// @throw InfeasibleError naming a row that contradicts others, and these
  Eigen::MatrixXd solve(const std::vector<Row>& rows, const Eigen::MatrixXd& values, double size) const;

 private:
  Eigen::MatrixXd basis_, lower_;        // rows = lower * basis
  std::vector<std::size_t> pivot_, redundant_;
};

/// The rows' values, a row a row.
Eigen::MatrixXd valuesOf(const std::vector<Row>& rows);
/// sum_i coefficient_i P_i - value, a row a row.
Eigen::MatrixXd residualsOf(const std::vector<Row>& rows, Points points);

}  // namespace fielddeform::solid
