#pragma once

#include <fielddeform/scene/run.h>

#include "command.h"

/// The options that every deforming command shares, and the driver that runs a scene on one or many meshes.
namespace fielddeform::cli {

/// What the command line says besides the scene itself.
struct BatchOptions {
  scene::Scene scene;                 ///< inputs and outputs are filled in by finish()
  std::vector<std::string> meshes;
  std::string output, report, picture, saveScene, mask, warpPairs;
  std::vector<std::string> attributes;
  bool resample = false, check = false, volume = false;
  resample::Options resampleOptions;
  scene::VolumePass volumeOptions;
  std::string volumeMask;             ///< a word, an attribute or a file
  scene::Check checkOptions;
  std::optional<double> allowResidual;
  /// Options that not every method by skeleton takes, and which of them do.
  std::vector<std::pair<const CLI::Option*, scene::MethodOption>> ofMethods;
  std::function<void(const scene::RunResult&)> done;  ///< called after each mesh; may be empty
};

/// What deforms: methods have options that others have not.
enum class Method : std::uint8_t { Skeleton, Lattice };

/// MESH..., -o, and all groups below that the method has.
void addBatchOptions(CLI::App& command, Session& session, BatchOptions& options, bool severalMeshes,
                     Method method = Method::Skeleton);

/// What the options say only together, after all are parsed: names of files whose extension is of no use, several
/// meshes where one is needed, and options that the method does not take. @throw CLI::ValidationError
void requireUsable(const BatchOptions& options);

/// How distances are found: --distance and what belongs to it.
void addDistance(CLI::App& command, field::DistanceOptions& options);

/// Fills the scene from the parsed options and runs it on every mesh. Several meshes: one bar, one that fails does not
/// stop the rest, a table at the end.
/// @return kDone; kFailed if any failed; else kCheckFailed if any check was broken
int runBatch(BatchOptions& options, Terminal& terminal);

/// Runs a scene (from a file) on all its inputs. @param done called after each; may be empty
int runScene(const scene::Scene& scene, const std::optional<std::filesystem::path>& saveScene, Terminal& terminal,
             const std::function<void(const scene::RunResult&)>& done = {});

}  // namespace fielddeform::cli
