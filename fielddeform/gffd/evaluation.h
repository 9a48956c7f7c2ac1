#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace fielddeform::gffd {

/// How the predictor is evaluated. docs/tracking.md, "Evaluation".
enum class Evaluation : std::uint8_t {
  Auto,   ///< resolved once: Grid where the mesh has enough vertices a cell that it is quicker, else Exact
  Exact,  ///< at every vertex: the reference
  Grid,   ///< at the nodes of a grid in rest space, interpolated to the tolerance and corrected exactly; Exact where that fails
};

std::string_view toString(Evaluation evaluation) noexcept;  ///< "auto", "exact", "grid"
std::optional<Evaluation> evaluationFromString(std::string_view word) noexcept;

/// Which way the movable points of one GffdMap::apply went. The first two add up to them.
struct EvaluationCounts {
  std::size_t grid = 0;       ///< predicted by interpolation
  std::size_t exact = 0;      ///< predicted by the predictor itself
  std::size_t singly = 0;     ///< of all: corrected one by one, where a block's correction did not settle them
};

}  // namespace fielddeform::gffd
