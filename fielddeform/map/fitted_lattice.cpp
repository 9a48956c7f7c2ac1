#include <fielddeform/core/error.h>
#include <fielddeform/map/fitted_lattice.h>
#include <fielddeform/numeric/rotation.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace fielddeform::map {
namespace {

constexpr double kFrameWeight = 0.3;

std::array<int, 3> nodesFor(const LatticeBox& box) {
  const Vec3 side = box.axes.diagonal();
  std::array<int, 3> nodes{};
  for (int k = 0; k < 3; ++k) nodes[k] = std::clamp(static_cast<int>(std::lround(3 * side[k] / side.minCoeff())) + 1, 4, 12);
  return nodes;
}

// Displacements of the nodes by the best rigid motion of the pairs; none if it is none.
std::vector<Vec3> rigidStart(const PointPairs& pairs, const std::vector<Vec3>& nodes) {
  const auto n = static_cast<double>(pairs.rest.size());
  Vec3 p = Vec3::Zero(), q = Vec3::Zero();
  for (std::size_t i = 0; i < pairs.rest.size(); ++i) p += pairs.rest[i] / n, q += (pairs.posed[i] - pairs.rest[i]) / n;
  q += p;
  Mat3 c = Mat3::Zero();
  for (std::size_t i = 0; i < pairs.rest.size(); ++i) c += (pairs.rest[i] - p) * (pairs.posed[i] - q).transpose();
  const Mat3 turn = numeric::kabsch(c);
  std::vector<Vec3> out;
  for (const Vec3& x : nodes) out.push_back((q - p) + (turn * (x - p) - (x - p)));
  return out;
}

double largestMiss(const LatticeMap& map, const PointPairs& pairs) {
  double worst = 0;
  for (std::size_t i = 0; i < pairs.rest.size(); ++i) worst = std::max(worst, (map.position(pairs.rest[i]) - pairs.posed[i]).norm());
  return worst;
}

}  // namespace

FittedLattice fitLattice(const SkeletonMotion& motion, Points points, const FittedLatticeOptions& options) {
  requireInRange("padding", options.padding, 0, 1e6);
  const PointPairs pairs = pointPairs(motion, options.pairs);
  std::vector<Vec3> all(points.begin(), points.end());
  all.insert(all.end(), pairs.rest.begin(), pairs.rest.end());
  FittedLattice out;
  out.targets = pairs.rest.size();
  out.lattice.box = fitBox(all, options.padding);
  const std::array<int, 3> nodes = options.nodes.value_or(nodesFor(out.lattice.box));
  for (int k = 0; k < 3; ++k) {
    if (nodes[k] < 2 || nodes[k] > 64) throw std::invalid_argument(fmt::format("nodes: {}, must be 2 to 64 on each axis", nodes[k]));
    out.lattice.axis[k] = AxisBasis::bspline(nodes[k], std::min(3, nodes[k] - 1), Border::Coincident);
  }
  if (motion.unedited) {
    out.report.met = out.targets;
    return out;
  }
  out.lattice.displacements = rigidStart(pairs, out.lattice.restNodes());
  // A rigid motion is met already; solving for its rounding would only amplify that.
  if (largestMiss(LatticeMap(out.lattice), pairs) <= 1e-12 * out.lattice.box.axes.norm()) {
    out.report.met = out.targets;
    return out;
  }
  Targets targets;
  for (std::size_t i = 0; i < pairs.rest.size(); ++i) targets.points.push_back({pairs.rest[i], pairs.posed[i], i < pairs.own ? 1 : kFrameWeight});
  // Pairs that a lattice can meet only by throwing its nodes far out are not met.
  ManipulationOptions solve;
  solve.solver.damping = options.damping;
  Manipulated moved = moveTargets(LatticeMap(out.lattice), targets, solve);
  out.lattice.displacements = std::move(moved.displacements);
  out.report = std::move(moved.report);
  return out;
}

}  // namespace fielddeform::map
