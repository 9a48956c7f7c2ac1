#pragma once

#include <fielddeform/skeleton/frames.h>

#include <string_view>
#include <vector>

namespace fielddeform::map {

/// A skeleton pair as maps without a field see it: primitives that correspond point by point, sampled, with frames. What
/// GFFD's predictors follow, so that methods compare.
struct SkeletonMotion {
  skeleton::Skeleton rest, posed;   ///< the primitives, in the rest skeleton's order; every one has a radius
  skeleton::SampledPair samples;    ///< with frames and scales
  bool unedited = false;            ///< nothing that moves space differs: the map is the identity, bit for bit
};

/// @param method  named in errors
/// @throw std::invalid_argument if there are no primitives, one was replaced, added or removed, or one has no radius
SkeletonMotion motionOf(const skeleton::SkeletonPair& pair, std::string_view method);

/// Corresponding points: the skeleton's own, then frame points that tell how the space around lines and points turns
/// and grows.
struct PointPairs {
  std::vector<Vec3> rest, posed;    ///< #C by 3, world
  std::size_t own = 0;              ///< the first `own` pairs are skeleton points
};

struct PairOptions {
  double offset = 0.25;     ///< of the outer frame points, share of the radius there, > 0
  int rings = 1;            ///< of frame points, at even steps up to the offset, >= 1
  std::size_t most = 2000;  ///< of all pairs, > 0: only every second, third, ... skeleton point is taken rather than pass it
};

/// Frame points: four a ring around every point of a line, across it, six around every point of a set; none for meshes,
/// whose points say it by themselves.
PointPairs pointPairs(const SkeletonMotion& motion, const PairOptions& options = {});

}  // namespace fielddeform::map
