#pragma once

#include <fielddeform/volume/detail/local_lattice.h>

#include <Eigen/SparseCholesky>

namespace fielddeform::volume::detail {

/// The root t of c0 + c1 t + c2 t^2 + c3 t^3 nearest to 0, if there is a real one.
std::optional<double> rootNearest0(const std::array<double, 4>& c);

/// What is held where nothing holds the moved surface: its six rigid motions R, in the measure a of the parts' areas.
class Gauge {
 public:
  using Vec6 = Eigen::Matrix<double, 6, 1>;
  /// @param surface  surfaceMatrix(): the splines hold linear functions, B r = R, so that B^T a R is its product with r
  Gauge(const LocalParts& parts, const LocalLattice& lattice, const SparseMatrix& surface);
  /// R^T f
  Vec6 work(const LocalPart& part, Points force) const;
  /// B^T (f - a R (R^T a R)^-1 R^T f), given B^T f and R^T f.
  void projectForce(const Vec6& work, std::vector<Vec3>& gathered) const;
  /// Takes the rigid motion out of node displacements y, so that R^T a B y = 0.
  void projectMove(std::vector<Vec3>& y) const;

 private:
  Vec3 centre_ = Vec3::Zero();
  Eigen::Matrix<double, 6, 6> inverse_;
  std::array<std::vector<Vec3>, 6> weighted_;  ///< B^T a R_j
  std::array<std::vector<Vec3>, 6> nodes_;     ///< r_j with B r_j = R_j
};

/// Displacements of the parts along y_c = H^-1 B^T f_c, f_c = s dV_c/dx, each component's length chosen so that all volumes are
/// met to rounding.
class LocalSolve {
 public:
  /// @param matrix   H, symmetric positive definite
  /// @param surface  its part of the surface: surfaceMatrix()
  LocalSolve(const LocalEdit& edit, LocalParts& parts, const LocalLattice& lattice, const SparseMatrix& matrix,
             const SparseMatrix& surface, bool free);

  /// Node displacements that the surface starts from (otherwise zero).
  void startAt(Points displacements);
  /// Steps as in the page's loop. @return false if some step has no real solution
  bool iterate(int maxIterations, double tolerance, Progress& progress);
  /// Corrects what rounding left, by the volumes of the surface that is handed out. @return the largest deviation
  /// @param displacement  #V by 3, scaled: how far every vertex is moved, written where the parts' masks are above 0
  double polish(const ComponentVolumes& volumes, std::span<Vec3> displacement);

  int iterations() const noexcept { return iterations_; }

 private:
  using Nodes = std::vector<Vec3>;
  void aim();
  bool reach();
  bool reachOne();
  bool reachAll();
  Nodes total(const Eigen::VectorXd& lambda) const;
  void moveBy(const Nodes& y);
  Points startOf(std::size_t part) const { return start_[part].empty() ? Points(parts_.part[part].base) : Points(start_[part]); }
  Points positionsOf(std::size_t part) const { return x_[part].empty() ? startOf(part) : Points(x_[part]); }

  const LocalEdit& edit_;
  LocalParts& parts_;
  const LocalLattice& lattice_;
  Eigen::SimplicialLDLT<SparseMatrix, Eigen::Lower, Eigen::AMDOrdering<int>> factor_;
  std::optional<Gauge> gauge_;
  std::vector<Nodes> direction_;              ///< y_c
  Eigen::VectorXd lambda_;
  std::vector<std::vector<Vec3>> start_, x_;  ///< of every part, by 3; empty: its base, and where it starts
  std::vector<Vec3> work_;                    ///< of a part: forces, then displacements, then its next positions
  double change_ = 0;                         ///< the longest move of the last step
  int iterations_ = 0;
};

}  // namespace fielddeform::volume::detail
