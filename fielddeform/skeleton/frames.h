#pragma once

#include <fielddeform/skeleton/sampling.h>

namespace fielddeform::skeleton {

/// A sampled skeleton pair: where each sample was and went, and how the space around it turned.
struct SampledPair {
  SampleSet set;
  std::vector<Vec3> rest;      ///< #S, world
  std::vector<Vec3> posed;     ///< #S, world
  std::vector<double> scale;   ///< #S, posed influence radius / rest one: how the space across the skeleton grows
  std::vector<Quat> rotation;  ///< #S, rest to posed; filled by fitFrames
  Quat global = Quat::Identity();  ///< the best rotation of all samples
};

/// Fits a rotation to every sample in two stages: along each primitive (a line: best rotation, then parallel transport
/// from where it fits best; a mesh: its one-rings; points: the whole), then over neighbouring primitives together.
/// Exact for a rigid motion of the whole skeleton; never pulled towards the identity. Roll and rotations of the
/// primitives are added. What the samples do not determine takes the smallest rotation. Posed samples inside a mesh's
/// triangles are moved onto the arc that its corners' motions describe.
/// @param restSkeleton, posedSkeleton  for faces, roll and rotation; primitive i of both belongs to samples of primitive i
void fitFrames(SampledPair& pair, const Skeleton& restSkeleton, const Skeleton& posedSkeleton);

}  // namespace fielddeform::skeleton
