#pragma once

#include <fielddeform/volume/surface_volume.h>

namespace fielddeform::volume {

/// Volume, centre of mass and second moments of a solid of uniform density, exactly those of the mesh.
struct SolidMoments {
  double volume = 0;
  Vec3 centre = Vec3::Zero();  ///< of mass, world
  Mat3 spread = Mat3::Zero();  ///< integral of (x - centre)(x - centre)^T / volume: MomentTarget::spread
  /// Inertia tensor about the centre of mass for unit density: volume * (trace(spread) I - spread).
  Mat3 inertia() const { return volume * (spread.trace() * Mat3::Identity() - spread); }
};
/// @param x #V by 3. The region's volume must not be 0.
SolidMoments solidMoments(const SurfaceVolume& surface, Points x, std::size_t region = 0);

}  // namespace fielddeform::volume
