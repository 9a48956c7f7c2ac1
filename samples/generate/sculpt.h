#pragma once

#include <fielddeform/core/types.h>

namespace fielddeform::samples {

/// Pieces to build implicit figures of: negative inside, about as steep as distances.

/// A tube from a to b whose radius goes from ra to rb, with round ends.
double limb(const Vec3& p, const Vec3& a, const Vec3& b, double ra, double rb);
/// An axis-aligned ellipsoid.
double ellipsoid(const Vec3& p, const Vec3& centre, const Vec3& radii);
/// Union whose seam is rounded over a width of about k.
double join(double a, double b, double k);
/// Smooth random values in about [-1, 1] with features of size 1.  [gradient noise, Perlin 1985]
double noise(const Vec3& p, std::uint64_t seed);
double smoothstep(double low, double high, double x);

}  // namespace fielddeform::samples
