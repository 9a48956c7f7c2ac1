#pragma once

#include <fielddeform/map/lattice.h>
#include <fielddeform/numeric/min_norm.h>

#include <string>

namespace fielddeform::map {

/// A point of the object and where the map is to carry it.
struct PointTarget {
  Vec3 rest = Vec3::Zero();   ///< world, before any deformation: a vertex, a place on the surface, or any point of space
  Vec3 image = Vec3::Zero();  ///< world
  double weight = 1;          ///< > 0: what misses cost against one another where not all targets can be met
};

/// A direction at a point and the vector that the map's derivative is to carry it to: J(rest) direction = image.
struct DirectionTarget {
  Vec3 rest = Vec3::Zero();        ///< world
  Vec3 direction = Vec3::UnitX();  ///< any length > 0
  Vec3 image = Vec3::UnitX();
  double weight = 1;              ///< > 0
};

/// What a map is asked for.
struct Targets {
  std::vector<PointTarget> points{};
  std::vector<DirectionTarget> directions{};
  std::vector<Index> pinnedNodes{};  ///< keep their displacement bit for bit
  std::vector<Vec3> pinnedPoints{};  ///< world, at rest: their images stay where they are now, before any target is served

  bool empty() const noexcept { return points.empty() && directions.empty(); }
};

struct ManipulationOptions {
  /// Largest miss of a target that counts as met, > 0: of the diagonal of the box of the rest nodes (points), of the longer
  /// of direction and image (directions).
  double tolerance = 1e-9;
  /// #N, > 0: what moving a node costs; the least sum cost_i |change_i|^2 is taken. Empty: 1 each, which is the paper's
  /// (BS)^+: there the copies of a coincident border node do not occur in the equations, so it counts once.
  /// borderMultiplicity() of a lattice counts them as often as they stand.
  std::vector<double> nodeCost{};
  numeric::MinNormOptions solver{};

  void validate() const;  ///< @throw std::invalid_argument
};

enum class TargetOutcome : std::uint8_t {
  Met,
  Unmet,    ///< carried as near as least squares allow
  Outside,  ///< no node moves this point: outside a lattice that leaves the outside alone
};

struct TargetState {
  TargetOutcome outcome = TargetOutcome::Met;
  Vec3 miss = Vec3::Zero();  ///< wanted image minus reached image, world (directions: in the image's own units)
};

/// met + unmet + outside = points + directions.
struct ManipulationReport {
  std::vector<TargetState> points{}, directions{};
  std::size_t met = 0, unmet = 0, outside = 0;
  double largestMiss = 0;      ///< over the points that are not outside, world
  double largestPinShift = 0;  ///< over the pinned points, world
  double change = 0;           ///< sqrt(sum cost |change|^2), world
  std::size_t movedNodes = 0;  ///< whose displacement changed
  numeric::MinNormReport solver{};
  /// Empty if everything is met; else one sentence on what is missed and what would help.
  std::string advice{};
};

struct Manipulated {
  std::vector<Vec3> displacements{};  ///< #N by 3, world: the map's own plus the change
  ManipulationReport report{};
};

/// Moves points to their targets by the least change of the nodes.  [Hsu, Hughes & Kaufman 1992]
/// With B the basis at the targets and dq what they still have to move, dP = B^+ dq: one target gives
///   dP = B^T dq / |B|^2   (eq. 4), several the pseudo-inverse. With B = C D of full rank, B^+ = D^T (D D^T)^-1 (C^T C)^-1 C^T;
/// the paper's eq. (3) prints the factors in another order. Coincident border nodes are one node here, so this basis is the
/// paper's B S without its empty columns. Under-, over-determined and rank-deficient sets give the least change among the
/// smallest sum of weight^2 |miss|^2. Only nodes that a target reaches enter: bounded by the targets, not by the lattice.
/// @param map  its present displacements are the start; any lattice or other linear map (directions: lattices only)
/// @throw std::invalid_argument for numbers that are not finite, a node out of range, weights or costs that are not
///        positive, a direction of length 0, or directions for a map that is no lattice
/// @throw InfeasibleError if there are targets that nodes move, but all of those nodes are pinned
Manipulated moveTargets(const LinearMap& map, const Targets& targets, const ManipulationOptions& options = {});

/// #N: how many control points of the spline stand at each node: degree at a coincident border of a B-spline axis, else 1,
/// multiplied over the axes. As nodeCost: the change is then least over the controls, copies counted.
std::vector<double> borderMultiplicity(const Lattice& lattice);

/// For each vertex, which share of it the changed nodes carry: the sum of the basis over the nodes where the two differ,
/// in [0, 1]; 0 where nothing changed.
/// @param before, after  #N by 3, node displacements
std::vector<float> affectedRegion(const LinearMap& map, const Binding& vertices, Points before, Points after);

}  // namespace fielddeform::map
