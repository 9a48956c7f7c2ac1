#pragma once

#include <fielddeform/core/json_writer.h>
#include <fielddeform/map/sculpt.h>
#include <fielddeform/core/status.h>
#include <fielddeform/gffd/gffd_map.h>
#include <fielddeform/volume/local.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace fielddeform::scene {

struct MaxAndP99 {
  double max = 0;
  double p99 = 0;  ///< 99 of 100 values are not larger (nearest rank)
};

/// What a method with parameters of its own found in the skeleton's motion.
struct FitReport {
  std::string found;     ///< a few words: "bend by 90 degrees", "120 centres", "4 x 4 x 10 nodes"
  std::size_t pairs = 0; ///< skeleton points that it is measured on
  double rms = 0;        ///< miss of those points, world units
  double max = 0;
};

/// What the volume pass was and did.
struct VolumePassReport {
  volume::LocalOptions options;
  volume::LocalReport result;
  std::size_t foldsBefore = 0, foldsAfter = 0;   ///< against the rest, without and with the pass
  MaxAndP99 residualBefore, residualAfter;       ///< of the field, world units; zeros for methods without one
};

/// Volume enclosed by the faces (each polygon the fan from its corner 0), world units cubed.
struct VolumeReport {
  std::optional<double> before;
  std::optional<double> after;
  std::optional<double> asWritten;     ///< after rounding to the types of the written file; absent if nothing is written
  std::string reason;                  ///< why there is none, e.g. "the mesh is open"; empty if there is one
  std::optional<VolumePassReport> pass{};  ///< absent without a volume pass

  /// (after - before) / before; absent without both or if before is 0.
  std::optional<double> relativeChange() const;
};

/// The greatest value and the 99th percentile; zeros for no values. NaN values are left out.
MaxAndP99 maxAndP99(std::vector<float> values);

/// What depends on the machine and the moment. Comparisons of reports leave it out.
struct RunFacts {
  std::vector<std::pair<std::string, double>> seconds;     ///< per stage, in order
  int threads = 0;
  double peakMemoryMb = 0;                                 ///< of the whole process so far, 1e6 bytes
  std::vector<std::pair<std::string, std::string>> paths;  ///< role, path: "input", "output", "report", ...
};

/// What a run did. docs/report.md explains every entry.
struct Report {
  field::GridOptions gridOptions{};   ///< as asked for; means something where `distances` has grids
  std::string options;                ///< JSON object: the scene that was run, every choice resolved, without paths
  std::string method = "gffd";        ///< methodOf() the scene
  std::string predictor;              ///< the tracker's word; empty for methods that have none
  std::string predictorReason;        ///< why it was chosen
  std::string evaluation;             ///< "exact", "grid": how its predictions were made
  gffd::EvaluationCounts evaluated{}; ///< which way the movable vertices of the input went
  std::vector<gffd::NamedDistance> distances{};  ///< variational and grid distances; empty where they are exact
  std::optional<FitReport> fit{};     ///< absent for methods that fit nothing
  std::size_t vertices = 0;           ///< of the output
  std::size_t faces = 0;              ///< of the output
  StatusCounts status{};              ///< adds up to vertices
  MaxAndP99 residual;                 ///< world units
  double referenceRadius = 0;         ///< R, world units; 0 for methods without a field
  double tolerance = 0;               ///< world units
  std::size_t foldsBefore = 0;        ///< folded edges of the input by itself (cosine of its normals below -0.3)
  std::size_t foldsAfter = 0;         ///< edges that the deformation folded
  std::size_t flipped = 0;            ///< faces turned against the rotation that fits the surface around them best
  VolumeReport volume;
  std::size_t insertedVertices = 0;
  MaxAndP99 stretch;                  ///< edge length after / before
  std::vector<map::MoveReport> moves{};  ///< of sculpted lattices, in their order
  std::vector<std::string> warnings;  ///< sentences
  RunFacts run;
};

/// What became of variational or grid distances, as a member "distance" of the open object; nothing if there are none.
void writeDistances(JsonWriter& json, const std::vector<gffd::NamedDistance>& distances, const field::GridOptions& grid);

/// The report as JSON text.
std::string toJson(const Report& report);

}  // namespace fielddeform::scene
