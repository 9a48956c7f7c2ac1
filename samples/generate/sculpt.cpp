#include "sculpt.h"

#include <fielddeform/core/random.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::samples {

double limb(const Vec3& p, const Vec3& a, const Vec3& b, double ra, double rb) {
  const Vec3 d = b - a;
  const double t = std::clamp((p - a).dot(d) / d.squaredNorm(), 0.0, 1.0);
  return (p - a - t * d).norm() - (ra + t * (rb - ra));
}

double ellipsoid(const Vec3& p, const Vec3& centre, const Vec3& radii) {
  const Vec3 q = (p - centre).cwiseQuotient(radii);
  const double k = q.norm();
  // First-order distance (value over slope); in the middle, where it is 0/0, the smallest radius.
  const double slope = q.cwiseQuotient(radii).norm();
  return k < 0.1 ? (k - 1) * radii.minCoeff() : std::min(k * (k - 1) / slope, 1.5 * (k - 1) * radii.maxCoeff());
}

double join(double a, double b, double k) {
  const double h = std::max(k - std::abs(a - b), 0.0) / k;
  return std::min(a, b) - h * h * k / 4;
}

double noise(const Vec3& p, std::uint64_t seed) {
  const Vec3 base = p.array().floor();
  const Vec3 f = p - base;
  const Vec3 s = f.array() * f.array() * f.array() * (f.array() * (f.array() * 6 - 15) + 10);
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3 offset(corner & 1, corner >> 1 & 1, corner >> 2 & 1);
    std::uint64_t hash = seed;
    for (int k = 0; k < 3; ++k)
      hash = splitmix64(hash, static_cast<std::uint64_t>(static_cast<std::int64_t>(base[k] + offset[k])));
    const Vec3 slope(static_cast<double>(hash & 0xFFFF) / 32768 - 1,
                     static_cast<double>(hash >> 16 & 0xFFFF) / 32768 - 1,
                     static_cast<double>(hash >> 32 & 0xFFFF) / 32768 - 1);
    double weight = 1;
    for (int k = 0; k < 3; ++k) weight *= offset[k] > 0 ? s[k] : 1 - s[k];
    sum += weight * slope.dot(f - offset);
  }
  return 1.4 * sum;
}

double smoothstep(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

}  // namespace fielddeform::samples
