#pragma once

#include <fielddeform/field/field.h>
#include <fielddeform/gffd/evaluation.h>
#include <fielddeform/map/space_map.h>
#include <fielddeform/mesh/mesh.h>
#include <fielddeform/skeleton/skeleton.h>

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace fielddeform::gffd {

/// How a vertex is carried before (or instead of) the field correction. docs/tracking.md compares them.
enum class Predictor : std::uint8_t {
  Auto,      ///< resolved once: Axial where it folds and stretches the surface no more than Mls, else Mls
  Mls,       ///< moving least squares, rigid, with frames
  Axial,     ///< closest frame on the skeleton
  Warp,      ///< the paper's eqs (4)-(6): Fig. 5 along warp directions
  Gradient,  ///< the paper's eq (3): Fig. 5 along the field's gradient
};

enum class Falloff : std::uint8_t {
  Auto,  ///< on if some mesh edge joins a movable and a fixed vertex
  On,
  Off,
};

/// The field value that an inserted edge midpoint gets.
enum class MidpointValue : std::uint8_t {
  Sampled,  ///< the rest field at the midpoint
  Mean,     ///< the mean of the ends' values [Qin et al. 2003, Fig. 6]
};

struct Options {
  Predictor predictor = Predictor::Auto;
  Evaluation evaluation = Evaluation::Auto;
  bool corrector = true;           ///< bring every vertex back to its field value (Newton)
  bool guard = true;               ///< hold the correction back where it would fold the surface
  bool strictValue = false;        ///< keep every field value: no guard, no falloff, whatever it does to the surface
  double tolerance = 1e-4;         ///< residual at which a vertex has converged, in units of R, > 0
  int maxIterations = 30;          ///< corrector steps a vertex, >= 1; the paper's trackers take ten times as many
  Falloff falloff = Falloff::Auto;
  double falloffBand = 0.5;        ///< beta: share of the radius over which the displacement dies out, in (0, 1]
  int substeps = 1;                ///< poses tracked one after the other, 1..64
  bool retry = true;               ///< try 2, then 4 substeps when the surface folded, keep the better
  std::optional<double> radius{};  ///< for primitives without one, world units; absent: automatic (contracts: 2 x distance)
  double autoRadiusFactor = 2;     ///< automatic radius = factor x greatest distance from the mesh to the skeleton
  MidpointValue midpointValue = MidpointValue::Sampled;
  field::FieldOptions field{};
  /// Predictor Warp: points and where they go, world [Qin et al. 2003, eq. (4): "or specified directly by users"]; empty:
  /// the skeletons' own points. At most 100000.
  std::vector<std::pair<Vec3, Vec3>> warpPairs{};

  /// @throw std::invalid_argument naming the field, its value and its bound
  void validate() const;
};

std::string_view toString(Predictor predictor) noexcept;  ///< "auto", "mls", "axial", "warp", "gradient"
std::optional<Predictor> predictorFromString(std::string_view word) noexcept;

namespace detail {
struct Embedding;
}

/// Options with every choice made: stored with a scene, they repeat a run exactly, on any mesh.
struct ResolvedOptions {
  Options options;                  ///< predictor, evaluation and falloff never Auto
  skeleton::SkeletonPair skeletons{}; ///< every primitive has a radius
  bool radiusWasAutomatic = false;
  bool predictorWasAutomatic = false;
  double sampledStretch = 0;        ///< greatest edge stretch of the chosen predictor on the sample; 0: not sampled
  double referenceRadius = 0;       ///< R of the rest skeleton, world
  std::string predictorReason{};    ///< one sentence for the report: why this predictor
  std::shared_ptr<const std::vector<Vec3>> around{};     ///< the mesh's vertices, where distance grids follow them; else null
  std::shared_ptr<const detail::Embedding> embedding{};  ///< fields made on the way, reused by the map; may be null
};

/// Makes every choice that looks at the mesh: radius, predictor, falloff. Deterministic; examines at most 4096 points
/// of the mesh for the predictor.
/// @throw std::invalid_argument for invalid options or skeletons, or an empty rest skeleton
/// @param binding  if given, receives the mesh's binding where one had to be made, for any map of the result
ResolvedOptions resolve(const Options& options, const mesh::Mesh& mesh, const skeleton::SkeletonPair& skeletons,
                        std::shared_ptr<const map::Binding>* binding = nullptr);

}  // namespace fielddeform::gffd
