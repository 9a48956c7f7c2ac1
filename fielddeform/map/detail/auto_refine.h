#pragma once

#include <fielddeform/map/direct_manipulation.h>

#include <optional>

namespace fielddeform::map::detail {

/// A lattice and which of its nodes may not move; refined together: a new node is pinned if all that it follows from are.
struct Workpiece {
  Lattice lattice{};
  std::vector<char> pinned{};  ///< #N, or empty: none
};

/// A place at rest that the lattice fails, and by how much.
struct Failure {
  Vec3 rest = Vec3::Zero();  ///< world
  double miss = 0;           ///< > 0
};

/// One axis with a node more in each piece where something fails (the worst first), or with half as many again for Bernstein,
/// as far as `maxNodes` allow. Nothing if they do not, or if the pieces cannot be divided.
std::optional<Workpiece> refineWhereItFails(const Workpiece& piece, int axis, std::span<const Failure> failures, std::size_t maxNodes);
/// All three axes, as far as they can be.
std::optional<Workpiece> refineWhereItFails(const Workpiece& piece, std::span<const Failure> failures, std::size_t maxNodes);

struct Solved {
  Workpiece before{};                 ///< refined, not moved
  std::vector<Vec3> displacements{};  ///< of its nodes, solved for
  ManipulationReport report{};
  int refinements = 0;
  bool contradictory = false;  ///< some of what is missed asks for two places at once
};

/// moveTargets(), and while something is missed the refinement of the axis that gains most for its nodes, or of all three
/// if no single one gains, up to maxNodes (0: none).
Solved solveRefining(const Workpiece& piece, const Targets& targets, const ManipulationOptions& options, std::size_t maxNodes,
                     Progress& progress);

}  // namespace fielddeform::map::detail
