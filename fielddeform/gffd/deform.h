#pragma once

#include <fielddeform/core/progress.h>
#include <fielddeform/gffd/gffd_map.h>
#include <fielddeform/gffd/guard.h>

#include <vector>

namespace fielddeform::gffd {

/// A mesh's vertices after predict, correct and guard.
struct Deformed {
  std::vector<Vec3> position;      ///< #V by 3, world
  std::vector<Status> status;      ///< #V; counts add up to #V
  std::vector<float> residual;     ///< #V, world units
  GuardReport guard;
  EvaluationCounts evaluation;     ///< which way the movable vertices went
  std::size_t folds = 0;           ///< folded edges (mesh/quality.h) against the rest mesh
  GffdMap map;                     ///< the map that made it: with another predictor or substep count after a retry
  std::string retry;               ///< one sentence on what the retry did, empty if there was none
  std::vector<Vec3> safe;          ///< #V, predicted positions, if they were asked for; else empty
};

/// Tracks the vertices of a mesh: applies the map, guards the surface, and where it folded or tore tries MLS (if the
/// predictor had been chosen automatically) and more substeps, keeping the attempt with the fewest folds.
/// @param binding   of the mesh's positions, by `map` or a re-pose of it
/// @param keepSafe  whether Deformed::safe is wanted: with it, resample::refine() starts where this ended (resample::Start)
/// @throw Cancelled
Deformed deform(const mesh::Mesh& rest, const GffdMap& map, const map::Binding& binding, Progress& progress, bool keepSafe = false);

/// One attempt, with the map as it is: no retry.
Deformed deformOnce(const mesh::Mesh& rest, const GffdMap& map, const map::Binding& binding, Progress& progress, bool keepSafe = false);

/// Measures the residuals of the vertices that the guard held back, at their guarded positions.
void refreshResiduals(const GffdMap& map, const map::Binding& binding, Deformed& deformed);

}  // namespace fielddeform::gffd
