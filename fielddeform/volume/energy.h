#pragma once

#include <fielddeform/core/types.h>
#include <fielddeform/map/lattice.h>

#include <Eigen/SparseCore>

#include <array>
#include <string_view>
#include <vector>

namespace fielddeform::volume {

using SparseMatrix = Eigen::SparseMatrix<double>;

/// What a volume-preserving pass minimises: a smooth function of the node displacements d_i (world) of a linear map.
/// Immutable, safe to use from many threads.
class Energy {
 public:
  virtual ~Energy() = default;
  virtual std::size_t nodeCount() const = 0;  ///< #N
  /// @param displacements #N by 3, world
  virtual double value(Points displacements) const = 0;
  /// @param gradient #N by 3, overwritten    @return the value
  virtual double gradient(Points displacements, std::span<Vec3> gradient) const = 0;
  /// The whole symmetric matrix (both triangles), 3N by 3N; component c of node i is row 3 i + c.
  virtual SparseMatrix hessian(Points displacements) const = 0;
  /// h += weight * Hessian, restricted to some nodes. The default goes by hessian().
  /// @param rows  for node i its row of 3 in h (row 3 rows[i] + c), or kNoIndex to leave it out; #N
  virtual void addHessian(Points displacements, double weight, std::span<const Index> rows, Eigen::MatrixXd& h) const;
};

/// Which neighbours of a lattice node a spring leads to. "Each inner node has 14 neighbours" [Hirota et al. 1999,
/// section 3.4] without saying which.
enum class Springs : std::uint8_t {
  AxesAndDiagonals,  ///< 6 along the axes + 8 along the cells' diagonals. 14; leaves zero modes that are no motion of a
                     ///< rigid body (every cell splits into two tetrahedra), against the paper's own claim
  Kuhn,              ///< 6 axes + 6 face diagonals + 2 cell diagonals: the edges of Kuhn's subdivision. 14; rigid, but chiral
  All,               ///< 26: rigid and symmetric
};
std::string_view toString(Springs springs) noexcept;

/// E = sum_j 1/2 k_j (|X_s - X_e| - L_j)^2 over the springs of a lattice, X = rest + displacement.
/// [Hirota et al. 1999, section 3.4]
class SpringNetwork final : public Energy {
 public:
  struct Spring {
    Index start = 0, end = 0;  ///< nodes
    double length = 0;         ///< natural, world, >= 0
    double stiffness = 1;      ///< k, > 0
  };

  /// The springs of a node grid, natural lengths those of the rest nodes, k = 1.
  /// @param nodes  per axis, at least 1; node (i, j, k) has the index i + n0 (j + n1 k)
  /// @param rest   #N by 3, world
  /// @throw std::invalid_argument if the counts do not match, a number is not finite, or there are no two nodes
  SpringNetwork(const std::array<int, 3>& nodes, Points rest, Springs springs = Springs::All);
  explicit SpringNetwork(const map::Lattice& lattice, Springs springs = Springs::All)
      : SpringNetwork(lattice.nodes(), lattice.restNodes(), springs) {}
  /// @throw std::invalid_argument if a spring's node, length or stiffness is out of range
  SpringNetwork(std::vector<Vec3> rest, std::vector<Spring> springs);

  std::size_t nodeCount() const override { return rest_.size(); }
  double value(Points displacements) const override;
  double gradient(Points displacements, std::span<Vec3> gradient) const override;
  SparseMatrix hessian(Points displacements) const override;
  void addHessian(Points displacements, double weight, std::span<const Index> rows, Eigen::MatrixXd& h) const override;
  const std::vector<Spring>& springs() const noexcept { return springs_; }
  Points rest() const noexcept { return rest_; }

 private:
  template <class Add>
  void eachBlock(Points displacements, Add&& add) const;

  std::vector<Vec3> rest_;
  std::vector<Spring> springs_;
};

/// E = 1/2 sum_ij H_ij d_i . d_j: one scalar matrix for the three coordinates.
class QuadraticEnergy final : public Energy {
 public:
  /// @param matrix N by N, symmetric positive semidefinite (symmetry is checked to 1e-12 of its largest entry)
  /// @throw std::invalid_argument if it is not square, finite and symmetric
  explicit QuadraticEnergy(SparseMatrix matrix);

  std::size_t nodeCount() const override { return static_cast<std::size_t>(matrix_.rows()); }
  double value(Points displacements) const override;
  double gradient(Points displacements, std::span<Vec3> gradient) const override;
  SparseMatrix hessian(Points displacements) const override;
  const SparseMatrix& matrix() const noexcept { return matrix_; }

 private:
  SparseMatrix matrix_;
};

}  // namespace fielddeform::volume
