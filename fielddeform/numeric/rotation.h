#pragma once

#include <fielddeform/core/types.h>

namespace fielddeform::numeric {

/// The rotation R that maximises tr(R C), det +1: for C = sum p q^T (centred) the best q ~ R p. [Kabsch 1976; Horn 1987]
/// Where C leaves it undetermined (rank 1 or 0, or a reflection without preferred plane; relative to its greatest
/// singular value, 1e-14) the shortest rotation that takes the determined direction over; the identity for C = 0.
/// Multiplying C by a power of two changes no bit. Error about 1e-16 * s1 / (s2 +- s3) in radians, s its singular values.
/// Non-finite entries give the identity. Cost: about 0.3 microseconds; 1 near degeneracy.
Mat3 kabsch(const Mat3& c);

/// The same as a unit quaternion.
Quat kabschQuaternion(const Mat3& c);

/// kabsch(c) by Newton steps from a rotation nearby (within about 30 degrees; three steps reach full precision). The
/// result is the maximiser, whatever the start: where the steps do not arrive there, kabsch(c) is computed.
/// @param start  a unit quaternion
Quat polarRefine(const Mat3& c, const Quat& start);

}  // namespace fielddeform::numeric
