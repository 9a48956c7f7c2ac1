#include <fielddeform/core/error.h>
#include <fielddeform/field/potential.h>
#include <fielddeform/numeric/elementary.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::field {
namespace {

using skeleton::Potential;
constexpr double kDeepest = -600;  // e^600 = 4e260 leaves room for sums and products

// SoftObject in y = 1 - u^2: y^2 (5 + 4 y) / 9. Its inverse by Newton on y sqrt(5 + 4 y) = 3 sqrt(s), which is almost
// straight on [0, 1].
double softY(double s) {
  const double target = 3 * std::sqrt(s);
  double y = target / std::sqrt(5 + 4 * s);
  for (int i = 0; i < 4; ++i) {
    const double root = std::sqrt(5 + 4 * y);
    y -= (y * root - target) * root / (5 + 6 * y);
  }
  return std::min(y, 1.0);
}

}  // namespace

Kernel::Kernel(Potential potential, double sharpness) : potential_(potential), sharpness_(sharpness) {
  requireInRange("sharpness", sharpness, 1e-3, 500);
  end_ = numeric::exp(-sharpness);
  atZero_ = potential == Potential::Exponential || potential == Potential::Gaussian ? 1 - end_ : 1;
  meanSlope_ = atZero_ / sharpness;
}

double Kernel::value(double x) const noexcept {
  if (!(x < sharpness_)) return 0;
  if (potential_ == Potential::Exponential) return std::max(0.0, numeric::exp(-std::max(x, kDeepest)) - end_);
  if (x < 0) return atZero_ - meanSlope_ * x;
  const double u = x / sharpness_;
  switch (potential_) {
    case Potential::Gaussian: return std::max(0.0, numeric::exp(-u * x) - end_);
    case Potential::Metaball: return 3 * u <= 1 ? 1 - 3 * u * u : 1.5 * (1 - u) * (1 - u);
    default: {
      const double y = (1 - u) * (1 + u);
      return y * y * (5 + 4 * y) / 9;
    }
  }
}

double Kernel::derivative(double x) const noexcept {
  if (!(x <= sharpness_)) return 0;
  if (potential_ == Potential::Exponential) return -numeric::exp(-std::max(x, kDeepest));
  if (x < 0) return -meanSlope_;
  const double u = x / sharpness_;
  switch (potential_) {
    case Potential::Gaussian: return -2 * u * numeric::exp(-u * x);
    case Potential::Metaball: return (3 * u <= 1 ? -6 * u : -3 * (1 - u)) / sharpness_;
    default: {
      const double y = (1 - u) * (1 + u);
      return -2 * u * y * (10 + 12 * y) / 9 / sharpness_;
    }
  }
}

double Kernel::inverse(double s) const noexcept {
  if (!(s > 0)) return sharpness_;
  if (potential_ == Potential::Exponential) return -numeric::log(s + end_);
  if (s >= atZero_) return (atZero_ - s) / meanSlope_;
  switch (potential_) {
    case Potential::Gaussian: return std::sqrt(std::max(0.0, -sharpness_ * numeric::log(s + end_)));
    case Potential::Metaball: return sharpness_ * (3 * s >= 2 ? std::sqrt((1 - s) / 3) : 1 - std::sqrt(s / 1.5));
    default: return sharpness_ * std::sqrt(1 - softY(s));
  }
}

double Kernel::slopeAt(double s) const noexcept {
  if (potential_ == Potential::Exponential) return -(std::max(s, 0.0) + end_);
  if (s >= atZero_) return -meanSlope_;
  if (!(s > 0)) return derivative(sharpness_);
  switch (potential_) {
    case Potential::Gaussian: return -2 * inverse(s) / sharpness_ * (s + end_);
    case Potential::Metaball: return -(3 * s >= 2 ? std::sqrt(12 * (1 - s)) : std::sqrt(6 * s)) / sharpness_;
    default: {
      const double y = softY(s);
      return -2 * std::sqrt(1 - y) * y * (10 + 12 * y) / 9 / sharpness_;
    }
  }
}

}  // namespace fielddeform::field
