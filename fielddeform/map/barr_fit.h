#pragma once

#include <fielddeform/map/barr.h>
#include <fielddeform/map/skeleton_motion.h>

#include <memory>
#include <vector>

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

/// Several of Barr's deformations, one after the other along one axis, nearest to what a skeleton did.
struct BarrSequence {
  /// In Barr's order: scale or stretch, taper, twist, bend; those that are nothing are left out. One pivot, axis and about for all;
  /// each range counts along the axis as the ones before have left it.
  std::vector<BarrEdit> edits;
  Quat turn = Quat::Identity();        ///< then rigidly about the edits' pivot
  Vec3 shift = Vec3::Zero();
  double rms = 0, max = 0;             ///< miss of the skeleton's points, world
  std::size_t pairs = 0;               ///< skeleton points

  std::shared_ptr<const SpaceMap> map() const;
};

/// Recovers scale (or stretch), taper, twist and bend that a skeleton underwent in one pose, up to a rigid motion, by least squares
/// over all their parameters at once. First guesses come from how its frames turn along and across the longest principal axis, its
/// radii grow and its distances stretch. For single deformations fitBarr() is the exacter. Deterministic.
/// [Barr 1984: hierarchies of deformations]
BarrSequence fitBarrSequence(const SkeletonMotion& motion);

}  // namespace fielddeform::map
