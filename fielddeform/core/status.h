#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace fielddeform {

/// Outcome of one output vertex. Every vertex has exactly one, so the counts add up to the vertices.
enum class Status : std::uint8_t {
  Fixed,      ///< outside every influence region, or not edited: kept bit for bit
  Converged,  ///< the field value is met within the tolerance
  Limited,    ///< held back by the fold guard; carries its residual
  Stalled,    ///< the corrector could not reduce the residual further; the best position is kept
  Invalid,    ///< the input coordinates were not finite; kept as they came
};
inline constexpr std::size_t kStatusCount = 5;

/// The word used in reports and on the command line: "fixed", "converged", ...
std::string_view toString(Status status) noexcept;

/// Number of vertices per status, indexed by the enum's value.
using StatusCounts = std::array<std::size_t, kStatusCount>;
StatusCounts countStatuses(std::span<const Status> statuses) noexcept;

}  // namespace fielddeform
