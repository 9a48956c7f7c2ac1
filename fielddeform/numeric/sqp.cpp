#include <fielddeform/numeric/detail/sqp_steps.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::numeric::detail {
namespace {

double largest(const Vector& v) { return v.size() ? v.cwiseAbs().maxCoeff() : 0; }

/// The iterate and everything known there.
struct Iterate {
  Vector x, gradient, c, reduced, multiplier;
  Matrix jacobian;
  double f = 0;
};

class Sqp {
 public:
  Sqp(ConstrainedProblem& problem, SqpSteps& steps, const SqpOptions& options, const SqpStep& onStep)
      : problem_(problem), steps_(steps), options_(options), onStep_(onStep), radius_(options.radius) {}

  SqpReport run(Vector& x) {
    at_.x = x;
    differentiate();
    while (true) {
      report_.converged = largest(at_.reduced) <= options_.gradient && largest(at_.c) <= options_.constraint;
      if (report_.converged && !leaveSaddle()) break;
      if (report_.iterations >= options_.maxIterations || !std::isfinite(at_.f)) break;
      ++report_.iterations;
      if (!step()) break;
      if (onStep_) onStep_(at_.x, at_.f, at_.c);
    }
    x = at_.x;
    report_.value = at_.f, report_.multiplier = at_.multiplier;
    report_.gradient = largest(at_.reduced), report_.constraint = largest(at_.c);
    report_.converged = report_.gradient <= options_.gradient && report_.constraint <= options_.constraint;
    return report_;
  }

 private:
  void evaluate(Iterate& at) {
    at.f = problem_.derivatives(at.x, at.gradient, at.c, at.jacobian);
    ++report_.derivatives, ++report_.evaluations;
  }
  void differentiate() {
    evaluate(at_);
    steps_.project(at_.gradient, at_.jacobian, at_.multiplier, at_.reduced);
  }

  double merit(double f, const Vector& c) const { return f + weight_ * c.lpNorm<1>(); }

  /// One step of the quadratic model; false if nothing lowers the merit any more.
  bool step() {
    // Far from the constraint its multiplier says nothing yet.
    const bool early = report_.iterations == 1 && largest(at_.c) > 0.05;
    steps_.linearize(at_.x, early ? Vector(Vector::Zero(at_.multiplier.size())) : at_.multiplier);
    Vector normal = steps_.normal(at_.c);
    const double full = normal.norm(), share = full > 0.8 * radius_ ? 0.8 * radius_ / full : 1;
    normal *= share;
    const Vector tangent = steps_.tangential(at_.gradient, normal, radius_);
    const Vector p = normal + tangent;
    const double length = p.norm();
    if (!(length > 0) || !std::isfinite(length)) return false;
    raiseWeight(p, share);
    const double slope = at_.gradient.dot(p) - weight_ * share * at_.c.lpNorm<1>();
    // Last steps change the merit by less than its rounding: they are taken on trust.
    const double noise = 1e-13 * (std::abs(at_.f) + weight_ * at_.c.lpNorm<1>() + 1e-3);
    const double before = merit(at_.f, at_.c);
    // The whole step is mostly good: its derivatives are taken at once.
    Iterate whole;
    whole.x = at_.x + p;
    evaluate(whole);
    if (good(whole.f, whole.c, before, slope, noise)) {
      widen(length);
      at_ = std::move(whole);
      steps_.project(at_.gradient, at_.jacobian, at_.multiplier, at_.reduced);
      return true;
    }
    Vector c;
    if (std::isfinite(whole.f)) {
      const Vector trial = whole.x + steps_.normal(whole.c);
      const double f = problem_.values(trial, c);
      ++report_.evaluations;
      if (good(f, c, before, slope, noise)) {
        widen(length);
        return accept(trial);
      }
    }
    radius_ = std::min(radius_, 0.5 * length);
    for (double t = 0.5; t > 1e-9; t *= 0.5) {
      const Vector trial = at_.x + t * p;
      const double f = problem_.values(trial, c);
      ++report_.evaluations;
      if (good(f, c, before, t * slope, noise)) return accept(trial);
      radius_ = std::min(radius_, 0.5 * t * length);
    }
    return false;
  }

  bool good(double f, const Vector& c, double before, double slope, double noise) const {
    return std::isfinite(f) && merit(f, c) <= before + 1e-4 * std::min(slope, 0.0) + noise;
  }

  /// The merit's weight on the constraints: above the multipliers, and such that the step descends.
  void raiseWeight(const Vector& p, double share) {
    const double violation = share * at_.c.lpNorm<1>();
    double needed = 1.5 * largest(at_.multiplier);
    if (violation > 1e-9) {
      const double curved = std::max(0.0, 0.5 * p.dot(steps_.hessianTimes(p)));
      needed = std::max(needed, (at_.gradient.dot(p) + curved) / (0.7 * violation));
    }
    if (weight_ < needed) weight_ = 1.2 * needed;
  }

  bool accept(const Vector& x) {
    at_.x = x;
    differentiate();
    return true;
  }
  void widen(double length) { radius_ = std::clamp(2 * length, radius_, 8 * options_.radius); }

  bool leaveSaddle() {
    if (!options_.lookForSaddles) return false;
    steps_.linearize(at_.x, at_.multiplier);
    const auto direction = steps_.negativeCurvature();
    if (!direction) return false;
    if (report_.saddles >= options_.maxSaddles) {
      report_.saddle = true;
      return false;
    }
    ++report_.saddles;
    const Vector ahead = at_.x + options_.saddleStep * *direction, behind = at_.x - options_.saddleStep * *direction;
    Vector ca, cb;
    const double fa = problem_.values(ahead, ca), fb = problem_.values(behind, cb);
    report_.evaluations += 2;
    at_.x = merit(fa, ca) <= merit(fb, cb) + 1e-9 * std::abs(merit(fb, cb)) ? ahead : behind;
    differentiate();
    return true;
  }

  ConstrainedProblem& problem_;
  SqpSteps& steps_;
  const SqpOptions& options_;
  const SqpStep& onStep_;
  Iterate at_;
  SqpReport report_;
  double radius_, weight_ = 0;
};

}  // namespace

SqpReport runSqp(ConstrainedProblem& problem, SqpSteps& steps, Vector& x, const SqpOptions& options, const SqpStep& onStep) {
  return Sqp(problem, steps, options, onStep).run(x);
}

}  // namespace fielddeform::numeric::detail
