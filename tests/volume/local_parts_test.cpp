// The pieces of the volume pass: mask, length, lattice, energy, the root of the cubic.
#include <fielddeform/core/random.h>
#include <fielddeform/volume/detail/local_solve.h>
#include <gtest/gtest.h>
#include <tests/support/cases.h>
#include <tests/support/shapes.h>

#include <cmath>

namespace fielddeform::volume::detail {
namespace {

using mesh::Mesh;

TEST(VolumePassRoot, IsTheRootNearestTo0) {
  for (std::uint64_t i = 0; i < 1000; ++i) {
    double r[3];
    for (int k = 0; k < 3; ++k) r[k] = std::ldexp(2 * uniform01(1, 3 * i + k) - 1, static_cast<int>(i % 20) - 10);
    const double lead = 0.5 + uniform01(2, i);
    const auto found = rootNearest0({-lead * r[0] * r[1] * r[2], lead * (r[0] * r[1] + r[1] * r[2] + r[0] * r[2]),
                                     -lead * (r[0] + r[1] + r[2]), lead});
    ASSERT_TRUE(found);
    double nearest = r[0], gap = std::abs(r[0] - r[1]);
    for (const double x : r)
      if (std::abs(x) < std::abs(nearest)) nearest = x;
    gap = std::min({gap, std::abs(r[0] - r[2]), std::abs(r[1] - r[2])});
    // Close roots are known to the square root of the rounding only.
    const double scale = std::max({std::abs(r[0]), std::abs(r[1]), std::abs(r[2])});
    if (gap > 1e-3 * scale) { EXPECT_NEAR(*found, nearest, 1e-9 * scale); }
  }
}

TEST(VolumePassRoot, ServesQuadraticsLinesAndNoRootsAtAll) {
  EXPECT_DOUBLE_EQ(*rootNearest0({-6, 5, 1, 0}), 1);
  EXPECT_DOUBLE_EQ(*rootNearest0({-6, 3, 0, 0}), 2);
  EXPECT_DOUBLE_EQ(*rootNearest0({0, 3, 1, 1}), 0);
  EXPECT_FALSE(rootNearest0({1, 0, 1, 0}));
  EXPECT_FALSE(rootNearest0({1, 0, 0, 0}));
  EXPECT_FALSE(rootNearest0({std::nan(""), 1, 1, 1}));
  EXPECT_NEAR(*rootNearest0({-1, 3, 1e-30, 1e-25}), 1.0 / 3, 1e-15);
}

LocalEdit edit(const Mesh& mesh, const std::vector<Vec3>& posed) { return LocalEdit({.rest = mesh, .posed = posed}); }

TEST(VolumePassLength, OfATubeIsItsRadiusAndOfABallTwoThirds) {
  const Mesh tube = tests::makeCapsule({.length = 40, .radius = 0.25, .around = 64, .along = 200, .bump = 0});
  const std::vector<std::uint8_t> all(tube.vertexCount(), 1);
  const LocalEdit whole = edit(tube, tube.positions());
  EXPECT_NEAR(std::ldexp(partLength(whole, all), whole.exponent), 0.25, 0.002);
  // A part of it, closed at its rim.
  std::vector<std::uint8_t> part(tube.vertexCount());
  for (std::size_t v = 0; v < part.size(); ++v) part[v] = tube.positions()[v].z() > 5;
  EXPECT_NEAR(std::ldexp(partLength(whole, part), whole.exponent), 0.25, 0.003);
  // Two parts at once, each with a rim of its own.
  for (std::size_t v = 0; v < part.size(); ++v) part[v] = std::abs(tube.positions()[v].z()) > 5;
  EXPECT_NEAR(std::ldexp(partLength(whole, part), whole.exponent), 0.25, 0.003);
  const Mesh ball = test::sphere(64, 48);
  EXPECT_NEAR(std::ldexp(partLength(edit(ball, ball.positions()), std::vector<std::uint8_t>(ball.vertexCount(), 1)),
                         edit(ball, ball.positions()).exponent), 2.0 / 3, 0.003);
}

TEST(VolumePassMask, IsASmoothStepOverTheDistanceToWhatStayed) {
  const Mesh bar = test::bar(80, 8, 0.5);
  std::vector<Vec3> posed = bar.positions();
  for (Vec3& p : posed)
    if (p.z() > 2.05) p.x() += 0.1 * (p.z() - 2);
  const LocalInput input{.rest = bar, .posed = posed};
  const LocalEdit e(input);
  const LocalMask mask = makeMask(e, input, MaskKind::Auto, heldComponents(e, input, MaskKind::Auto));
  std::vector<std::uint8_t> moved(posed.size());
  for (std::size_t v = 0; v < moved.size(); ++v) moved[v] = !e.still[v];
  const double reach = 2 * std::ldexp(partLength(e, moved), e.exponent);
  // The last row that stays: the ring at z = 2, whose upper faces move, has still faces below.
  for (std::size_t v = 0; v < posed.size(); ++v)
    EXPECT_NEAR(mask.value[v], smoothstep((bar.positions()[v].z() - 2) / reach), 1e-9);
}

TEST(VolumePassMask, IsTheFalloffsWeightWhereThereIsOne) {
  const Mesh mesh = tests::makeCapsule({.around = 24, .along = 30});
  std::vector<double> weight;
  std::vector<Vec3> posed;
  for (const Vec3& p : mesh.positions()) {
    weight.push_back(smoothstep((p.z() + 0.3) / 0.6));
    posed.push_back(p + weight.back() * Vec3(0.3, 0, 0));
  }
  const LocalInput input{.rest = mesh, .posed = posed, .weight = weight};
  const LocalEdit e(input);
  const LocalMask mask = makeMask(e, input, MaskKind::Auto, heldComponents(e, input, MaskKind::Auto));
  EXPECT_TRUE(mask.fromFalloff);
  EXPECT_FALSE(mask.free);
  for (std::size_t v = 0; v < posed.size(); ++v) EXPECT_EQ(mask.value[v], weight[v]);
  // A weight of 1 where the object stayed for another reason would make the mask jump there.
  std::vector<double> ones(weight.size(), 1);
  ones[0] = 0.5;
  const LocalInput wrong{.rest = mesh, .posed = posed, .weight = ones};
  EXPECT_FALSE(makeMask(e, wrong, MaskKind::Auto, heldComponents(e, wrong, MaskKind::Auto)).fromFalloff);
}

struct Made {
  LocalParts parts;
  LocalLattice lattice;
  double length = 0;
};
Made make(const Mesh& mesh, const std::vector<Vec3>& posed) {
  const LocalInput input{.rest = mesh, .posed = posed};
  const LocalEdit e(input);
  const auto held = heldComponents(e, input, MaskKind::Auto);
  const LocalMask mask = makeMask(e, input, MaskKind::Auto, held);
  Made m;
  m.parts = makeParts(e, mask, ComponentVolumes(e, held).measure(e.posed));
  m.lattice = makeLattice(m.parts, mask.length, {});
  m.length = mask.length;
  return m;
}
std::vector<Vec3> halfStretched(const Mesh& mesh) {
  std::vector<Vec3> posed = mesh.positions();
  for (Vec3& p : posed) p.z() *= p.z() > 0 ? 1.5 : 1;
  return posed;
}

TEST(VolumePassLattice, HasCubicCellsOf125Lengths) {
  const Mesh mesh = tests::makeCapsule({.length = 4, .around = 48, .along = 60, .bump = 0});
  const Made m = make(mesh, halfStretched(mesh));
  EXPECT_EQ(m.lattice.cell.x(), m.lattice.cell.y());
  EXPECT_EQ(m.lattice.cell.x(), m.lattice.cell.z());
  EXPECT_LE(m.lattice.cell.x(), 1.25 * m.length);
  EXPECT_GT(m.lattice.cell.x(), 1.25 * m.length * (1 - 1.0 / m.lattice.cells[2]));
  EXPECT_LE(m.lattice.active.size(), m.lattice.lattice.nodeCount());
}

TEST(VolumePassLattice, BendingOfLinearMotionsCostsNothing) {
  const Mesh mesh = tests::makeCapsule({.around = 32, .along = 40});
  const Made m = make(mesh, halfStretched(mesh));
  const SparseMatrix k = bendingMatrix(m.lattice);
  EXPECT_EQ(SparseMatrix(k.transpose()).toDense(), k.toDense());
  const auto n = static_cast<Eigen::Index>(m.lattice.active.size());
  Eigen::VectorXd linear(n), square(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Vec3& p = m.lattice.map->restNodes()[static_cast<std::size_t>(i)];
    linear[i] = 1 + p.dot(Vec3(1, -2, 3));
    square[i] = (p.x() * p.x() + p.x() * p.y()) / (m.lattice.cell.x() * m.lattice.cell.x());
  }
  EXPECT_LE(linear.dot(k * linear), 1e-18 * k.norm() * linear.squaredNorm());
  // Second differences of x^2 + xy in cells: 2 along x, 1 mixed, counted twice.
  EXPECT_GT(square.dot(k * square), 0.3 * (4 + 2) * static_cast<double>(n));
  EXPECT_LE(square.dot(k * square), (4 + 2) * static_cast<double>(n));
}

TEST(VolumePassLattice, SurfaceEnergyFromMomentsIsTheMeanSquareDisplacement) {
  const Mesh mesh = tests::makeCapsule({.around = 64, .along = 80});
  const Made m = make(mesh, halfStretched(mesh));
  const SparseMatrix matrix = surfaceMatrix(m.lattice, m.parts);
  const LocalPart& part = m.parts.part[0];
  std::vector<Vec3> nodes(m.lattice.active.size()), moved(part.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const Vec3& p = m.lattice.map->restNodes()[i];
    nodes[i] = Vec3(std::sin(3 * p.z()), p.x() * p.z(), 1 + p.y());
  }
  m.lattice.map->combine(*part.binding, nodes, moved);
  double exact = 0, area = 0;
  for (std::size_t i = 0; i < part.size(); ++i) {
    exact += part.area[i] * moved[i].squaredNorm();
    area += part.mask[i] > 0 ? part.area[i] : 0;
  }
  Eigen::MatrixX3d y(static_cast<Eigen::Index>(nodes.size()), 3);
  for (Eigen::Index i = 0; i < y.rows(); ++i) y.row(i) = nodes[static_cast<std::size_t>(i)].transpose();
  EXPECT_NEAR((y.transpose() * (matrix * y)).trace() / exact, 1, 1e-12);
  EXPECT_NEAR(area, 1, 1e-12);
}

TEST(VolumePassShares, AreAlikeInABendAndLargeWhereAStretchWas) {
  const Mesh mesh = tests::makeCapsule({.around = 32, .along = 60, .bump = 0});
  const Made bent = make(mesh, tests::bendMap(mesh.positions(), 1.5));
  for (const double s : bent.parts.part[0].share) EXPECT_NEAR(s, 1, 0.3);
  const Made stretched = make(mesh, halfStretched(mesh));
  const LocalPart& part = stretched.parts.part[0];
  for (std::size_t i = 0; i < part.size(); ++i) {
    EXPECT_GT(part.share[i], 0);
    EXPECT_LE(part.share[i], 4);
  }
}

}  // namespace
}  // namespace fielddeform::volume::detail
