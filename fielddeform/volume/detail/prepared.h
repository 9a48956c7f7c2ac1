#pragma once

#include <fielddeform/volume/detail/reduced.h>
#include <fielddeform/volume/preserve.h>

namespace fielddeform::volume {

struct Prepared::Impl {
  Problem problem;
  std::vector<detail::MeshModel> levels;        ///< coarser ones, then the surface itself
  std::vector<std::vector<double>> baseVolume;  ///< a level, a region: at d = 0
  std::vector<Index> free, rowOf;
  double extent = 1, size = 1, energyUnit = 1;
  // Point targets over the free nodes: all rows, their orthonormal basis, and what makes its values from theirs.
  Eigen::MatrixXd pointRows, pointBasis, pointValue;
  std::vector<double> pinnedWeights;            ///< #Q by N: the rows over all nodes

  explicit Impl(Problem p);
  const detail::MeshModel& fine() const { return levels.back(); }

  /// @param start  N by 3    @param load  share of the way from d = 0 to the point targets
  /// @throw InfeasibleError if the point targets contradict each other
  detail::Core core(Points start, double load = 1) const;
  /// @param wanted  as Constraints::volume, or empty: the problem's    @param load as above
  std::vector<detail::VolumeTarget> targets(std::size_t level, std::span<const double> wanted = {}, double load = 1) const;
  double wantedVolume(std::size_t region, std::span<const double> wanted) const;
};

namespace detail {

/// How a solver left the free variables.
struct Solved {
  Eigen::VectorXd x;
  bool converged = false;
  double optimality = 0;
  int iterations = 0, saddles = 0;
  std::vector<StartReport> starts;
  std::vector<LevelReport> levels;
  std::string message;
};
/// @param fine  the constraints on the finest mesh; what they computed last is used again
Solved solveExact(const Prepared::Impl& impl, Points start, MeshConstraints& fine, const Options& options, Progress& progress);
Solved solveAugmentedLagrangian(const Prepared::Impl& impl, const Core& core, MeshConstraints& fine, const Options& options, Progress& progress);

/// |C / N|: how far a level's share of its volume at d is from that of infinitely many triangles, by the level before;
/// NaN for the first. [Hirota et al. 1999, section 4.2]
/// @param volumes  of the level's regions at d if they are known, else empty
double volumeError(const Prepared::Impl& impl, std::size_t level, Points d, std::span<const double> volumes = {});

/// Moves x onto the constraints of the finest mesh: along dV of the free nodes to the nearest root of the cubic where there is
/// one volume and nothing else, else by Newton steps of least length.
/// @return longest node move, units of the size
double projectOnto(const Core& core, MeshConstraints& fine, Eigen::VectorXd& x);

/// The cubic form serves up to so many nodes (three more may stand for the base).
inline constexpr std::size_t kFormNodes = 64;
/// More variables than these are solved by the sparse way.
inline constexpr Eigen::Index kDenseVariables = 600;

}  // namespace detail
}  // namespace fielddeform::volume
