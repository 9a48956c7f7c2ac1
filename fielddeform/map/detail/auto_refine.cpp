#include <fielddeform/map/detail/auto_refine.h>
#include <fielddeform/map/refine_lattice.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

namespace fielddeform::map::detail {
namespace {

constexpr double kSmallestPiece = 1e-6;  // of the box: no piece is divided below
constexpr double kTame = 0.02;           // share of the largest row that a row must add to count as free of the others
constexpr double kGain = 0.05;           // share of the squared misses that a refinement of one axis must take away

Workpiece apply(const Workpiece& piece, int axis, const AxisRefinement& refinement) {
  Workpiece out;
  out.lattice = refined(piece.lattice, axis, refinement);
  if (piece.pinned.empty()) return out;
  // Carried over like displacements: what is free anywhere among its parents is free.
  Lattice flags = piece.lattice;
  flags.displacements.assign(piece.pinned.size(), Vec3::Zero());
  for (std::size_t i = 0; i < piece.pinned.size(); ++i) flags.displacements[i].x() = piece.pinned[i] ? 0 : 1;
  for (const Vec3& f : refined(flags, axis, refinement).displacements) out.pinned.push_back(f.x() == 0);
  return out;
}

// The pieces of an axis by what is missed in them, worst first, those too small to divide left out.
std::vector<int> failingPieces(const Lattice& lattice, int axis, std::span<const Failure> failures) {
  const auto a = static_cast<std::size_t>(axis);
  const std::vector<double> at = breaks(lattice.axis[a]);
  std::vector<double> missed(at.size() - 1, 0.0);
  const Mat3 toBox = lattice.box.axes.inverse();
  for (const Failure& f : failures) {
    const double u = (toBox * (f.rest - lattice.box.origin))[axis];
    const auto place = std::upper_bound(at.begin() + 1, at.end() - 1, u) - at.begin() - 1;
    missed[static_cast<std::size_t>(place)] += f.miss;
  }
  std::vector<int> pieces;
  for (std::size_t i = 0; i < missed.size(); ++i)
    if (missed[i] > 0 && at[i + 1] - at[i] > kSmallestPiece) pieces.push_back(static_cast<int>(i));
  std::stable_sort(pieces.begin(), pieces.end(),
                   [&](int x, int y) { return missed[static_cast<std::size_t>(x)] > missed[static_cast<std::size_t>(y)]; });
  return pieces;
}

std::vector<Failure> failuresOf(const Targets& targets, const ManipulationReport& report) {
  std::vector<Failure> list;
  for (std::size_t i = 0; i < report.points.size(); ++i)
    if (report.points[i].outcome == TargetOutcome::Unmet) list.push_back({targets.points[i].rest, report.points[i].miss.stableNorm()});
  for (std::size_t i = 0; i < report.directions.size(); ++i)
    if (report.directions[i].outcome == TargetOutcome::Unmet)
      list.push_back({targets.directions[i].rest, report.directions[i].miss.stableNorm()});
  return list;
}

double squaredMiss(const ManipulationReport& report) {
  double sum = 0;
  for (const auto* states : {&report.points, &report.directions})
    for (const TargetState& s : *states)
      if (s.outcome == TargetOutcome::Unmet) sum += s.miss.squaredNorm();
  return sum;
}

// Whether something that is missed shares its place at rest with a target (or a pin) that asks for another image.
bool contradicts(const Targets& targets, const ManipulationReport& report) {
  std::map<std::tuple<double, double, double>, Vec3> seen;
  const auto key = [](const Vec3& p) { return std::tuple(p.x(), p.y(), p.z()); };
  for (const PointTarget& t : targets.points) {
    const auto [it, fresh] = seen.emplace(key(t.rest), t.image);
    if (!fresh && it->second != t.image) return true;
  }
  for (const Vec3& p : targets.pinnedPoints) {
    const auto it = seen.find(key(p));
    if (it == seen.end()) continue;
    for (std::size_t i = 0; i < targets.points.size(); ++i)
      if (targets.points[i].rest == p && report.points[i].outcome == TargetOutcome::Unmet) return true;
  }
  return false;
}

struct Attempt {
  Workpiece piece;
  Manipulated result;
  double miss = 0;
};

Attempt attempt(Workpiece piece, Targets targets, const ManipulationOptions& options) {
  for (std::size_t i = 0; i < piece.pinned.size(); ++i)
    if (piece.pinned[i]) targets.pinnedNodes.push_back(static_cast<Index>(i));
  Attempt a;
  a.result = moveTargets(LatticeMap(piece.lattice), targets, options);
  a.miss = squaredMiss(a.result.report);
  a.piece = std::move(piece);
  return a;
}

}  // namespace

std::optional<Workpiece> refineWhereItFails(const Workpiece& piece, int axis, std::span<const Failure> failures, std::size_t maxNodes) {
  const AxisBasis& basis = piece.lattice.axis[static_cast<std::size_t>(axis)];
  const std::size_t others = piece.lattice.nodeCount() / static_cast<std::size_t>(basis.nodes());
  const std::size_t most = maxNodes / others;
  const auto nodes = static_cast<std::size_t>(basis.nodes());
  if (most <= nodes || failures.empty()) return {};
  const std::size_t room = most - nodes;
  if (basis.kind() == BasisKind::Bernstein)
    return apply(piece, axis, elevate(basis, basis.nodes() + static_cast<int>(std::min<std::size_t>(room, std::max<std::size_t>(1, nodes / 2)))));
  std::vector<int> pieces = failingPieces(piece.lattice, axis, failures);
  if (pieces.size() > room) pieces.resize(room);
  if (pieces.empty()) return {};
  std::sort(pieces.begin(), pieces.end());
  return apply(piece, axis, insertKnots(basis, pieces));
}

std::optional<Workpiece> refineWhereItFails(const Workpiece& piece, std::span<const Failure> failures, std::size_t maxNodes) {
  std::optional<Workpiece> out;
  for (int axis = 0; axis < 3; ++axis)
    if (auto next = refineWhereItFails(out ? *out : piece, axis, failures, maxNodes)) out = std::move(next);
  return out;
}

Solved solveRefining(const Workpiece& piece, const Targets& targets, const ManipulationOptions& given, std::size_t maxNodes,
                     Progress& progress) {
  // With nodes to spare, what only large changes could meet is better met by more nodes.
  // Polynomials of high degree are never tame.
  ManipulationOptions options = given;
  const bool tame = maxNodes > 0 && std::all_of(piece.lattice.axis.begin(), piece.lattice.axis.end(),
                                                [](const AxisBasis& a) { return a.kind() == BasisKind::BSpline; });
  if (tame) {
    options.solver.rankTolerance = std::max(options.solver.rankTolerance, kTame);
    options.solver.maxIterations = std::min(options.solver.maxIterations, 200);
    options.solver.fallbackWork = std::min(options.solver.fallbackWork, 5e8);
  }
  Attempt now = attempt(piece, targets, options);
  Solved out;
  while (now.result.report.unmet > 0) {
    progress.throwIfCancelled();
    out.contradictory = contradicts(targets, now.result.report);
    if (out.contradictory) break;
    const std::vector<Failure> failures = failuresOf(targets, now.result.report);
    std::optional<Attempt> best;
    double bestGain = 0;
    for (int axis = 0; axis < 3; ++axis) {
      auto finer = refineWhereItFails(now.piece, axis, failures, maxNodes);
      if (!finer) continue;
      const auto added = static_cast<double>(finer->lattice.nodeCount() - now.piece.lattice.nodeCount());
      Attempt trial = attempt(std::move(*finer), targets, options);
      const double gain = now.miss - trial.miss;
      // All met with the fewest nodes; else the most for a node.
      const bool met = trial.result.report.unmet == 0;
      const double worth = (met ? 1e6 * now.miss : gain) / added;
      if ((met || gain > kGain * now.miss) && worth > bestGain) bestGain = worth, best = std::move(trial);
    }
    if (!best) {
      auto finer = refineWhereItFails(now.piece, failures, maxNodes);
      if (!finer) break;
      best = attempt(std::move(*finer), targets, options);
    }
    now = std::move(*best);
    ++out.refinements;
  }
  if (tame && now.result.report.unmet > 0) now = attempt(std::move(now.piece), targets, given);
  out.before = std::move(now.piece);
  out.displacements = std::move(now.result.displacements);
  out.report = std::move(now.result.report);
  return out;
}

}  // namespace fielddeform::map::detail
