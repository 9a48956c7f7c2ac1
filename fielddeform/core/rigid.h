#pragma once

#include <fielddeform/core/types.h>

#include <span>

namespace fielddeform {

/// A rigid motion x -> rotation * x + translation. The rotation is kept as a unit quaternion.
struct Rigid {
  Quat rotation = Quat::Identity();
  Vec3 translation = Vec3::Zero();

  Vec3 operator()(const Vec3& x) const { return rotation * x + translation; }
  /// First `b`, then this.
  Rigid operator*(const Rigid& b) const { return {rotation * b.rotation, rotation * b.translation + translation}; }
  Rigid inverse() const {
    const Quat r = rotation.conjugate();
    return {r, -(r * translation)};
  }
};

/// The shortest rotation that takes direction a to direction b (need not be unit length). Opposite directions turn by
/// half a circle about a fixed perpendicular; a zero vector gives the identity.
Quat minimalRotation(const Vec3& a, const Vec3& b);

/// A unit vector perpendicular to v (to x for v = 0), the same for any positive multiple of v.
Vec3 anyPerpendicular(const Vec3& v);

/// The motion to the power w along its screw: w = 0 identity, w = 1 the motion itself; between them a constant
/// turn about, and slide along, one axis. Takes the rotation by the shorter way (angle <= pi).
Rigid screwPower(const Rigid& motion, double w);

/// Dual-quaternion linear blend of rigid motions. [Kavan et al. 2007]
/// Quaternions are brought into the first one's hemisphere. Weights need not sum to one, but must not cancel.
Rigid blend(std::span<const Rigid> motions, std::span<const double> weights);
Rigid blend(const Rigid& a, const Rigid& b, double weightOfB);

}  // namespace fielddeform
