#pragma once

#include <fielddeform/map/lattice.h>
#include <fielddeform/map/linear_map.h>

#include <array>
#include <vector>

namespace fielddeform::map {

/// Lattices of any shape, joined: tricubic Bezier volumes that share the nodes of their common faces.
/// [Coquillart, "Extended free-form deformation", 1990]
struct ExtendedLattice {
  std::vector<Vec3> nodes{};                        ///< #N by 3, world, at rest
  std::vector<std::array<Index, 64>> cells{};       ///< node (i, j, k) of a cell at i + 4 (j + 4 k)
  std::vector<Vec3> displacements{};                ///< #N by 3, world; empty: all zero

  /// @throw std::invalid_argument: no cells, an index out of range, sizes that differ, numbers that are not finite
  void validate() const;
};

/// The box cut into cells, evenly; joined with C1 rest geometry.
/// @param cells  1 to 64 along each edge
ExtendedLattice boxLattice(const LatticeBox& box, const std::array<int, 3>& cells);

struct CylinderLattice {
  Vec3 origin = Vec3::Zero();      ///< centre of the lower end, world
  Vec3 axis = Vec3::UnitZ();       ///< world: to the centre of the upper end
  double inner = 0.1, outer = 1;   ///< radii, world, 0 < inner < outer
  std::array<int, 3> cells{1, 8, 1};  ///< outwards, around (at least 3), along: 1 to 64
};
/// A tube around an axis, closed on itself: Coquillart's cylindrical lattice. Its arcs are cubics, off the circle by less than
/// 1e-4 of the radius at 8 cells around.
ExtendedLattice cylinderLattice(const CylinderLattice& tube);

/// Lattices put together: nodes that stand within `tolerance` of each other, a share of the whole's size, become one (the first
/// of them), so that cells whose faces meet node by node share them. Displacements of nodes that become one are averaged.
/// @param nodeOf  if given, receives where the nodes of each part are in the result
/// @throw std::invalid_argument if a part is not valid, or they span more than a double holds
ExtendedLattice weld(std::span<const ExtendedLattice> parts, double tolerance = 1e-9, std::vector<std::vector<Index>>* nodeOf = nullptr);

/// The first cell whose rest geometry is turned inside out or flat somewhere within: points there have no one place in it. Looked for
/// at 5 x 5 x 5 places of each cell; kNoIndex if there is none.
Index foldedCell(const ExtendedLattice& lattice);

/// The lattice carried over from the box of its nodes along x, y, z to another, displacements with it.
/// @throw std::invalid_argument
ExtendedLattice refit(ExtendedLattice lattice, const LatticeBox& box);

/// Three nodes in a row over a common face: the displacement is C1 across it where out - face = ratio (face - in), as the rest
/// nodes are.
struct Joint {
  Index in = 0, face = 0, out = 0;
  double ratio = 1;
};
/// All joints of cells that share the nodes of a face, where the rest nodes stand in one line (within 1e-9 of their distance).
std::vector<Joint> jointsOf(const ExtendedLattice& lattice);

/// The displacements changed least (in the sum of squares) so that all joints hold: the whole map is C1 there then.
/// @param pinned  nodes that keep theirs
/// @param residual  if given, receives the largest |out - face - ratio (face - in)| that pins leave, world
std::vector<Vec3> joinSmoothly(const ExtendedLattice& lattice, std::span<const Index> pinned = {}, double* residual = nullptr);

/// The map: a point's local coordinates in its cell are found by Newton steps at rest, then
/// x' = x + sum B_i(u) B_j(v) B_k(w) d_ijk. C0 across shared faces by the shared nodes, C1 where the joints hold.
/// Points outside all cells stay, bit for bit; to join with them smoothly, leave the two outer layers of nodes where they are.
class ExtendedLatticeMap final : public LinearMap {
 public:
  /// @throw std::invalid_argument
  explicit ExtendedLatticeMap(ExtendedLattice lattice);

  struct Place {
    Index cell = kNoIndex;      ///< kNoIndex: outside all
    Vec3 uvw = Vec3::Zero();    ///< in [0, 1]^3
  };
  /// Where a point lies: the first cell that contains it.
  Place locate(const Vec3& rest) const;
  /// How many of the bound points lie in no cell, those that are not finite not counted.
  std::size_t outsideCount(const Binding& binding) const;
  /// What the map was made from, with the displacements it has.
  ExtendedLattice lattice() const;

  std::size_t nodeCount() const override { return model_->nodes.size(); }
  Points restNodes() const override { return model_->nodes; }
  Points displacements() const override { return displacements_; }
  std::shared_ptr<const Binding> bind(Points rest) const override;
  void apply(const Binding& binding, MapOutput out, Progress& progress) const override;
  void jacobians(const Binding& binding, std::span<Mat3> out) const override;
  SparseRows basis(const Binding& binding) const override;
  void combine(const Binding& binding, Points nodeValues, std::span<Vec3> out) const override;
  void gather(const Binding& binding, Points pointValues, std::span<Vec3> out) const override;
  std::unique_ptr<LinearMap> withDisplacements(Points displacements) const override;

 private:
  struct Bound;
  const Bound& own(const Binding& binding) const;
  std::shared_ptr<const ExtendedLattice> model_;
  std::vector<Vec3> displacements_;
  std::shared_ptr<const std::vector<Box>> boxes_;  // of the cells' nodes
};

}  // namespace fielddeform::map
