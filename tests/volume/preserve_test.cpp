#include <fielddeform/core/error.h>
#include <fielddeform/volume/detail/moments.h>
#include <fielddeform/volume/preserve.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/support/shapes.h"
#include "tests/support/volume_cases.h"
#include "tests/volume/volume_testing.h"

namespace fielddeform::volume {
namespace {

using tests::VolumeCase;
using test::together;

Result solve(const Problem& p, const Options& options = {}) {
  Progress progress;
  return preserve(p, options, progress);
}
Options augmented() { return {.solver = Solver::AugmentedLagrangian}; }

/// A mesh in a lattice of its own, at rest.
VolumeCase inLattice(const mesh::Mesh& mesh, std::array<int, 3> nodes, map::BasisKind kind = map::BasisKind::Bernstein, std::vector<Index> region = {}) {
  VolumeCase c{"", {}, mesh, {}};
  c.lattice.box = map::fitBox(mesh.positions(), 0.05);
  for (std::size_t a = 0; a < 3; ++a)
    c.lattice.axis[a] = kind == map::BasisKind::Bernstein ? map::AxisBasis::bernstein(nodes[a]) : map::AxisBasis::bspline(nodes[a], 3, map::Border::Free);
  c.problem.map = std::make_shared<map::LatticeMap>(c.lattice);
  c.problem.surface = makeSurface(*c.problem.map, mesh, std::move(region));
  c.problem.energy = std::make_shared<SpringNetwork>(c.lattice);
  return c;
}

mesh::Mesh shifted(mesh::Mesh m, const Vec3& by) {
  for (Vec3& p : m.mutablePositions()) p += by;
  return m;
}

std::string refusal(const Problem& p, const Options& o = {}) {
  try {
    solve(p, o);
  } catch (const InfeasibleError& e) {
    return e.what();
  }
  return "accepted";
}

TEST(Preserve, DilationOfABallFindsTheSimilarBall) {
  VolumeCase c = inLattice(tests::makeIcosphere(2), {3, 3, 3});
  const double base = SurfaceVolume(c.mesh.positions(), c.mesh.triangles()).value(c.mesh.positions());
  c.problem.constraints.volume = {1.5 * base};
  for (const Options& o : {Options{}, augmented(), Options{.solver = Solver::Projection}}) {
    const Result r = solve(c.problem, o);
    EXPECT_NEAR(r.report.volumes[0].after, 1.5 * base, 1.5e-12 * base);
    EXPECT_NEAR(r.report.volumes[0].base, base, 1e-15);
  }
}

TEST(Preserve, AtRestNothingMoves) {
  const VolumeCase c = inLattice(tests::makeIcosphere(2), {3, 3, 3});
  for (const Options& o : {Options{}, augmented(), Options{.solver = Solver::Projection}}) {
    const Result r = solve(c.problem, o);
    for (std::size_t v = 0; v < r.positions.size(); ++v) EXPECT_EQ(r.positions[v], c.mesh.positions()[v]);
    EXPECT_EQ(r.report.energy, 0);
  }
}

TEST(Preserve, PointTargetsAreMetWithTheVolume) {
  for (const auto kind : {map::BasisKind::Bernstein, map::BasisKind::BSpline}) {
    VolumeCase c = inLattice(tests::makeClub(2), {5, 4, 4}, kind);
    PointTargets targets;
    for (const Index v : {0u, 7u, 50u}) targets.base.push_back(c.mesh.positions()[v]);
    targets.position = targets.base;
    targets.position[0] += Vec3(0.1, 0.2, 0);
    targets.position[1] += Vec3(-0.1, 0, 0.1);
    targets.base.push_back(targets.base[1]), targets.position.push_back(targets.position[1]);  // twice the same: no harm
    targets.binding = c.problem.map->bind(targets.base);
    c.problem.constraints.points = targets;
    c.problem.constraints.pinned = {0, 1};
    for (const Options& o : {Options{}, augmented(), Options{.solver = Solver::Projection}}) {
      const Result r = solve(c.problem, o);
      EXPECT_LT(r.report.pointResidual, 1e-12) << toString(o.solver);
      EXPECT_LE(std::abs(r.report.volumes[0].deviation()), 1e-12);
      EXPECT_LT((r.positions[7] - targets.position[1]).norm(), 1e-12);
      EXPECT_EQ(r.report.outcome, Outcome::Converged) << r.report.message;
    }
  }
}

TEST(Preserve, EveryComponentKeepsItsOwnVolume) {
  const mesh::Mesh two = together(shifted(tests::makeIcosphere(2), {-1.2, 0, 0}), shifted(tests::makeIcosphere(2), {1.2, 0, 0}));
  std::vector<Index> region(two.faceCount(), 0);
  std::fill(region.begin() + static_cast<std::ptrdiff_t>(two.faceCount() / 2), region.end(), 1);
  VolumeCase c = inLattice(two, {5, 3, 3}, map::BasisKind::Bernstein, region);
  c.problem.start.assign(45, Vec3::Zero());
  for (Index i = 0; i < 45; ++i)
    if (i % 5 < 1) c.problem.start[i] = Vec3(0, 0.3 * (1 - static_cast<int>(i / 5 % 3)), 0), c.problem.constraints.pinned.push_back(i);
  for (const Options& o : {Options{}, augmented(), Options{.solver = Solver::Projection}}) {
    const Result r = solve(c.problem, o);
    ASSERT_EQ(r.report.volumes.size(), 2u);
    for (const RegionVolume& v : r.report.volumes) EXPECT_LE(std::abs(v.deviation()), 1e-12) << toString(o.solver);
  }
  c.problem.constraints.volume = {std::numeric_limits<double>::quiet_NaN(), 2 * SurfaceVolume(two.positions(), two.triangles(), region).value(two.positions(), 1)};
  const Result r = solve(c.problem);
  EXPECT_LE(std::abs(r.report.volumes[1].deviation()), 1e-12);
  EXPECT_NE(r.report.volumes[0].after, r.report.volumes[0].base);
}

/// Centre and spread of a solid by brute force: a million points of a grid, inside by the lattice's own coordinates is not
/// needed here, since the mesh is a box.
TEST(Moments, OfABoxAreThoseOfTheFormula) {
  const mesh::Mesh box = shifted(test::cube(), {3, 4, 5});
  const SurfaceVolume surface(box.positions(), box.triangles());
  const auto t = detail::regionTotals(surface, box.positions(), 0);
  EXPECT_NEAR(t.volume, 1, 1e-15);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_NEAR(t.first[k], 0, 1e-15);
    EXPECT_NEAR(t.second[k], 1.0 / 12, 1e-15);
    EXPECT_NEAR(t.second[k + 3], 0, 1e-15);
  }
}

TEST(Moments, DerivativesAgreeWithCentralDifferences) {
  const mesh::Mesh ball = tests::makeIcosphere(1);
  const SurfaceVolume surface(ball.positions(), ball.triangles());
  const auto x = test::added(ball.positions(), test::noise(1, ball.vertexCount()), 0.1), p = test::noise(2, ball.vertexCount());
  const detail::TotalsWeight<double> w{0.3, {0.5, -0.2, 0.7}, {0.1, 0.9, -0.4, 0.3, 0.2, -0.6}};
  const auto value = [&](const std::vector<Vec3>& at) {
    const auto t = detail::regionTotals(surface, at, 0);
    double sum = w.volume * t.volume;
    for (std::size_t k = 0; k < 3; ++k) sum += w.first[k] * t.first[k];
    for (std::size_t k = 0; k < 6; ++k) sum += (k < 3 ? 1 : 2) * w.second[k] * t.second[k];
    return sum;
  };
  std::vector<Vec3> g(x.size()), hp(x.size()), plus(x.size()), minus(x.size());
  detail::regionGradient(surface, x, 0, w, g);
  const double h = 1e-5;
  EXPECT_NEAR(test::dot(g, p), (value(test::added(x, p, h)) - value(test::added(x, p, -h))) / (2 * h), 1e-8);
  const detail::TotalsWeight<detail::Dual> dual{0.3, {0.5, -0.2, 0.7}, {0.1, 0.9, -0.4, 0.3, 0.2, -0.6}};
  detail::regionGradient(surface, x, p, 0, dual, hp);
  detail::regionGradient(surface, test::added(x, p, h), 0, w, plus);
  detail::regionGradient(surface, test::added(x, p, -h), 0, w, minus);
  for (std::size_t v = 0; v < x.size(); ++v) EXPECT_LT((hp[v] - (plus[v] - minus[v]) / (2 * h)).norm(), 1e-8);
}

TEST(Preserve, CentreOfMassAndInertiaHold) {
  VolumeCase c = inLattice(tests::makeClub(2), {4, 3, 3});
  const std::size_t n = c.lattice.nodeCount();
  const SurfaceVolume surface(c.mesh.positions(), c.mesh.triangles());
  const auto t = detail::regionTotals(surface, c.mesh.positions(), 0);
  const Vec3 mean = Vec3(t.first[0], t.first[1], t.first[2]) / t.volume;
  Mat3 spread;
  spread << t.second[0], t.second[5], t.second[4], t.second[5], t.second[1], t.second[3], t.second[4], t.second[3], t.second[2];
  spread = spread / t.volume - mean * mean.transpose();
  c.problem.start.assign(n, Vec3::Zero());
  for (Index i = 0; i < n; i += 4) c.problem.start[i] = Vec3(-0.05, 0.03, 0), c.problem.constraints.pinned.push_back(i);
  c.problem.constraints.moments = {{.centre = mean + surface.centre(0), .spread = spread}};
  for (const Options& o : {Options{}, Options{.solver = Solver::AugmentedLagrangian, .augmentedLagrangian = {.minimiser = Minimiser::Lbfgs, .maxSteps = 300}}}) {
    const Result r = solve(c.problem, o);
    EXPECT_LE(std::abs(r.report.volumes[0].deviation()), 1e-12) << toString(o.solver);
    EXPECT_LT(r.report.momentResidual, 1e-12) << toString(o.solver);
    const auto after = detail::regionTotals(surface, r.positions, 0);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(after.first[static_cast<std::size_t>(k)] / after.volume, mean[k], 1e-11);
  }
}

TEST(Preserve, ManyNodesAreSolvedSparsely) {
  VolumeCase c = inLattice(tests::makeClub(3), {10, 6, 6}, map::BasisKind::BSpline);  // 1080 variables
  c.problem.start.assign(360, Vec3::Zero());
  const auto rest = c.lattice.restNodes();
  for (Index i = 0; i < 360; ++i)
    if (i % 10 < 4) c.problem.start[i] = Vec3(0, -0.4 * rest[i].y(), -0.4 * rest[i].z()), c.problem.constraints.pinned.push_back(i);
  const Result exact = solve(c.problem), paper = solve(c.problem, {.solver = Solver::AugmentedLagrangian, .augmentedLagrangian = {.minimiser = Minimiser::Lbfgs}});
  EXPECT_EQ(exact.report.outcome, Outcome::Converged) << exact.report.message;
  EXPECT_LE(std::abs(exact.report.volumes[0].deviation()), 1e-12);
  EXPECT_NEAR(paper.report.energy, exact.report.energy, 2e-3 * exact.report.energy);  // a deviation of 5e-4 was projected away
}

TEST(PreserveSlow, ALatticeOf24NodesAnAxisIsSolvedSparsely) {
  // 13 824 nodes, of which the upper half is pinned a tenth further up: a sheet of cells between gives the volume back.
  VolumeCase c = inLattice(tests::makeIcosphere(3), {24, 24, 24}, map::BasisKind::BSpline);
  c.problem.start.assign(c.lattice.nodeCount(), Vec3::Zero());
  for (Index i = 0; i < c.problem.start.size(); ++i)
    if (const Index layer = i / (24 * 24); layer < 8 || layer >= 14) {
      if (layer >= 14) c.problem.start[i] = Vec3(0, 0, 0.05);
      c.problem.constraints.pinned.push_back(i);
    }
  const Result r = solve(c.problem);
  EXPECT_EQ(r.report.outcome, Outcome::Converged) << r.report.message;
  EXPECT_LE(std::abs(r.report.volumes[0].deviation()), 1e-12);
  EXPECT_LT(r.report.iterations, 30);
}

TEST(Preserve, SparseSolvesLeaveSaddlesToo) {
  // A bar pressed end to end along its axis: a straight strut is stationary, and no minimum. 864 variables.
  VolumeCase c = inLattice(tests::makeClub(2), {12, 6, 6}, map::BasisKind::BSpline);
  for (Vec3& p : c.mesh.mutablePositions()) p = p.cwiseProduct(Vec3(1, 0.2, 0.2));
  c = inLattice(c.mesh, {12, 6, 6}, map::BasisKind::BSpline);
  const auto rest = c.lattice.restNodes();
  c.problem.start.assign(rest.size(), Vec3::Zero());
  for (Index i = 0; i < rest.size(); ++i) {
    const Index x = i % 12;
    c.problem.start[i].x() = -0.1 * rest[i].x();
    if (x < 2 || x > 9) c.problem.constraints.pinned.push_back(i);
  }
  const Result stays = solve(c.problem, {.exact = {.maxSaddles = 0}}), leaves = solve(c.problem);
  EXPECT_EQ(stays.report.saddles, 0);
  EXPECT_GE(leaves.report.saddles, 1);
  EXPECT_LT(leaves.report.energy, 0.99 * stays.report.energy);
  EXPECT_EQ(leaves.report.outcome, Outcome::Converged) << leaves.report.message;
}

/// A lattice whose displacement is multiplied by a mask that vanishes at z <= 0.
class Masked final : public map::LinearMap {
 public:
  explicit Masked(std::shared_ptr<const map::LinearMap> inner) : inner_(std::move(inner)) {}
  struct Bound final : map::Binding {
    std::shared_ptr<const map::Binding> inner;
    std::vector<double> mask;
    std::size_t size() const override { return mask.size(); }
  };
  std::shared_ptr<const map::Binding> bind(Points rest) const override {
    auto out = std::make_shared<Bound>();
    out->inner = inner_->bind(rest);
    for (const Vec3& p : rest) out->mask.push_back(p.z() > 0 ? std::min(1.0, 4 * p.z() * p.z()) : 0);
    return out;
  }
  void apply(const map::Binding&, map::MapOutput, Progress&) const override { throw std::logic_error("not needed"); }
  void jacobians(const map::Binding&, std::span<Mat3>) const override { throw std::logic_error("not needed"); }
  std::size_t nodeCount() const override { return inner_->nodeCount(); }
  Points restNodes() const override { return inner_->restNodes(); }
  Points displacements() const override { return inner_->displacements(); }
  map::SparseRows basis(const map::Binding& binding) const override {
    const Bound& b = dynamic_cast<const Bound&>(binding);
    map::SparseRows rows = inner_->basis(*b.inner);
    for (std::size_t r = 0; r < rows.rows(); ++r)
      for (std::size_t k = rows.start[r]; k < rows.start[r + 1]; ++k) rows.value[k] *= b.mask[r];
    return rows;
  }
  void combine(const map::Binding& binding, Points v, std::span<Vec3> out) const override {
    const Bound& b = dynamic_cast<const Bound&>(binding);
    inner_->combine(*b.inner, v, out);
    for (std::size_t p = 0; p < out.size(); ++p) out[p] *= b.mask[p];
  }
  void gather(const map::Binding& binding, Points v, std::span<Vec3> out) const override {
    const Bound& b = dynamic_cast<const Bound&>(binding);
    std::vector<Vec3> masked(v.begin(), v.end());
    for (std::size_t p = 0; p < v.size(); ++p) masked[p] *= b.mask[p];
    inner_->gather(*b.inner, masked, out);
  }
  std::unique_ptr<LinearMap> withDisplacements(Points d) const override { return std::make_unique<Masked>(inner_->withDisplacements(d)); }

 private:
  std::shared_ptr<const map::LinearMap> inner_;
};

TEST(Preserve, AMaskedMapAndFixedRimsWorkUnchanged) {
  // A ball without its lower part; the mask leaves z <= 0 alone, so the rim never moves. The closed ball is the oracle.
  const mesh::Mesh ball = tests::makeIcosphere(3);
  VolumeCase closed = inLattice(ball, {3, 3, 3});
  closed.problem.map = std::make_shared<Masked>(closed.problem.map);
  closed.problem.surface = makeSurface(*closed.problem.map, ball);
  const double base = SurfaceVolume(ball.positions(), ball.triangles()).value(ball.positions());
  closed.problem.constraints.volume = {1.1 * base};
  for (Index i = 0; i < 9; ++i) closed.problem.constraints.pinned.push_back(i);  // else a translation costs nothing
  VolumeCase open = closed;
  std::vector<Index> kept;
  for (std::size_t t = 0; t < open.problem.surface.triangles.size(); t += 3) {
    const Index* v = open.problem.surface.triangles.data() + t;
    if (std::max({ball.positions()[v[0]].z(), ball.positions()[v[1]].z(), ball.positions()[v[2]].z()}) > -0.3) kept.insert(kept.end(), v, v + 3);
  }
  open.problem.surface.triangles = kept;
  open.problem.rims = Rims::Fixed;
  open.problem.constraints.volume = {SurfaceVolume(ball.positions(), kept, {}, Rims::Fixed).value(ball.positions()) + 0.1 * base};
  for (const Options& o : {Options{}, Options{.exact = {.grids = Grids::Fine}}, Options{.solver = Solver::Projection}, augmented()}) {
    const Result a = solve(closed.problem, o), b = solve(open.problem, o);
    EXPECT_LE(std::abs(a.report.volumes[0].deviation()), 1e-12);
    EXPECT_LE(std::abs(b.report.volumes[0].deviation()), 1e-12);
    // The paper's solver ends at 5e-4 of volumes that differ: no closer than that.
    const double share = o.solver == Solver::AugmentedLagrangian ? 1e-2 : 1e-6;
    EXPECT_NEAR(a.report.energy, b.report.energy, share * a.report.energy) << toString(o.solver);
    for (std::size_t v = 0; v < ball.vertexCount(); ++v) {
      EXPECT_LT((a.positions[v] - b.positions[v]).norm(), share == 1e-6 ? 1e-5 : 0.02) << toString(o.solver);
      if (ball.positions()[v].z() <= 0) { EXPECT_EQ(a.positions[v], ball.positions()[v]); }
    }
  }
}

TEST(Preserve, SaysWhatCannotBe) {
  VolumeCase c = tests::clubCompression(1);
  Problem all = c.problem;
  all.constraints.pinned.clear();
  for (Index i = 0; i < 20; ++i) all.constraints.pinned.push_back(i);
  EXPECT_NE(refusal(all).find("all 20 nodes are pinned"), std::string::npos) << refusal(all);
  all.start.assign(20, Vec3::Zero());
  EXPECT_EQ(refusal(all), "accepted");  // nothing to do

  for (const double target : {-1.0, 0.0, std::numeric_limits<double>::infinity()}) {
    Problem p = c.problem;
    p.constraints.volume = {target};
    EXPECT_NE(refusal(p).find("expected a positive number"), std::string::npos) << refusal(p);
  }
  Problem open = c.problem;
  open.coarser.clear();
  open.surface.triangles.resize(open.surface.triangles.size() - 3);
  EXPECT_NE(refusal(open).find("3 boundary edges"), std::string::npos) << refusal(open);

  Problem inside = c.problem;
  inside.coarser.clear();
  for (std::size_t t = 0; t < inside.surface.triangles.size(); t += 3) std::swap(inside.surface.triangles[t], inside.surface.triangles[t + 1]);
  EXPECT_NE(refusal(inside).find("turned inwards"), std::string::npos) << refusal(inside);

  Problem torn = c.problem;
  PointTargets targets;
  targets.base = {c.mesh.positions()[0], c.mesh.positions()[0]};
  targets.position = {Vec3(0, 0, 0), Vec3(1, 0, 0)};
  targets.binding = torn.map->bind(targets.base);
  torn.constraints.points = targets;
  EXPECT_NE(refusal(torn).find("contradict each other"), std::string::npos) << refusal(torn);
}

TEST(Preserve, ChecksItsArguments) {
  const VolumeCase c = tests::clubCompression(1);
  const auto refused = [&](auto&& change) {
    Problem p = c.problem;
    change(p);
    EXPECT_THROW(solve(p), std::invalid_argument);
  };
  refused([](Problem& p) { p.map = nullptr; });
  refused([](Problem& p) { p.energy = nullptr; });
  refused([](Problem& p) { p.surface.binding = nullptr; });
  refused([](Problem& p) { p.start.pop_back(); });
  refused([](Problem& p) { p.start[3].x() = std::numeric_limits<double>::quiet_NaN(); });
  refused([](Problem& p) { p.constraints.pinned = {99}; });
  refused([](Problem& p) { p.constraints.volume = {1, 2}; });
  refused([](Problem& p) { p.constraints.moments = {{.region = 4}}; });
  Options o;
  o.exact.starts = 0;
  EXPECT_THROW(solve(c.problem, o), std::invalid_argument);
  o = {};
  o.augmentedLagrangian.tolerance = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(solve(c.problem, o), std::invalid_argument);
}

TEST(Preserve, CanBeStopped) {
  const VolumeCase c = tests::clubCompression(1);
  Progress progress;
  progress.cancel();
  EXPECT_THROW(preserve(c.problem, {}, progress), Cancelled);
}

TEST(Levels, FlatFacesAreSplitAndStayWhatTheyWere) {
  const mesh::Mesh box = test::cube(), fine = refineLongEdges(box, 0.3);
  const SurfaceVolume volume(fine.positions(), fine.triangles());  // closed: no T-junctions
  EXPECT_NEAR(volume.value(fine.positions()), 1, 1e-14);
  for (std::size_t f = 0; f < fine.faceCount(); ++f)
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_LE((fine.positions()[fine.face(f)[k]] - fine.positions()[fine.face(f)[(k + 1) % 3]]).norm(), 0.3);
  EXPECT_EQ(refineLongEdges(box, 2).faceCount(), 12u);
}

TEST(Levels, ShrinkByTheRatioRegionByRegion) {
  const mesh::Mesh two = together(shifted(tests::makeIcosphere(3), {-1.2, 0, 0}), shifted(tests::makeIcosphere(2), {1.2, 0, 0}));
  std::vector<Index> region(two.faceCount(), 0);
  std::fill(region.begin() + 1280, region.end(), 1);
  const VolumeCase c = inLattice(two, {3, 2, 2});
  const auto levels = makeLevels(*c.problem.map, two, {.coarsest = 50, .longestEdge = 0}, region);
  ASSERT_EQ(levels.size(), 2u);
  EXPECT_NEAR(static_cast<double>(levels[1].triangles.size() / 3), 400, 5);
  EXPECT_NEAR(static_cast<double>(levels[0].triangles.size() / 3), 100, 5);
  for (const Surface& s : levels) EXPECT_EQ(SurfaceVolume(s.base, s.triangles, s.region).regionCount(), 2u);
}

}  // namespace
}  // namespace fielddeform::volume
