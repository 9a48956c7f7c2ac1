#pragma once

#include <fielddeform/core/types.h>

#include <Eigen/Core>

#include <vector>

namespace fielddeform::volume {

namespace detail {
struct WedgePlan;
}

/// V(X) = sum_{i<j<k} C_ijk det[X_i X_j X_k]: the volume of anything that is linear in nodes X_i, as a totally antisymmetric
/// form. One evaluation costs O(N^3 / 2), however many triangles it was built from. Immutable.
///   dV/dX_i = 1/2 sum_jk C_ijk X_j x X_k,   d2V/dX_i dX_j = -[S_ij]_x with S_ij = sum_k C_ijk X_k
class CubicForm {
 public:
  /// @param nodes  N >= 3
  /// @param unique the N (N-1) (N-2) / 6 numbers C_ijk, i < j < k, k running fastest
  CubicForm(std::size_t nodes, const std::vector<double>& unique);

  /// The form of a triangle mesh whose vertices are x_v = sum_i basis(v, i) X_i:
  /// C_ijk = 1/6 sum_tri det of the 3 by 3 minor (rows: the triangle's corners, columns i, j, k). The mesh's own volume,
  /// exactly, for every X. Sums in chunks of vertices in a fixed order. Cost: about N^2 + N^3 / 10 multiplications a triangle.
  /// @param basis #V by N    @param triangles 3 row indices each
  static CubicForm ofMesh(const Eigen::Ref<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>& basis,
                          std::span<const Index> triangles);

  /// The same in an order of summation made before. @param rows  the basis, each row padded with zeros to a multiple of 4 numbers
  static CubicForm ofPlan(const detail::WedgePlan& plan, const double* rows, std::size_t nodes);

  std::size_t nodes() const noexcept { return nodes_; }
  double coefficient(std::size_t i, std::size_t j, std::size_t k) const;  ///< C_ijk in any order
  std::vector<double> unique() const;                                      ///< as the constructor takes them

  double value(Points x) const;
  /// @param gradient N by 3, overwritten    @return the value
  double gradient(Points x, std::span<Vec3> gradient) const;
  /// h += weight * Hessian, restricted to some nodes.
  /// @param rows  for node i its row of 3 in h (row 3 rows[i] + c), or kNoIndex to leave it out; N
  void addHessian(Points x, double weight, std::span<const Index> rows, Eigen::MatrixXd& h) const;

 private:
  void contract(Points x, std::vector<Vec3>& s) const;

  std::size_t nodes_ = 0, stride_ = 0;
  std::vector<double> rows_;  ///< a row per pair (i < j): C_ijk for all k, padded to a multiple of 4
};

}  // namespace fielddeform::volume
