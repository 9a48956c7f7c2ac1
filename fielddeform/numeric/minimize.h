#pragma once

#include <Eigen/Core>

#include <functional>

namespace fielddeform::numeric {

/// Value and gradient (overwritten) of a smooth function.
using GradientFunction = std::function<double(const Eigen::VectorXd& x, Eigen::VectorXd& gradient)>;

struct MinimizeOptions {
  double gradient = 1e-6;  ///< ends at |gradient|_inf below this
  int maxSteps = 1000;
  double firstStep = 0.1;  ///< length of the first trial step
  int history = 8;         ///< of L-BFGS
};
struct MinimizeReport {
  int steps = 0, evaluations = 0;
  double value = 0, gradient = 0;  ///< at the end; |gradient|_inf
  bool converged = false;          ///< else the steps ran out or no lower point was found along the line
};
/// Called after each step; return false to end.
using StepFunction = std::function<bool(const Eigen::VectorXd& x, double value)>;

/// Polak-Ribiere conjugate gradients (restarted when not a direction of descent) with a strong Wolfe line search.
/// @param x  start, then the result     [Nocedal & Wright 2006, algorithms 3.5, 3.6, 5.4]
MinimizeReport conjugateGradients(const GradientFunction& f, Eigen::VectorXd& x, const MinimizeOptions& options,
                                  const StepFunction& onStep = {});
/// Limited-memory BFGS, the same line search. [Nocedal & Wright 2006, algorithm 7.5]
MinimizeReport lbfgs(const GradientFunction& f, Eigen::VectorXd& x, const MinimizeOptions& options, const StepFunction& onStep = {});

}  // namespace fielddeform::numeric
