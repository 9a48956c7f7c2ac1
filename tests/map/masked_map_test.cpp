#include <fielddeform/map/lattice.h>
#include <fielddeform/map/masked_map.h>
#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "lattices.h"

namespace fielddeform::map {
namespace {

using test::cloud;

std::shared_ptr<const LatticeMap> bspline(std::uint64_t seed) {
  Lattice lattice;
  lattice.box = test::skewBox();
  for (AxisBasis& axis : lattice.axis) axis = AxisBasis::bspline(6, 3, Border::Free);
  return std::make_shared<const LatticeMap>(test::shaken(lattice, seed, 0.3));
}

std::vector<double> masks(std::size_t n) {
  std::vector<double> m(n);
  for (std::size_t i = 0; i < n; ++i) m[i] = i % 3 == 0 ? 0 : i % 3 == 1 ? 1 : uniform01(7, i);
  return m;
}

std::vector<Vec3> positions(const SpaceMap& map, const Binding& binding) {
  std::vector<Vec3> out(binding.size());
  Progress silent;
  map.apply(binding, {.position = out, .safe = {}, .status = {}, .residual = {}}, silent);
  return out;
}

TEST(MaskedMap, ScalesTheOtherMapsDisplacementAndKeepsTheBitsOfMaskZero) {
  const auto lattice = bspline(1);
  const auto points = cloud(2, 300);
  const auto mask = masks(points.size());
  const MaskedMap map(lattice);
  const auto out = positions(map, *map.bind(points, mask));
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (mask[i] == 0) EXPECT_EQ(out[i], points[i]);
    else EXPECT_LE((out[i] - points[i] - mask[i] * (lattice->position(points[i]) - points[i])).norm(), 1e-14);
  }
}

TEST(MaskedMap, GatherIsTheTransposeOfCombineAndBasisIsTheirMatrix) {
  const MaskedMap map(bspline(3), {5, 7, 40, 41, 100, 101, 102, 215});
  const auto points = cloud(4, 200), nodes = cloud(5, map.nodeCount()), values = cloud(6, points.size());
  const auto binding = map.bind(points, masks(points.size()));
  std::vector<Vec3> forward(points.size()), backward(map.nodeCount());
  map.combine(*binding, nodes, forward);
  map.gather(*binding, values, backward);
  double a = 0, b = 0;
  for (std::size_t i = 0; i < points.size(); ++i) a += forward[i].dot(values[i]);
  for (std::size_t i = 0; i < nodes.size(); ++i) b += backward[i].dot(nodes[i]);
  EXPECT_NEAR(a, b, 1e-13);  // sums of 200 numbers below 1
  const SparseRows basis = map.basis(*binding);
  ASSERT_EQ(basis.rows(), points.size());
  EXPECT_EQ(basis.columns, nodes.size());
  for (std::size_t r = 0; r < basis.rows(); ++r) {
    Vec3 sum = Vec3::Zero();
    for (std::size_t k = basis.start[r]; k < basis.start[r + 1]; ++k) sum += basis.value[k] * nodes[basis.column[k]];
    EXPECT_LE((sum - forward[r]).norm(), 1e-14);
  }
}

TEST(MaskedMap, NodesLeftOutStayUndisplaced) {
  const auto lattice = bspline(8);
  const MaskedMap map(lattice, {0, 50, 99});
  Lattice few = lattice->lattice();
  for (Index i = 0; i < few.displacements.size(); ++i)
    if (i != 0 && i != 50 && i != 99) few.displacements[i].setZero();
  const LatticeMap expected(few);
  const auto points = cloud(9, 100);
  const auto out = positions(map, *map.bind(points));
  for (std::size_t i = 0; i < points.size(); ++i) EXPECT_LE((out[i] - expected.position(points[i])).norm(), 1e-14);
}

TEST(MaskedMap, OtherDisplacementsServeTheSameBinding) {
  const MaskedMap map(bspline(10), {3, 4, 60});
  const auto points = cloud(11, 50), nodes = cloud(12, 3);
  const auto binding = map.bind(points, masks(points.size()));
  const auto other = map.withDisplacements(nodes);
  std::vector<Vec3> moved(points.size());
  map.combine(*binding, nodes, moved);
  const auto out = positions(*other, *binding);
  for (std::size_t i = 0; i < points.size(); ++i) EXPECT_EQ(out[i], points[i] + moved[i]);
}

TEST(MaskedMap, JacobianIsTheOtherMapsHeldBack) {
  const auto lattice = bspline(13);
  const MaskedMap map(lattice);
  const auto points = cloud(14, 30);
  const auto mask = masks(points.size());
  std::vector<Mat3> out(points.size());
  map.jacobians(*map.bind(points, mask), out);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Mat3 expected = Mat3::Identity() + mask[i] * (lattice->jacobian(points[i]) - Mat3::Identity());
    EXPECT_LE((out[i] - expected).norm(), 1e-13);
  }
}

TEST(MaskedMap, PointsThatAreNotFiniteComeBackInvalid) {
  const MaskedMap map(bspline(15));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<Vec3> points{{0, 0, 0}, {nan, 0, 0}};
  const auto binding = map.bind(points);
  std::vector<Status> status(2);
  Progress silent;
  map.apply(*binding, {.position = {}, .safe = {}, .status = status, .residual = {}}, silent);
  EXPECT_EQ(status[0], Status::Converged);
  EXPECT_EQ(status[1], Status::Invalid);
}

TEST(MaskedMap, RefusesWrongArguments) {
  const auto lattice = bspline(16);
  EXPECT_THROW(MaskedMap(nullptr), std::invalid_argument);
  EXPECT_THROW(MaskedMap(lattice, {3, 3}), std::invalid_argument);
  EXPECT_THROW(MaskedMap(lattice, {216}), std::invalid_argument);
  const MaskedMap map(lattice), other(lattice);
  const auto points = cloud(17, 2);
  EXPECT_THROW(map.bind(points, std::vector<double>{1}), std::invalid_argument);
  EXPECT_THROW(map.bind(points, std::vector<double>{1, std::numeric_limits<double>::infinity()}), std::invalid_argument);
  std::vector<Vec3> out(2);
  EXPECT_THROW(map.combine(*other.bind(points), other.displacements(), out), std::invalid_argument);
}

// Inside, beyond the box, and one that is no point.
TEST(MaskedMap, AViewOfPointsGivesTheBitsOfABinding) {
  std::vector<Vec3> points = cloud(11, 20'000);
  for (std::size_t i = 0; i < points.size(); i += 5) points[i] *= 4;
  points[1000].x() = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> mask = masks(points.size());
  mask[1000] = 0;
  // Spans, one cell, and so many nodes that gather() cuts them into slabs.
  for (const AxisBasis& axis : {AxisBasis::bspline(6, 3, Border::Free), AxisBasis::bernstein(4), AxisBasis::bspline(53, 3, Border::Free)}) {
    Lattice lattice;
    lattice.box = test::skewBox();
    lattice.axis = {axis, axis, axis};
    const auto inner = std::make_shared<const LatticeMap>(test::shaken(lattice, 12, 0.1));
    const MaskedMap map(inner);
    const auto bound = map.bind(points, mask), view = map.bindView(points, mask);
    ASSERT_EQ(view->size(), points.size());
    const auto same = [](const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
      return std::memcmp(a.data(), b.data(), a.size() * sizeof(Vec3)) == 0;
    };
    const auto nodes = cloud(13, map.nodeCount()), values = cloud(14, points.size());
    std::vector<Vec3> a(points.size()), b(points.size()), c(map.nodeCount()), d(map.nodeCount());
    map.combine(*bound, nodes, a), map.combine(*view, nodes, b);
    EXPECT_TRUE(same(a, b));
    map.gather(*bound, values, c), map.gather(*view, values, d);
    EXPECT_TRUE(same(c, d));
    EXPECT_TRUE(same(positions(map, *bound), positions(map, *view)));
    const std::vector<Index> some{3, 999, 1000, 1001, 19'999};
    EXPECT_EQ(map.basisAt(*bound, some).value, map.basisAt(*view, some).value);
    EXPECT_TRUE(same(positions(*inner, *inner->bind(points)), positions(*inner, *inner->bindView(points))));
  }
}

}  // namespace
}  // namespace fielddeform::map
