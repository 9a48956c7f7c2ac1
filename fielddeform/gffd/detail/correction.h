#pragma once

#include <fielddeform/core/status.h>
#include <fielddeform/field/field.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::gffd::detail {

/// One vertex on its way: where it was predicted, where it ended, and how well.
struct Tracked {
  Vec3 safe, position;
  Status status = Status::Converged;
  double residual = 0;
};

/// Newton steps along the gradient to a wanted value, one evaluation at a time, so that many vertices can share their
/// evaluations: while open(), the field is asked for its value at next() and told it by take().
/// docs/tracking.md, "Correction".
class Correction {
 public:
  struct Limits {
    double tolerance = 0;     ///< world
    double longestStep = 0;   ///< world
    int steps = 0;            ///< at most; 0: stays
  };
  Correction() = default;
  /// @param here  the field's value at the predicted position
  Correction(const Vec3& predicted, const field::FieldValue& here, double target, const Limits& limits)
      : limits_(limits), best_{predicted, predicted, Status::Stalled, 0}, target_(target) {
    residual_ = here.pseudoDistance - target;
    best_.residual = std::abs(residual_);
    if (!std::isfinite(best_.residual)) return;
    if (limits_.steps > 0) start(here);  // one step is always taken: stepping only beyond the tolerance would turn small differences into visible ones
    else finish();
  }

  bool open() const noexcept { return open_; }
  Vec3 next() const { return best_.position + step_; }
  const Tracked& result() const noexcept { return best_; }

  void take(const Vec3& position, const field::FieldValue& there) {
    const double r = there.pseudoDistance - target_;
    if (std::abs(r) < best_.residual) {
      best_.position = position;
      best_.residual = std::abs(r);
      residual_ = r;
      if (--limits_.steps > 0 && best_.residual > limits_.tolerance) start(there);
      else finish();
    } else if (halvings_-- > 0) {
      step_ *= 0.5;
    } else {
      finish();
    }
  }

 private:
  void start(const field::FieldValue& here) {
    constexpr double kGradientFloor = 0.05;
    constexpr int kHalvings = 8;
    const double slope = std::max(here.gradient.squaredNorm(), kGradientFloor * kGradientFloor);
    step_ = -residual_ / slope * here.gradient;
    const double length = step_.norm(), longest = limits_.longestStep;
    if (length > longest) step_ *= longest / length;
    halvings_ = kHalvings;
    open_ = true;
  }
  void finish() {
    open_ = false;
    if (best_.residual <= limits_.tolerance) best_.status = Status::Converged;
  }

  Limits limits_;
  Tracked best_;
  double target_ = 0, residual_ = 0;
  Vec3 step_ = Vec3::Zero();
  int halvings_ = 0;
  bool open_ = false;
};

}  // namespace fielddeform::gffd::detail
