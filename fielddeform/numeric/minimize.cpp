#include <fielddeform/numeric/minimize.h>

#include <algorithm>
#include <cmath>
#include <deque>

namespace fielddeform::numeric {
namespace {

using Vector = Eigen::VectorXd;

/// A point on the line and what is known there.
struct Trial {
  double t = 0, value = 0, slope = 0;
};

/// Minimum of the cubic through two values and slopes, kept within the middle of the interval.
double between(const Trial& a, const Trial& b) {
  const double d1 = a.slope + b.slope - 3 * (a.value - b.value) / (a.t - b.t);
  const double root = d1 * d1 - a.slope * b.slope;
  double t = 0.5 * (a.t + b.t);
  if (root >= 0) {
    const double d2 = std::copysign(std::sqrt(root), b.t - a.t);
    t = b.t - (b.t - a.t) * (b.slope + d2 - d1) / (b.slope - a.slope + 2 * d2);
  }
  const double low = std::min(a.t, b.t), high = std::max(a.t, b.t), margin = 0.05 * (high - low);
  return std::isfinite(t) ? std::clamp(t, low + margin, high - margin) : 0.5 * (low + high);
}

/// Strong Wolfe line search. x, gradient and value become those of the point found.
class LineSearch {
 public:
  LineSearch(const GradientFunction& f, double curvature) : f_(f), curvature_(curvature) {}

  /// @return step length, or 0 if no lower point was found
  double search(Vector& x, const Vector& direction, double first, double& value, Vector& gradient) {
    start_ = x;
    direction_ = &direction;
    const Trial zero{0, value, gradient.dot(direction)};
    zero_ = zero;
    noise_ = 1e-14 * std::abs(value);
    Trial previous = zero;
    double t = first;
    best_ = zero;
    for (int i = 0; i < 30; ++i) {
      const Trial now = probe(t);
      if (tooHigh(now) || (i > 0 && now.value >= previous.value)) return take(zoom(previous, now), x, value, gradient);
      if (std::abs(now.slope) <= -curvature_ * zero.slope) return take(now, x, value, gradient);
      if (now.slope >= 0) return take(zoom(now, previous), x, value, gradient);
      previous = now;
      t *= 3;
    }
    return take(previous, x, value, gradient);
  }
  int evaluations() const { return evaluations_; }

 private:
  Trial probe(double t) {
    point_ = start_ + t * *direction_;
    Trial trial{t, f_(point_, gradient_), 0};
    ++evaluations_;
    trial.slope = gradient_.dot(*direction_);
    if (!std::isfinite(trial.value) || !std::isfinite(trial.slope)) trial = {t, std::numeric_limits<double>::infinity(), 0};
    if (trial.value < best_.value || best_.t == 0) best_ = trial, bestGradient_ = gradient_;
    last_ = t;
    return trial;
  }
  bool tooHigh(const Trial& t) const { return !(t.value <= zero_.value + 1e-4 * t.t * zero_.slope + noise_); }

  Trial zoom(Trial low, Trial high) {
    for (int i = 0; i < 25; ++i) {
      if (std::abs(high.t - low.t) <= 1e-14 * std::abs(low.t)) break;
      const double t = std::isfinite(high.value) ? between(low, high) : 0.5 * (low.t + high.t);
      const Trial now = probe(t);
      if (tooHigh(now) || now.value >= low.value + noise_) {
        high = now;
      } else {
        if (std::abs(now.slope) <= -curvature_ * zero_.slope) return now;
        if (now.slope * (high.t - low.t) >= 0) high = low;
        low = now;
      }
    }
    return low;
  }

  double take(const Trial& t, Vector& x, double& value, Vector& gradient) {
    Trial use = t;
    if (use.t == 0 && best_.t != 0 && best_.value < zero_.value) use = best_;
    if (use.t == 0) return 0;
    if (use.t != last_) {
      if (use.t == best_.t) gradient_ = bestGradient_;
      else probe(use.t);
    }
    x = start_ + use.t * *direction_;
    value = use.value;
    gradient = gradient_;
    return use.t;
  }

  const GradientFunction& f_;
  double curvature_, noise_ = 0, last_ = 0;
  Vector start_, point_, gradient_, bestGradient_;
  const Vector* direction_ = nullptr;
  Trial zero_, best_;
  int evaluations_ = 0;
};

double largest(const Vector& g) { return g.size() ? g.cwiseAbs().maxCoeff() : 0; }

}  // namespace

MinimizeReport conjugateGradients(const GradientFunction& f, Vector& x, const MinimizeOptions& options, const StepFunction& onStep) {
  MinimizeReport report;
  Vector gradient(x.size());
  report.value = f(x, gradient);
  LineSearch line(f, 0.1);
  Vector direction = -gradient, before = gradient;
  double step = 0, slopeBefore = 0;
  while (!(report.converged = largest(gradient) <= options.gradient) && report.steps < options.maxSteps) {
    double slope = gradient.dot(direction);
    if (!(slope < 0)) direction = -gradient, slope = -gradient.squaredNorm(), step = 0;
    // As long as the last step was for its slope; the first as long as the caller says.
    const double trial = step > 0 ? std::min(step * slopeBefore / slope, 10 * step) : options.firstStep / direction.norm();
    before = gradient;
    step = line.search(x, direction, trial, report.value, gradient);
    slopeBefore = slope;
    if (step == 0) {
      if (direction == -before) break;
      direction = -gradient;
      continue;
    }
    ++report.steps;
    if (onStep && !onStep(x, report.value)) break;
    const double beta = std::max(0.0, gradient.dot(gradient - before) / before.squaredNorm());
    direction = beta * direction - gradient;
  }
  report.gradient = largest(gradient);
  report.evaluations = line.evaluations() + 1;
  return report;
}

MinimizeReport lbfgs(const GradientFunction& f, Vector& x, const MinimizeOptions& options, const StepFunction& onStep) {
  MinimizeReport report;
  Vector gradient(x.size());
  report.value = f(x, gradient);
  LineSearch line(f, 0.9);
  struct Pair {
    Vector s, y;
    double rho;
  };
  std::deque<Pair> pairs;
  Vector direction, beforeX, beforeGradient;
  std::vector<double> alpha;
  while (!(report.converged = largest(gradient) <= options.gradient) && report.steps < options.maxSteps) {
    direction = -gradient;
    alpha.resize(pairs.size());
    for (std::size_t i = pairs.size(); i-- > 0;) {
      alpha[i] = pairs[i].rho * pairs[i].s.dot(direction);
      direction -= alpha[i] * pairs[i].y;
    }
    if (!pairs.empty()) direction *= 1 / (pairs.back().rho * pairs.back().y.squaredNorm());
    for (std::size_t i = 0; i < pairs.size(); ++i)
      direction += (alpha[i] - pairs[i].rho * pairs[i].y.dot(direction)) * pairs[i].s;
    if (!(gradient.dot(direction) < 0)) pairs.clear(), direction = -gradient;
    beforeX = x, beforeGradient = gradient;
    const double trial = pairs.empty() ? options.firstStep / direction.norm() : 1;
    if (line.search(x, direction, trial, report.value, gradient) == 0) {
      if (pairs.empty()) break;
      pairs.clear();
      continue;
    }
    ++report.steps;
    if (onStep && !onStep(x, report.value)) break;
    Pair pair{x - beforeX, gradient - beforeGradient, 0};
    const double sy = pair.s.dot(pair.y);
    if (sy > 1e-12 * pair.s.norm() * pair.y.norm()) {
      pair.rho = 1 / sy;
      pairs.push_back(std::move(pair));
      if (pairs.size() > static_cast<std::size_t>(options.history)) pairs.pop_front();
    }
  }
  report.gradient = largest(gradient);
  report.evaluations = line.evaluations() + 1;
  return report;
}

}  // namespace fielddeform::numeric
