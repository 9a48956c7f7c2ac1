// The four combinations of energy and solver.
#include <fielddeform/core/error.h>
#include <fielddeform/mesh/lod.h>
#include <fielddeform/volume/detail/local_problem.h>
#include <fielddeform/volume/preserve.h>

#include <algorithm>

namespace fielddeform::volume::detail {
namespace {

constexpr std::size_t kLevelRatio = 4, kCoarsest = 64, kFewest = 16;  // triangles; [Hirota et al. 1999] quadruples them

// Of the energy's gradient, in preserve()'s unit: beyond it no vertex moves by more than a ten thousandth of the size.
constexpr double kOptimal = 1e-6;

/// Springs between the nodes, and the mean square displacement of the surface: the springs alone would let a part slide back
/// rigidly, which costs them nothing, where the paper pins nodes.
class HeldSprings final : public Energy {
 public:
  HeldSprings(SpringNetwork springs, QuadraticEnergy surface) : springs_(std::move(springs)), surface_(std::move(surface)) {}
  std::size_t nodeCount() const override { return springs_.nodeCount(); }
  double value(Points d) const override { return springs_.value(d) + surface_.value(d); }
  double gradient(Points d, std::span<Vec3> out) const override {
    std::vector<Vec3> more(out.size());
    const double value = springs_.gradient(d, out) + surface_.gradient(d, more);
    for (std::size_t i = 0; i < out.size(); ++i) out[i] += more[i];
    return value;
  }
  SparseMatrix hessian(Points d) const override { return springs_.hessian(d) + surface_.hessian(d); }

 private:
  SpringNetwork springs_;
  QuadraticEnergy surface_;
};

// A spring to each of a node's 26 neighbours that is active, of stiffness (l / h)^2 / N.
SpringNetwork springsOf(const LocalLattice& l, double length) {
  const auto n = l.lattice.nodes();
  std::vector<Index> own(l.lattice.nodeCount(), kNoIndex);
  for (Index i = 0; i < l.active.size(); ++i) own[l.active[i]] = i;
  const Points rest = l.map->restNodes();
  const double stiff = stiffness(l, length, 2);
  std::vector<SpringNetwork::Spring> springs;
  for (Index i = 0; i < l.active.size(); ++i) {
    const auto a = static_cast<int>(l.active[i]);
    const int x = a % n[0], y = a / n[0] % n[1], z = a / n[0] / n[1];
    for (int k = 14; k < 27; ++k) {  // the half of the neighbours that comes later
      const int p = x + k % 3 - 1, q = y + k / 3 % 3 - 1, r = z + k / 9 - 1;
      if (p < 0 || q < 0 || p >= n[0] || q >= n[1] || r >= n[2]) continue;
      const Index j = own[l.lattice.index(p, q, r)];
      if (j != kNoIndex) springs.push_back({i, j, (rest[j] - rest[i]).norm(), stiff});
    }
  }
  return SpringNetwork({rest.begin(), rest.end()}, std::move(springs));
}

// One surface of all parts, a region each.
struct Joined {
  std::vector<Vec3> base;
  std::vector<double> mask;
  std::vector<Index> triangles, region;

  void add(Points points, std::span<const double> masks, std::span<const Index> corners, Index label) {
    const auto first = static_cast<Index>(base.size());
    base.insert(base.end(), points.begin(), points.end());
    mask.insert(mask.end(), masks.begin(), masks.end());
    for (const Index v : corners) triangles.push_back(first + v);
    region.insert(region.end(), corners.size() / 3, label);
  }
  Surface bound(const map::MaskedMap& map) const { return {map.bind(base, mask), base, triangles, region}; }
};

// Coarser copies, each made of the one before, a quarter of its triangles; their vertices stand on the surface's own, and take
// their masks along.
std::vector<Surface> levelsOf(const LocalParts& parts, const LocalLattice& lattice) {
  std::vector<mesh::Mesh> now;
  std::vector<std::vector<double>> mask;
  for (const LocalPart& part : parts.part) now.emplace_back(part.base, part.surface->triangles()), mask.push_back(part.mask);
  std::vector<Surface> levels;
  const auto largest = [&] {
    std::size_t most = 0;
    for (const mesh::Mesh& m : now) most = std::max(most, m.faceCount());
    return most;
  };
  for (std::size_t before = largest(); before / kLevelRatio >= kCoarsest;) {
    Joined level;
    for (Index c = 0; c < now.size(); ++c) {
      mesh::Lod lod = mesh::simplify(now[c], std::max<std::size_t>(now[c].faceCount() / kLevelRatio, kFewest));
      std::vector<double> kept;
      for (const Index v : lod.vertexOf) kept.push_back(mask[c][v]);
      level.add(lod.mesh.positions(), kept, lod.mesh.corners(), c);
      now[c] = std::move(lod.mesh), mask[c] = std::move(kept);
    }
    const std::size_t after = largest();
    if (2 * after > before) break;  // rims that may not move leave nothing to collapse
    before = after;
    levels.push_back(level.bound(*lattice.map));
  }
  std::reverse(levels.begin(), levels.end());
  return levels;
}

Problem problemOf(const LocalParts& parts, const LocalLattice& lattice, std::shared_ptr<const Energy> energy, bool withLevels) {
  Problem problem;
  problem.map = lattice.map;
  problem.energy = std::move(energy);
  problem.rims = Rims::Fixed;  // the parts end where the mask does
  Joined all;
  for (Index c = 0; c < parts.part.size(); ++c) {
    const LocalPart& part = parts.part[c];
    all.add(part.base, part.mask, part.surface->triangles(), c);
  }
  problem.surface = all.bound(*lattice.map);
  // The volume of an open surface means something in its changes alone, and those do not depend on the caps.
  const SurfaceVolume joined(problem.surface.base, problem.surface.triangles, problem.surface.region, Rims::Fixed);
  const std::vector<double> base = joined.values(problem.surface.base);
  for (std::size_t c = 0; c < base.size(); ++c)
    problem.constraints.volume.push_back(base[c] + (parts.part[c].target - parts.part[c].before));
  if (withLevels) problem.coarser = levelsOf(parts, lattice);
  return problem;
}

bool solveDirectly(LocalSolve& solve, LocalParts& parts, const LocalLattice& lattice, const LocalOptions& options, Progress& progress) {
  if (solve.iterate(options.maxIterations, options.tolerance, progress)) return true;
  // Where the volume came from cannot give it back: all of the part may.
  for (LocalPart& part : parts.part) part.share.assign(part.size(), 1);
  solve.startAt(std::vector<Vec3>(lattice.active.size(), Vec3::Zero()));
  return solve.iterate(options.maxIterations, options.tolerance, progress);
}

}  // namespace

LocalSolved solveLocally(const LocalEdit& edit, const LocalMask& mask, LocalParts& parts, const LocalLattice& lattice,
                         const ComponentVolumes& volumes, const LocalOptions& options, Progress& progress,
                         std::span<Vec3> displacement) {
  const bool springs = options.energy == LocalEnergy::Springs, augmented = options.solver == LocalSolver::AugmentedLagrangian;
  const SparseMatrix surface = surfaceMatrix(lattice, parts);
  const SparseMatrix matrix = surface + stiffness(lattice, mask.length, 4) * bendingMatrix(lattice);
  LocalSolve solve(edit, parts, lattice, matrix, surface, mask.free);
  LocalSolved out;
  bool met = false;
  if (!springs && !augmented) {
    met = solveDirectly(solve, parts, lattice, options, progress);
    out.iterations = solve.iterations();
  } else {
    std::shared_ptr<const Energy> energy;
    if (springs) energy = std::make_shared<HeldSprings>(springsOf(lattice, mask.length), QuadraticEnergy(surface));
    else energy = std::make_shared<QuadraticEnergy>(matrix);
    const Prepared prepared(problemOf(parts, lattice, std::move(energy), augmented));
    Options inner;
    inner.solver = augmented ? Solver::AugmentedLagrangian : Solver::Exact;
    inner.exact.grids = Grids::Fine;  // its coarse copy is made for lattices of few nodes
    inner.exact.gradient = kOptimal;
    inner.augmentedLagrangian.maxSaddles = 0;  // held to the surface: nothing buckles
    const Result result = preserve(prepared, inner, progress);
    out.iterations = result.report.iterations;
    // What is left of the volume, and of a rigid motion, by the pass's own step.
    solve.startAt(result.displacements);
    met = solve.iterate(1, options.tolerance, progress);
  }
  if (!met) throw InfeasibleError("no displacement of the part that the volume mask frees restores the volume; use a wider mask");
  out.deviation = solve.polish(volumes, displacement);
  return out;
}

}  // namespace fielddeform::volume::detail
