#pragma once

#include <fielddeform/core/progress.h>
#include <fielddeform/solid/constraint.h>
#include <fielddeform/solid/objective.h>

#include <memory>
#include <optional>

namespace fielddeform::solid {

/// minimise the objective of (points - wanted) so that every row holds and every solid with a target has that size.
/// [Rappoport et al. 1996, section 3]
struct Problem {
  Object object;                                ///< at rest; its joints' continuity is kept
  std::vector<Vec3> wanted{};                   ///< #N by 3: what the result stays close to, as dragged; empty: the rest
  Objective objective{};
  std::vector<Row> rows{};
  std::vector<std::optional<double>> sizes{};   ///< a solid, cubic units: its target, or none: free. Empty: all keep those at rest
  enum class Inner : std::uint8_t {
    Free,                                       ///< inner control points follow the objective
    Coons,                                      ///< they are those of the Coons formula
  } inner = Inner::Free;

  /// @throw std::invalid_argument
  void validate() const;
};

enum class Method : std::uint8_t {
  Exact,  ///< sequential quadratic programming; rows hold to rounding, sizes to 1e-12
  Uzawa,  ///< the paper's
};
std::string_view toString(Method method) noexcept;  ///< "exact", "uzawa"

/// Uzawa's method [section 7]: for multipliers l, m of sizes and rows the points are found by successive approximation,
///   P <- wanted - H^-1 (sum l_i grad V_i(P) + C^T m),
/// then l_i += rho1 (V_i - v_i), m += rho2 (C P - d).
struct UzawaOptions {
  /// Steps, in units in which the dual problem's largest curvature (of A H^-1 A^T, A the gradients of sizes and rows) is 1: one size alone
  /// meets its linearised target at once with 1. Larger: faster, up to about 2, where it diverges. (The paper's values are lost, and
  /// depend on its units.)
  double rho1 = 1, rho2 = 1;
  int maxOuter = 500, maxInner = 2;
  double sizeTolerance = 1e-4;      ///< |V / v - 1| [the paper's final one; 1e-2 while dragging]
  double distanceTolerance = 1e-3;  ///< of C P - d and of the last inner step, share of the object's size
  bool eliminateRows = false;       ///< rows are kept exactly at every step instead of by multipliers: not the paper's, much faster

  static UzawaOptions whileDragging() { return {1.2, 1.2, 20, 1, 1e-2, 1e-2, false}; }
};

struct Options {
  Method method = Method::Exact;
  UzawaOptions uzawa{};
  int maxIterations = 100;          ///< Exact
  double optimality = 1e-9;         ///< Exact: |reduced gradient|, in units of the objective's curvature times the size

  /// @throw std::invalid_argument
  void validate() const;
};

enum class Outcome : std::uint8_t {
  Converged,
  Limited,  ///< iterations ran out; sizes and rows hold within 1e-9 all the same
  Unmet,    ///< they do not
};
std::string_view toString(Outcome outcome) noexcept;

struct SizeReport {
  std::string name;
  double rest = 0, wanted = 0, after = 0;  ///< of the object at rest, of `wanted`, of the result
  std::optional<double> target{};
};
/// After one outer iteration of Uzawa's method.
struct UzawaStep {
  double deviation = 0, residual = 0;
  int inner = 0;
};
struct Report {
  Outcome outcome = Outcome::Converged;
  int iterations = 0, inner = 0;      ///< SQP iterations; outer and all inner ones of Uzawa's method
  double objective = 0;               ///< value, world units squared
  double deviation = 0;               ///< largest |V / v - 1|
  double rowResidual = 0;             ///< largest |C P - d|, world
  double optimality = 0;              ///< Exact, as in Options
  std::size_t rows = 0, rank = 0;     ///< the constraints' and joints' rows; independent ones
  std::vector<std::string> redundant; ///< names of rows that follow from others
  std::vector<SizeReport> sizes;
  std::vector<UzawaStep> steps;
  std::string message;                ///< one sentence where there is something to say
};
struct Result {
  std::vector<Vec3> points;           ///< #N by 3
  Report report;
};

/// Solves a problem once. The same bits on any number of threads (it uses one).
/// @throw std::invalid_argument, Cancelled
/// @throw InfeasibleError if a target is not positive, rows contradict each other, or they leave a solid with a target nothing to move
Result solve(const Problem& problem, const Options& options, Progress& progress);

/// How much is done while something is dragged. [section 8]
enum class Effort : std::uint8_t {
  Edit,     ///< rows alone: sizes wait until the edit is done
  Drag,     ///< loose: sizes to 1e-6
  Release,  ///< tight
};

/// One problem solved again and again, as while a point or a target is dragged: everything that depends on the degrees, the rows and the
/// objective alone is kept. Starts where the last solve ended.
class Session {
 public:
  Session(const Problem& problem, const Options& options);
  ~Session();
  Session(Session&&) noexcept;
  Session& operator=(Session&&) noexcept;

  void setWanted(Points wanted);                                  ///< #N by 3
  /// New places for the rows' values, in the order of Problem::rows. @throw InfeasibleError if they contradict
  void setValues(std::span<const Vec3> values);
  void setSizes(std::span<const std::optional<double>> sizes);    ///< a solid; which have a target must not change
  const std::vector<Vec3>& solve(Effort effort = Effort::Release);
  const Report& report() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fielddeform::solid
