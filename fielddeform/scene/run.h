#pragma once

#include <fielddeform/core/progress.h>
#include <fielddeform/scene/report.h>
#include <fielddeform/scene/scene.h>

namespace fielddeform::scene {

struct RunOptions {
  std::size_t input = 0;  ///< which of the scene's inputs
  std::optional<std::filesystem::path> saveScene;  ///< where to write the resolved scene
};

struct RunResult {
  Report report;
  bool radiusWasAutomatic = false;
  Scene resolved;                     ///< one input, every choice made: running it gives the same bytes
  std::vector<std::string> broken;    ///< the check's bounds that were exceeded, a sentence each; empty: passed
};

/// Runs one scene on one of its inputs: read, skeletons, resolve, bind, track, guard, resample, volume,
/// normals, report, write.
/// Files are written at the end, each complete or not at all; nothing is written if anything fails before.
/// Stages: "read", "skeleton", "bind", "preview", "track", "resample", "volume", "report", "write", "picture".
/// @throw IoError, std::invalid_argument, InfeasibleError, Cancelled
RunResult run(const Scene& scene, const RunOptions& options, Progress& progress);

}  // namespace fielddeform::scene
