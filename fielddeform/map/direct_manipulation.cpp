#include <fielddeform/core/error.h>
#include <fielddeform/map/detail/direction_rows.h>
#include <fielddeform/map/direct_manipulation.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace fielddeform::map {
namespace {

void requireFinitePoint(const char* what, std::size_t i, const Vec3& p) {
  if (!p.allFinite()) throw std::invalid_argument(fmt::format("{} {}: not finite", what, i));
}

void requireTargets(const LinearMap& map, const Targets& t, const ManipulationOptions& o) {
  o.validate();
  if (!o.nodeCost.empty() && o.nodeCost.size() != map.nodeCount())
    throw std::invalid_argument(fmt::format("nodeCost: {} given, expected {}, one a node", o.nodeCost.size(), map.nodeCount()));
  for (std::size_t i = 0; i < t.points.size(); ++i) {
    requireFinitePoint("target", i, t.points[i].rest);
    requireFinitePoint("target", i, t.points[i].image);
    requirePositive("weight", t.points[i].weight);
  }
  for (std::size_t i = 0; i < t.directions.size(); ++i) {
    requireFinitePoint("direction", i, t.directions[i].rest);
    requireFinitePoint("direction", i, t.directions[i].direction);
    requireFinitePoint("direction", i, t.directions[i].image);
    requirePositive("weight", t.directions[i].weight);
    if (!(t.directions[i].direction.stableNorm() > 0)) throw std::invalid_argument(fmt::format("direction {}: has no length", i));
  }
  for (std::size_t i = 0; i < t.pinnedPoints.size(); ++i) requireFinitePoint("pinned point", i, t.pinnedPoints[i]);
  for (const Index n : t.pinnedNodes)
    if (n >= map.nodeCount())
      throw std::invalid_argument(fmt::format("pinned node {}: must be less than {}", n, map.nodeCount()));
}

double sizeOf(Points nodes) {
  Box box;
  for (const Vec3& p : nodes) box.extend(p);
  return box.isEmpty() ? 0 : box.sizes().stableNorm();
}

Vec3 times(const SparseRows& rows, std::size_t r, Points nodeValues) {
  Vec3 sum = Vec3::Zero();
  for (std::size_t e = rows.start[r]; e < rows.start[r + 1]; ++e) sum += rows.value[e] * nodeValues[rows.column[e]];
  return sum;
}

bool emptyRow(const SparseRows& rows, std::size_t r) { return rows.start[r] == rows.start[r + 1]; }

// One row each for points, then directions, then pinned points: the basis, and how far the image is from where it should be.
struct System {
  SparseRows points, directions, pins;
  std::vector<double> pointScale, directionScale;  // of the equations: weight, and for directions a length
  double size = 0;

  System(const LinearMap& map, const Targets& t);
};

System::System(const LinearMap& map, const Targets& t) : size(sizeOf(map.restNodes())) {
  std::vector<Vec3> at, along;
  for (const PointTarget& p : t.points) at.push_back(p.rest), pointScale.push_back(p.weight);
  points = map.basis(*map.bind(at));
  at.clear();
  for (const DirectionTarget& d : t.directions) {
    at.push_back(d.rest), along.push_back(d.direction);
    // In a lattice of this size a direction of this length is missed by about as much as a point at its tip.
    directionScale.push_back(d.weight * size / std::max(d.direction.stableNorm(), d.image.stableNorm()));
  }
  if (!at.empty()) {
    const auto* lattice = dynamic_cast<const LatticeMap*>(&map);
    if (!lattice) throw std::invalid_argument("directions: need a lattice");
    directions = detail::directionRows(lattice->lattice(), at, along);
  }
  pins = map.basis(*map.bind(t.pinnedPoints));
}

Vec3 missOf(const PointTarget& t, const SparseRows& rows, std::size_t r, Points d) { return t.image - (t.rest + times(rows, r, d)); }
Vec3 missOf(const DirectionTarget& t, const SparseRows& rows, std::size_t r, Points d) {
  return t.image - (t.direction + times(rows, r, d));
}

// Rows scaled by their weights, columns by what their nodes cost; pinned nodes left out.
struct Scaled {
  SparseRows rows;
  std::vector<Vec3> right;

  void append(const SparseRows& from, std::size_t r, double scale, const std::vector<double>& unit) {
    for (std::size_t e = from.start[r]; e < from.start[r + 1]; ++e) {
      const double u = unit.empty() ? 1 : unit[from.column[e]];
      if (u == 0) continue;
      rows.column.push_back(from.column[e]);
      rows.value.push_back(scale * u * from.value[e]);
    }
    rows.start.push_back(rows.column.size());
  }
  numeric::SparseRowsView view(std::size_t columns) const { return {columns, rows.start, rows.column, rows.value}; }
};

// What a change of 1 in the unknowns moves a node: 1 / sqrt(cost), 0 for pinned ones. Empty: 1 everywhere.
std::vector<double> nodeUnits(const LinearMap& map, const Targets& t, const ManipulationOptions& o) {
  std::vector<double> unit;
  if (o.nodeCost.empty() && t.pinnedNodes.empty()) return unit;
  unit.assign(map.nodeCount(), 1.0);
  for (std::size_t i = 0; i < o.nodeCost.size(); ++i) unit[i] = 1 / std::sqrt(o.nodeCost[i]);
  for (const Index n : t.pinnedNodes) unit[n] = 0;
  return unit;
}

std::string adviceFor(const ManipulationReport& r) {
  std::string text;
  if (r.unmet > 0)
    text = fmt::format("{} of {} targets are not met, the worst by {:.3g}: {}", r.unmet, r.met + r.unmet + r.outside, r.largestMiss,
                       r.solver.converged ? "a lattice of more nodes may meet them" : "the solver stopped early");
  if (r.outside > 0)
    text += fmt::format("{}{} targets are outside the lattice, which does not move them: give it a larger box",
                        text.empty() ? "" : "; ", r.outside);
  return text;
}

template <class Target>
void judge(const std::vector<Target>& targets, const SparseRows& rows, Points d, const std::vector<double>& tolerance,
           std::vector<TargetState>& states, ManipulationReport& report) {
  for (std::size_t i = 0; i < targets.size(); ++i) {
    TargetState s;
    s.miss = missOf(targets[i], rows, i, d);
    const bool met = s.miss.stableNorm() <= tolerance[i];
    s.outcome = met ? TargetOutcome::Met : emptyRow(rows, i) ? TargetOutcome::Outside : TargetOutcome::Unmet;
    ++(met ? report.met : s.outcome == TargetOutcome::Unmet ? report.unmet : report.outside);
    states.push_back(s);
  }
}

}  // namespace

void ManipulationOptions::validate() const {
  requirePositive("tolerance", tolerance);
  for (const double c : nodeCost) requirePositive("nodeCost", c);
}

Manipulated moveTargets(const LinearMap& map, const Targets& targets, const ManipulationOptions& options) {
  requireTargets(map, targets, options);
  const System system(map, targets);
  const std::vector<double> unit = nodeUnits(map, targets, options);
  Manipulated result;
  const Points before = map.displacements();
  result.displacements.assign(before.begin(), before.end());
  ManipulationReport& report = result.report;

  Scaled wanted, held;
  bool reached = false;
  const auto add = [&](const auto& list, const SparseRows& rows, const std::vector<double>& scale) {
    for (std::size_t i = 0; i < list.size(); ++i) {
      reached = reached || !emptyRow(rows, i);
      wanted.append(rows, i, scale[i], unit);
      wanted.right.push_back(emptyRow(rows, i) ? Vec3(Vec3::Zero()) : Vec3(scale[i] * missOf(list[i], rows, i, before)));
    }
  };
  add(targets.points, system.points, system.pointScale);
  add(targets.directions, system.directions, system.directionScale);
  for (std::size_t i = 0; i < targets.pinnedPoints.size(); ++i) held.append(system.pins, i, 1, unit);
  if (reached && wanted.rows.column.empty())
    throw InfeasibleError("direct manipulation: every node that could move a target is pinned");

  const std::size_t n = map.nodeCount();
  const std::vector<Vec3> change =
      numeric::minNormLeastSquares(wanted.view(n), wanted.right, held.view(n), options.solver, &report.solver);
  double squared = 0;
  for (std::size_t i = 0; i < n; ++i) {
    if (change[i] == Vec3::Zero()) continue;
    squared += change[i].squaredNorm();
    const Vec3 d = result.displacements[i] + (unit.empty() ? 1 : unit[i]) * change[i];
    report.movedNodes += d != result.displacements[i];
    result.displacements[i] = d;
  }
  report.change = std::sqrt(squared);

  std::vector<double> tolerance(targets.points.size(), options.tolerance * system.size);
  judge(targets.points, system.points, result.displacements, tolerance, report.points, report);
  tolerance.clear();
  for (const DirectionTarget& d : targets.directions)
    tolerance.push_back(options.tolerance * std::max(d.direction.stableNorm(), d.image.stableNorm()));
  judge(targets.directions, system.directions, result.displacements, tolerance, report.directions, report);
  for (const TargetState& s : report.points)
    if (s.outcome != TargetOutcome::Outside) report.largestMiss = std::max(report.largestMiss, s.miss.stableNorm());
  for (std::size_t i = 0; i < targets.pinnedPoints.size(); ++i) {
    const Vec3 shift = times(system.pins, i, result.displacements) - times(system.pins, i, before);
    report.largestPinShift = std::max(report.largestPinShift, shift.stableNorm());
  }
  report.advice = adviceFor(report);
  return result;
}

std::vector<double> borderMultiplicity(const Lattice& lattice) {
  const auto n = lattice.nodes();
  const auto times = [&](std::size_t a, int i) {
    const AxisBasis& axis = lattice.axis[a];
    const bool repeated = axis.kind() == BasisKind::BSpline && axis.border() == Border::Coincident && (i == 0 || i == n[a] - 1);
    return repeated ? axis.degree() : 1.0;
  };
  std::vector<double> count;
  count.reserve(lattice.nodeCount());
  for (int k = 0; k < n[2]; ++k)
    for (int j = 0; j < n[1]; ++j)
      for (int i = 0; i < n[0]; ++i) count.push_back(times(0, i) * times(1, j) * times(2, k));
  return count;
}

std::vector<float> affectedRegion(const LinearMap& map, const Binding& vertices, Points before, Points after) {
  if (before.size() != map.nodeCount() || after.size() != map.nodeCount())
    throw std::invalid_argument(fmt::format("before, after: {} and {} nodes, expected {}", before.size(), after.size(), map.nodeCount()));
  std::vector<Vec3> changed(map.nodeCount(), Vec3::Zero()), sum(vertices.size());
  for (std::size_t i = 0; i < changed.size(); ++i)
    if (before[i] != after[i]) changed[i].x() = 1;
  map.combine(vertices, changed, sum);
  std::vector<float> share(sum.size());
  for (std::size_t v = 0; v < share.size(); ++v) share[v] = static_cast<float>(std::clamp(sum[v].x(), 0.0, 1.0));
  return share;
}

}  // namespace fielddeform::map
