#pragma once

#include <fielddeform/gffd/detail/grid_kernel.h>

#include <array>
#include <cstdint>
#include <span>

namespace fielddeform::gffd::detail {

/// A sample as the kernel reads it.
struct MlsTerm {
  double rest[3], posed[3];
  double rotation[9];   ///< rows
  double mass, scale;
  double steepness;     ///< (8 log2(e) / r)^2, so that a weight is 2^-sqrt(steepness d^2)
};

/// Rigid motions of a block of points, each in coordinates whose origin is its point.
struct MlsBlock {
  alignas(64) double x[kLanes], y[kLanes], z[kLanes];  ///< displacement
  alignas(64) double turn[9][kLanes];                  ///< rotation, rows
  alignas(64) double settled[kLanes];                  ///< 1: as MlsPredictor::at; 0: ask that
};

struct MlsRun {
  std::uint32_t begin, end;
};

/// MlsPredictor::at for a block, lane by lane over the samples of the runs, which must hold every sample whose weight counts
/// at any of its points; others add exactly nothing. The rotation is found by four Newton steps from the mean frame; where
/// they do not arrive, a place is not settled. The best vector instructions, the same bytes in all.
void mlsMotions(std::span<const MlsTerm> terms, std::span<const MlsRun> runs, const Block& points, std::size_t count, MlsBlock& out);

}  // namespace fielddeform::gffd::detail
