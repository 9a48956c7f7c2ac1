#pragma once

#include <fielddeform/field/field.h>
#include <fielddeform/skeleton/frames.h>

#include <memory>
#include <vector>

namespace fielddeform::gffd::detail {

/// The part of a skeleton pair that moves: the matched and replaced primitives, in the rest skeleton's order.
struct MovingPart {
  skeleton::Skeleton rest;
  std::vector<Index> restIndex;                 ///< into the rest skeleton
  std::vector<Index> posedIndex;                ///< into the posed skeleton
  std::vector<skeleton::PairKind> kind;         ///< Matched or Replaced
};
MovingPart movingPart(const skeleton::SkeletonPair& pair);

/// Samples of the moving part with where they went, and their frames. A replaced primitive has no correspondence; it is
/// given one: lines by share of their length, others by aligning the moments, then to the closest point.
/// @param posedField  of the posed skeleton
skeleton::SampledPair sampleMotion(const MovingPart& part, const skeleton::Skeleton& posed,
                                   const field::Field& posedField);

}  // namespace fielddeform::gffd::detail
