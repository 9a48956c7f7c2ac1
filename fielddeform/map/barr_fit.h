#pragma once

#include <fielddeform/map/barr.h>
#include <fielddeform/map/skeleton_motion.h>

namespace fielddeform::map {

/// The Barr deformation nearest to what a skeleton did.
struct BarrFit {
  BarrEdit edit;                       ///< factors 1 or angle 0 if the motion is rigid
  Quat turn = Quat::Identity();        ///< then rigidly about the edit's pivot: see BarrMap
  Vec3 shift = Vec3::Zero();
  bool rigid = false;                  ///< nothing but the rigid motion
  double rms = 0, max = 0;             ///< miss of the skeleton's points, world
  std::size_t pairs = 0;               ///< skeleton points

  BarrMap map() const { return BarrMap(edit, turn, shift); }
};

struct BarrFitOptions {
  std::optional<BarrKind> kind{};      ///< this kind alone; absent: the one that fits best, the simpler of equals
};

/// Recovers kind and parameters (axis, range, angle or factors, axis of the turn) of a skeleton's motion, up to a rigid
/// motion, by least squares over its points; frames, rolls and radii decide where the points cannot (a twisted straight line
/// stays where it is). First guesses come from how the frames turn, the radii grow and the distances stretch along each
/// principal axis. A motion that is no Barr deformation gets the nearest one found; rms and max say how far off.
/// Deterministic.
BarrFit fitBarr(const SkeletonMotion& motion, const BarrFitOptions& options = {});

}  // namespace fielddeform::map
