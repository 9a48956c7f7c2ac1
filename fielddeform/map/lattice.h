#pragma once

#include <fielddeform/map/axis_basis.h>
#include <fielddeform/map/linear_map.h>

#include <array>

namespace fielddeform::map {

namespace detail {
class LatticeModel;
}

/// An affine box: world x = origin + axes * (u, v, w), u, v, w in [0, 1] inside. Either handedness, any angles.
struct LatticeBox {
  Vec3 origin = Vec3::Zero();
  Mat3 axes = Mat3::Identity();  ///< columns are the three edges, world

  /// @throw std::invalid_argument if not finite or the edges are (nearly) coplanar
  void validate() const;
  bool operator==(const LatticeBox& other) const { return origin == other.origin && axes == other.axes; }
};

/// The smallest box along the axes x, y, z, or an oriented one along the principal axes, with `padding` (share of the
/// longest edge) on every side. Flat or thin sets get a thickness of 1e-3 of the longest edge (a single point, or none: a
/// unit box about it). Points that are not finite are left out. The oriented box's first edge runs along the greatest
/// variance of the points (the rules of sign and tie of skeleton::autoAxis); right-handed.
LatticeBox fitBox(Points points, double padding = 0);
LatticeBox fitOrientedBox(Points points, double padding = 0);

/// What becomes of points outside the box.
enum class Outside : std::uint8_t {
  Extend,  ///< each axis's functions go on along their tangents at the box's end: the map stays C1 everywhere (the tangent
           ///< of the whole map, F(c) + J(c)(u - c) at the clamped c, would be broken where two faces' outsides meet)
  Keep,    ///< left where they are: the map jumps at the box
};

std::string_view toString(Outside outside) noexcept;  ///< "extend", "keep"

/// A lattice as data: what its file holds.
struct Lattice {
  LatticeBox box;
  std::array<AxisBasis, 3> axis = {AxisBasis::bernstein(2), AxisBasis::bernstein(2), AxisBasis::bernstein(2)};
  /// #N by 3, world; node (i, j, k) has the index i + n0 (j + n1 k). Empty: all zero.
  std::vector<Vec3> displacements{};
  Outside outside = Outside::Extend;

  std::array<int, 3> nodes() const noexcept;   ///< per axis
  std::size_t nodeCount() const noexcept;      ///< #N
  /// @param i, j, k  0 <= i < nodes()[0] ...
  Index index(int i, int j, int k) const noexcept;
  std::vector<Vec3> restNodes() const;         ///< #N by 3, world
  /// @throw std::invalid_argument
  void validate() const;
};

/// The lattice carried over to another box, displacements included: they keep their box coordinates, so that one lattice
/// serves objects of other places, sizes and proportions. The same bits if the boxes have the same edges.
/// @throw std::invalid_argument if the lattice or the box is not valid
Lattice refit(Lattice lattice, const LatticeBox& box);

/// Free-form deformation by a lattice. [Sederberg & Parry 1986; Griessmair & Purgathofer 1989; Hsu et al. 1992]
/// Statuses: Fixed where the displacement is exactly zero (no node of the support was moved, or kept outside): the input
/// bit for bit; Invalid for points that are not finite or whose image is not; else Converged. Residuals 0.
class LatticeMap final : public LinearMap {
 public:
  /// @throw std::invalid_argument if the lattice is not valid
  explicit LatticeMap(Lattice lattice);

  Lattice lattice() const;  ///< with the displacements of this map
  Vec3 position(const Vec3& rest) const;
  Mat3 jacobian(const Vec3& rest) const;   ///< row = output coordinate

  /// The rest point that the map carries to `target`, by Newton steps from `start`, certified: `found` only if the result maps
  /// to the target within `tolerance` (world) and the Jacobian's determinant is positive there.
  struct Inverse {
    Vec3 rest = Vec3::Zero();
    double error = 0;      ///< world distance of its image from the target
    bool found = false;
  };
  Inverse inverse(const Vec3& target, const Vec3& start, double tolerance) const;

  std::shared_ptr<const Binding> bind(Points rest) const override;
  std::shared_ptr<const Binding> bindView(Points rest) const override;
  void apply(const Binding& binding, MapOutput out, Progress& progress) const override;
  void jacobians(const Binding& binding, std::span<Mat3> out) const override;
  std::size_t nodeCount() const override;
  Points restNodes() const override;
  Points displacements() const override;
  SparseRows basis(const Binding& binding) const override;
  SparseRows basisAt(const Binding& binding, std::span<const Index> points) const override;
  void combine(const Binding& binding, Points nodeValues, std::span<Vec3> out) const override;
  void gather(const Binding& binding, Points pointValues, std::span<Vec3> out) const override;
  std::unique_ptr<LinearMap> withDisplacements(Points displacements) const override;

 private:
  std::shared_ptr<const detail::LatticeModel> model_;
  std::shared_ptr<const std::vector<Vec3>> displacements_;
};

}  // namespace fielddeform::map
