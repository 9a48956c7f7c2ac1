#pragma once

#include <fielddeform/core/progress.h>
#include <fielddeform/volume/problem.h>

#include <functional>
#include <memory>
#include <string>

namespace fielddeform::volume {

enum class Solver : std::uint8_t {
  Exact,                ///< sequential quadratic programming over the exact derivatives: the default
  AugmentedLagrangian,  ///< the paper's method [Hirota et al. 1999]
  Projection,           ///< no energy: the start is moved along dV/dX of the free nodes until the volume is met
};
enum class Minimiser : std::uint8_t {
  ConjugateGradients,  ///< Polak-Ribiere, the paper's "typical gradient descent" [PTVF92]
  Lbfgs,
};
std::string_view toString(Solver solver) noexcept;
std::string_view toString(Minimiser minimiser) noexcept;

/// What a callback sees after each inner step.
struct Step {
  std::size_t level = 0;         ///< index into the levels, the finest last
  int step = 0;                  ///< of this level, from 1
  Points displacements;          ///< #N by 3, world; valid during the call
  double energy = 0;
  double deviation = 0;          ///< largest |V / V_target - 1| on this level's mesh
};

struct AugmentedLagrangianOptions {
  Minimiser minimiser = Minimiser::ConjugateGradients;
  double tolerance = 5e-4;       ///< |dV| / V at which a level ends [Hirota et al. 1999, Table 1: .0005 to .0008]
  double gradient = 1e-4;        ///< inner minimisation ends at |grad La|_inf, in units of the energy's curvature times the size: a
                                 ///< tenth of the move that ends the levels
  /// Levels end when no node moved by more than this share of the size between two, and the estimated error C / N of the
  /// volume is within the tolerance.
  double levelChange = 1e-3;
  double firstPenalty = 1;       ///< mu at the start, in units of the energy's curvature
  double largestPenalty = 1e5;   ///< mu's bound
  int maxSteps = 2000;           ///< inner steps of one level
  bool multiLevel = true;        ///< false: the finest mesh only
  /// Times that a saddle is left along its direction of descent (up to 600 free variables). 0: as the paper, whose method stops there.
  int maxSaddles = 5;
};

/// Where the exact solver takes its volumes.
enum class Grids : std::uint8_t {
  Auto,  ///< whichever of the two costs less
  Two,   ///< a coarse copy first; then values and gradients of the mesh with the copy's second derivatives
  Fine,  ///< the mesh's own form, or the mesh itself where it has too many nodes for one
};
struct ExactOptions {
  int maxIterations = 200;
  double gradient = 1e-9;        ///< |Z^T grad E|, in units of the energy's curvature times the size
  double deviation = 1e-12;      ///< |V / V_target - 1|
  int maxSaddles = 5;            ///< times that a saddle is left along its direction of descent
  Grids grids = Grids::Auto;
  int loadSteps = 1;             ///< pinned displacements, point targets and volumes are applied in so many parts
  int starts = 1;                ///< the given start and starts - 1 jittered ones: the least energy wins
  double jitter = 0.1;           ///< of the size
  std::uint64_t seed = 0;
};

struct Options {
  Solver solver = Solver::Exact;
  AugmentedLagrangianOptions augmentedLagrangian{};
  ExactOptions exact{};
  std::function<void(const Step&)> onStep{};  ///< may be empty

  /// @throw std::invalid_argument
  void validate() const;
};

enum class Outcome : std::uint8_t {
  Converged,
  Limited,  ///< iterations ran out or rounding stopped the solver short of its tolerance; the volumes hold all the same
  Unmet,    ///< a constraint is not met within its tolerance
};
std::string_view toString(Outcome outcome) noexcept;

struct RegionVolume {
  double base = 0;               ///< at d = 0, cubic units
  double start = 0;              ///< as given
  double target = 0;
  double after = 0;
  double deviation() const noexcept { return target == 0 ? after : after / target - 1; }
};
/// One row of the paper's Table 2.
struct LevelReport {
  std::size_t triangles = 0;
  int steps = 0, outer = 0;      ///< inner steps; multiplier updates
  int evaluations = 0;           ///< of V and dV/dX on this level's mesh
  double change = 0;             ///< dX: largest move of a node's coordinate on this level / size
  double energy = 0;
  double deviation = 0;          ///< on this level's mesh
  double multiplier = 0, penalty = 0;  ///< lambda, mu, in the energy's units per relative volume
  double seconds = 0;            ///< of wall time (never compared)
};
struct StartReport {
  double energy = 0;             ///< on the mesh of the first solve, which may be a coarse one
  int iterations = 0, saddles = 0;
  Outcome outcome = Outcome::Converged;
};
struct Report {
  Outcome outcome = Outcome::Converged;
  std::vector<RegionVolume> volumes;
  double energyBefore = 0, energy = 0;
  double optimality = 0;         ///< |Z^T grad E| at the end, as in ExactOptions::gradient
  double size = 0;               ///< world: the largest extent of the base
  int iterations = 0;            ///< SQP iterations or inner steps, all levels
  int meshEvaluations = 0;       ///< of V and dV/dX on the finest mesh, the last projection included
  int saddles = 0;               ///< left
  double projection = 0;         ///< longest node move of the last projection / size
  double pointResidual = 0;      ///< largest |reached - wanted| of the point targets, world
  double momentResidual = 0;     ///< of the moments, in units of the size (its square)
  std::vector<LevelReport> levels;
  /// C / N: the estimated relative volume error of the triangulation that the levels ended at, from the last two; else NaN.
  /// [Hirota et al. 1999, section 4.2]
  double errorEstimate = 0;
  std::vector<StartReport> starts;
  std::string message;           ///< one sentence where there is something to say, else empty
};
struct Result {
  std::vector<Vec3> displacements;  ///< #N by 3, world
  std::vector<Vec3> positions;      ///< #V by 3, world: base + B d
  Report report;
};

/// A problem with everything that depends on its meshes and map alone: edges checked, bases taken. Immutable; copies share.
class Prepared {
 public:
  /// @throw std::invalid_argument  @throw InfeasibleError if a mesh has no volume, or it is negative (faces turned inwards)
  explicit Prepared(Problem problem);
  const Problem& problem() const noexcept;
  struct Impl;
  const std::shared_ptr<const Impl>& impl() const noexcept { return impl_; }

 private:
  std::shared_ptr<const Impl> impl_;
};

/// Solves a problem. Bits do not depend on the number of threads.
/// @param start  #N by 3 instead of Problem::start, or empty
/// @throw std::invalid_argument  @throw Cancelled
/// @throw InfeasibleError if nothing can meet the constraints: no free node moves the surface, a target volume that is not
///        positive, an open mesh, contradicting point targets
Result preserve(const Prepared& prepared, const Options& options, Progress& progress, Points start = {});
Result preserve(const Problem& problem, const Options& options, Progress& progress);

/// The same problem solved again and again from where it stands, as while a node is dragged: keeps the exact form and
/// everything else that depends on mesh and map alone.
class Session {
 public:
  /// Builds the form (for up to 64 nodes); the first solve() may be had sooner by preserve().
  /// @param options  as for preserve(); the solver is the exact one
  Session(const Prepared& prepared, const Options& options);
  ~Session();
  Session(Session&&) noexcept;
  Session& operator=(Session&&) noexcept;

  /// @param displacements #N by 3, world: pinned nodes stand here; the free ones start where they were (or here, the first time)
  /// @param targets       as Constraints::volume, or empty: as before
  /// Volumes are exact to the form's rounding (about 1e-14); finish() gives the surface with the last projection.
  const std::vector<Vec3>& solve(Points displacements, std::span<const double> targets = {});
  const Report& report() const noexcept;
  Result finish(Progress& progress);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fielddeform::volume
