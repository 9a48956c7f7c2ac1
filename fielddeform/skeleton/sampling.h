#pragma once

#include <fielddeform/skeleton/skeleton.h>

#include <array>
#include <vector>

namespace fielddeform::skeleton {

/// A point on a primitive, as weights on at most three of its points.
struct Sample {
  Index primitive = 0;
  std::array<Index, 3> vertex{kNoIndex, kNoIndex, kNoIndex};
  Vec3 weight = Vec3::Zero();
  double mass = 0;    ///< share of the primitive's length or area, world units; 1 for points
  double radius = 0;  ///< influence radius there, world units
};

/// A skeleton sampled densely enough for its radii; every point of every primitive is one of the samples.
struct SampleSet {
  std::vector<Sample> samples;
  /// Per primitive: the sample at each of its points.
  std::vector<std::vector<Index>> vertexSample;
  /// Per polyline: its samples in order along it (closed: the first is not repeated). Empty for other types.
  std::vector<std::vector<Index>> chain;
  /// Per polyline: where in the chain each segment starts; one more entry than segments.
  std::vector<std::vector<Index>> segmentStart;

  /// The samples' positions on a skeleton whose primitives have the same points (rest, or a matched pose).
  Vec3 position(const Skeleton& skeleton, std::size_t sample) const;
};

/// Samples at spacing <= spacing * radius, coarser where that would give more than `limit` samples besides the points.
/// Masses: half of each neighbouring piece's length, a third of each neighbouring (sub-)triangle's area.
/// @throw std::invalid_argument if a primitive has no radius
SampleSet sampleSkeleton(const Skeleton& skeleton, double spacing = 0.25, std::size_t limit = 4096);

/// The point's radius: its own, else the primitive's, world units.
double radiusOf(const Primitive& primitive, Index point);

}  // namespace fielddeform::skeleton
