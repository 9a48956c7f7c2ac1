#include <fielddeform/gffd/detail/paper.h>

#include <cmath>

namespace fielddeform::gffd::detail {
namespace {

constexpr int kHalvings = 60;

// Clipped: without value beyond the influence, where the paper's E is zero and its inverse is the radius.
double clippedDistance(const field::Field& posed, const Vec3& point) {
  const field::FieldValue v = posed.evaluate(point);
  return v.inside ? v.pseudoDistance : posed.referenceRadius();
}

}  // namespace

Vec3 gradientDirection(const field::Field& posed, const Vec3& point) {
  const field::FieldValue v = posed.evaluate(point);
  const double length = v.gradient.norm();
  if (!v.inside || !(length > 0)) return Vec3::Zero();
  return -v.gradient / length;
}

Tracked trackAsPrinted(const field::Field& posed, const std::function<Vec3(const Vec3&)>& direction, const Vec3& start,
                       double target, double tolerance, int maxIterations) {
  Tracked t{start, start, Status::Stalled, 0};
  double delta = clippedDistance(posed, start) - target;
  for (int i = 0; i < maxIterations && std::abs(delta) >= tolerance; ++i) {
    Vec3 step = delta * direction(t.position);
    if (step.squaredNorm() == 0 || !step.allFinite()) break;
    Vec3 next = t.position + step;
    double there = clippedDistance(posed, next) - target;
    for (int h = 0; h < kHalvings && delta * there < 0; ++h) {
      step *= 0.5;
      next = t.position + step;
      there = clippedDistance(posed, next) - target;
    }
    if (!(std::abs(delta) > std::abs(there))) break;  // "else dV = -dV": nothing changes, the paper never ends here
    t.position = next;
    delta = there;
  }
  t.residual = std::abs(delta);
  if (t.residual < tolerance) t.status = Status::Converged;
  return t;
}

}  // namespace fielddeform::gffd::detail
