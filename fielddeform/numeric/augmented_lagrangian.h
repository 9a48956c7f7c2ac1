#pragma once

#include <fielddeform/numeric/constrained.h>
#include <fielddeform/numeric/minimize.h>

namespace fielddeform::numeric {

enum class InnerMinimizer : unsigned char { ConjugateGradients, Lbfgs };

struct AugmentedLagrangianOptions {
  InnerMinimizer inner = InnerMinimizer::ConjugateGradients;
  MinimizeOptions minimize{};     ///< of each inner minimisation; its maxSteps bounds the sum of all
  double tolerance = 1e-3;        ///< ends at |c|_inf below this
  double largestPenalty = 1e5;
  int maxOuter = 60;
};
/// What one problem hands to the next of a sequence.
struct AugmentedLagrangianState {
  Eigen::VectorXd x, multiplier;  ///< n; m (empty: zeros)
  double penalty = 1;
};
struct AugmentedLagrangianReport {
  int steps = 0, outer = 0, evaluations = 0;
  double value = 0;       ///< f
  double constraint = 0;  ///< |c|_inf
  double gradient = 0;    ///< |grad L_a|_inf
  bool converged = false;
};
/// After each inner step: x, f and c there.
using ConstrainedStep = std::function<void(const Eigen::VectorXd& x, double f, const Eigen::VectorXd& c)>;

/// L_a = f + multiplier . c + penalty / 2 |c|^2, minimised over x; while |c| has not halved since the last multiplier the penalty
/// doubles (up to its bound) and L_a is minimised again; then multiplier += penalty c. [Powell 1969; Hirota et al. 1999, Fig. 3]
AugmentedLagrangianReport augmentedLagrangian(ConstrainedProblem& problem, AugmentedLagrangianState& state,
                                              const AugmentedLagrangianOptions& options, const ConstrainedStep& onStep = {});

}  // namespace fielddeform::numeric
