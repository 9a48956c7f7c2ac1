#include <fielddeform/field/detail/distance_source.h>

#include <algorithm>

namespace fielddeform::field::detail {

Relative mix(const Relative& a, const Relative& b, double s, const Vec3& ds) {
  const double t = std::clamp(s, 0.0, 1.0), w = t * t * (3 - 2 * t), slope = s > 0 && s < 1 ? 6 * t * (1 - t) : 0;
  const double difference = b.value - a.value;
  return {a.value + w * difference, a.gradient + w * (b.gradient - a.gradient) + (slope * difference) * ds};
}

}  // namespace fielddeform::field::detail
