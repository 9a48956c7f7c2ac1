#pragma once

#include <fielddeform/core/progress.h>
#include <fielddeform/map/direct_manipulation.h>
#include <fielddeform/map/press_tool.h>

#include <array>
#include <optional>
#include <span>
#include <string>
#include <variant>

namespace fielddeform::map {

/// How a magnet's pull falls off, r the distance from its centre in radii.
enum class Profile : std::uint8_t {
  Smooth,  ///< (1 - r^2)^2
  Linear,  ///< 1 - r
  Flat,    ///< 1
};

/// Pulls all vertices within a ball, more at its centre than at its rim. [Hsu et al. 1992, section 4.3]
struct Magnet {
  Vec3 centre = Vec3::Zero();  ///< world, where the object is now
  double radius = 1;           ///< world, > 0
  Vec3 by = Vec3::Zero();      ///< world: the pull at the centre
  std::optional<Vec3> towards{};  ///< instead of `by`: every vertex by this share of the way to this point, `strength`
  double strength = 1;         ///< with towards, dimensionless; negative pushes away
  Profile profile = Profile::Smooth;
};

/// Moves a disc of vertices as one rigid piece. [Hsu et al. 1992, section 4.3]
struct SuctionCup {
  Vec3 centre = Vec3::Zero();   ///< world, where the object is now
  Vec3 axis = Vec3::UnitZ();    ///< of the disc, any length > 0
  double radius = 1;            ///< world, > 0
  std::optional<double> depth{};  ///< world, > 0: vertices this far from the disc's plane, on either side; default the radius
  Vec3 by = Vec3::Zero();       ///< world
  double turn = 0;              ///< radians about the axis, right-handed
};

/// Presses the object against a tool until nothing of it is inside: vertices that are go to the tool's surface, all others are
/// free. Then the corners of faces that are still cut between vertices outside (SculptOptions::triangles), if that comes to an end.
/// [Hsu et al. 1992, Figures 3 to 5 and "Play-Doh", section 4.2]
struct Press {
  PressTool tool;
};

using Move = std::variant<Targets, Magnet, SuctionCup, Press>;

struct SculptOptions {
  ManipulationOptions solve{};              ///< its node costs must fit the lattice, and forbid refinement
  std::vector<Index> pinnedNodes{};         ///< for every move, beside a move's own
  std::vector<Vec3> pinnedPoints{};         ///< world, at rest
  /// Nodes up to which the lattice may be refined where a move asks for more than it can give; 0: as it is.
  std::size_t maxNodes = 0;
  double toolTolerance = 0.02;              ///< > 0, of the pull: what a magnet or a cup may miss without refinement
  /// Triples of indices into the points: the flat faces that presses keep out of closed tools; empty: the points alone.
  std::span<const std::array<Index, 3>> triangles{};
  double pressTolerance = 1e-6;             ///< > 0, of the lattice's size: how deep a vertex may stay inside a tool
  double faceTolerance = 1e-4;              ///< > 0, of the lattice's size: the same of the inside of a face
  int pressRounds = 200;                    ///< >= 1
  std::size_t maxEntries = 8'000'000;       ///< of the equations of one solve (12 bytes each, thrice): more vertices are thinned out

  void validate() const;  ///< @throw std::invalid_argument
};

/// What became of one move.
struct MoveReport {
  std::string kind{};              ///< "targets", "magnet", "suction", "press"
  std::size_t vertices = 0;        ///< that the tool takes hold of; targets: their number
  ManipulationReport solve{};      ///< of the last solve; a press: with the counts of vertices inside and not any more
  int refinements = 0;             ///< times that the lattice was refined
  std::array<int, 3> nodes{};      ///< per axis, after the move
  int rounds = 0;                  ///< solves of a press
  double deepestBefore = 0;        ///< world: penetration before and after a press
  double deepestAfter = 0;
  std::size_t penetrating = 0;     ///< vertices deeper than the tolerance after a press
  std::size_t penetratingFaces = 0;  ///< the same of the triangles that were given
  std::string advice{};            ///< empty if all was reached; else one sentence
};

struct Sculpted {
  Lattice lattice{};
  std::vector<MoveReport> moves{};
  /// #V: the share of each vertex that nodes carry which the moves changed, in [0, 1] (affectedRegion()).
  std::vector<float> affected{};
};

/// Applies moves to a lattice one after the other, each to the object as the ones before left it.
/// @param lattice  with or without displacements
/// @param rest     #V by 3, world, undeformed: the object's vertices, and any more points of its surface that a press shall keep
///                 out of tools
/// @throw std::invalid_argument, InfeasibleError (moveTargets()); Cancelled
Sculpted sculpt(Lattice lattice, Points rest, std::span<const Move> moves, const SculptOptions& options, Progress& progress);

}  // namespace fielddeform::map
