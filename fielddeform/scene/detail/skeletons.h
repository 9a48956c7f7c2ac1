#pragma once

#include <fielddeform/scene/scene.h>

namespace fielddeform::scene::detail {

/// The skeletons of one run, before radii are resolved.
struct Skeletons {
  skeleton::Skeleton source;          ///< rest, as read or fitted (radii filled in if edits need them)
  skeleton::Skeleton rest;            ///< the same with lines divided, so that they can be bent
  std::vector<skeleton::Edit> edits;  ///< resolved
  skeleton::SkeletonPair pair;        ///< rest and posed, mirrored if the scene says so
  bool radiusWasAutomatic = false;    ///< here already, by the fit or for an edit that scales radii
};

/// Automatic radius over the greatest distance from the mesh to the skeleton, by the method.
double automaticRadiusFactor(const Scene& scene) noexcept;

/// Reads or fits the rest skeleton, reads or edits the posed one, pairs and mirrors them.
/// @throw IoError, std::invalid_argument
Skeletons prepareSkeletons(const Scene& scene, const mesh::Mesh& mesh);

/// The pair at time t: 0 is rest, 1 is posed, both bit for bit.
skeleton::Skeleton poseAt(const Skeletons& skeletons, const Scene& scene, const mesh::Mesh& mesh,
                          const skeleton::SkeletonPair& resolved, double t);

/// Puts the skeletons into a scene with all radii, so that it runs to the same bytes.
void storeSkeletons(const Skeletons& skeletons, const skeleton::SkeletonPair& resolved, Scene& scene);

}  // namespace fielddeform::scene::detail
