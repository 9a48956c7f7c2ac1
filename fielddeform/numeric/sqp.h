#pragma once

#include <fielddeform/numeric/constrained.h>

#include <optional>

namespace fielddeform::numeric {

struct SqpOptions {
  int maxIterations = 200;
  double gradient = 1e-9;      ///< |Z^T grad f|_inf at the end
  double constraint = 1e-12;   ///< |c|_inf at the end
  double radius = 0.5;         ///< of the first trust region
  double saddleStep = 0.02;    ///< length of the step that leaves a saddle
  int maxSaddles = 5;          ///< 0: the point is taken as it is
  bool lookForSaddles = true;  ///< false: negative curvature is not even looked for
  int maxInner = 200;          ///< conjugate-gradient steps of one iteration (sparse)
};
struct SqpReport {
  int iterations = 0, evaluations = 0, derivatives = 0, saddles = 0;
  int inner = 0;               ///< conjugate-gradient steps (sparse)
  double value = 0;            ///< f
  double gradient = 0, constraint = 0;
  Eigen::VectorXd multiplier;  ///< m: grad f + sum multiplier grad c = 0
  bool converged = false;      ///< else iterations ran out, or rounding let no step lower the merit any more
  bool saddle = false;         ///< negative curvature is left (the saddles ran out)
};
/// After each accepted step.
using SqpStep = std::function<void(const Eigen::VectorXd& x, double f, const Eigen::VectorXd& c)>;

/// Sequential quadratic programming with an orthogonal basis of the constraints' null space: normal step by QR, tangential
/// step by Cholesky of the reduced Hessian (its eigenvalues' absolute values where it is indefinite) within a trust radius,
/// l1 merit, one second-order correction, halving. At a stationary point with negative reduced curvature it steps along
/// that eigenvector and goes on. Dense: for up to a few hundred variables; O(n^3) an iteration.
SqpReport sqp(ConstrainedProblem& problem, Eigen::VectorXd& x, const SqpOptions& options, const SqpStep& onStep = {});

/// A unit vector within the constraints' null space along which f + multiplier . c curves down by more than `least` at x, if
/// there is one: the least eigenvalue's. Dense, no evaluation but one of the derivatives and the Hessian.
std::optional<Eigen::VectorXd> negativeCurvature(ConstrainedProblem& problem, const Eigen::VectorXd& x, const Eigen::VectorXd& multiplier, double least = 1e-7);

/// The same iteration for many variables: projected conjugate gradients (Steihaug's way with negative curvature) and least
/// squares in the metric of problem.precondition(). Saddles are looked for by some Lanczos steps
/// in that metric: of several directions of descent they find the strongest, and one weaker than 1e-4 may escape them.
/// [Gould, Hribar & Nocedal 2001]
SqpReport sparseSqp(ConstrainedProblem& problem, Eigen::VectorXd& x, const SqpOptions& options, const SqpStep& onStep = {});

}  // namespace fielddeform::numeric
