#include <fielddeform/volume/curved_volume.h>
#include <fielddeform/volume/surface_volume.h>
#include <gtest/gtest.h>

#include "tests/support/shapes.h"
#include "tests/support/volume_cases.h"
#include "tests/volume/volume_testing.h"

namespace fielddeform::volume {
namespace {

map::Lattice latticeOf(std::array<int, 3> nodes, const map::LatticeBox& box) {
  map::Lattice lattice;
  lattice.box = box;
  for (std::size_t a = 0; a < 3; ++a) lattice.axis[a] = map::AxisBasis::bernstein(nodes[a]);
  return lattice;
}
std::vector<Vec3> posed(const map::Lattice& lattice, std::uint64_t seed, double amount) {
  return test::added(lattice.restNodes(), test::noise(seed, lattice.nodeCount()), amount);
}

/// The mesh split into four `rounds` times where it is flat, then deformed: its volume goes to the smooth one with h^2.
double subdivided(const map::Lattice& lattice, const std::vector<Vec3>& nodes, std::vector<Vec3> p, std::vector<Index> t, int rounds) {
  for (int r = 0; r < rounds; ++r) {
    std::vector<Index> next;
    for (std::size_t c = 0; c < t.size(); c += 3) {  // midpoints are not shared: the volume does not mind
      const auto first = static_cast<Index>(p.size());
      for (std::size_t k = 0; k < 3; ++k) p.push_back(0.5 * (p[t[c + k]] + p[t[c + (k + 1) % 3]]));
      next.insert(next.end(), {t[c], first, first + 2, first, t[c + 1], first + 1, first + 2, first + 1, t[c + 2], first, first + 1, first + 2});
    }
    t = std::move(next);
  }
  map::Lattice moved = lattice;
  moved.displacements = test::added(nodes, lattice.restNodes(), -1);
  const map::LatticeMap map(moved);
  double sum = 0;
  std::vector<Vec3> x;
  for (const Vec3& q : p) x.push_back(map.position(q));
  for (std::size_t c = 0; c < t.size(); c += 3) sum += x[t[c]].dot(x[t[c + 1]].cross(x[t[c + 2]])) / 6;
  return sum;
}

TEST(CurvedVolume, AgreesWithExtrapolatedSubdivision) {
  const mesh::Mesh ball = tests::makeIcosphere(0);
  map::LatticeBox box{Vec3(-1.1, -1.2, -1.3), Mat3(Vec3(2.2, 2.4, 2.6).asDiagonal())};
  box.axes(0, 1) = 0.2;  // oblique: fits all the same
  box.origin.x() -= 0.1;
  for (const auto& n : {std::array{3, 3, 3}, std::array{5, 2, 2}, std::array{4, 3, 2}}) {
    const map::Lattice lattice = latticeOf(n, box);
    const auto nodes = posed(lattice, 1, 0.25);
    const double form = curvedForm(lattice, ball.positions(), ball.triangles()).value(nodes);
    std::vector<double> v;
    for (int r = 2; r <= 5; ++r) v.push_back(subdivided(lattice, nodes, ball.positions(), ball.triangles(), r));
    // Romberg: the error has even powers of the edge length.
    for (std::size_t order = 1; order < 4; ++order)
      for (std::size_t i = 0; i + order < v.size(); ++i) v[i] = v[i + 1] + (v[i + 1] - v[i]) / (std::pow(4.0, static_cast<double>(order)) - 1);
    EXPECT_NEAR(form / v[0], 1, 1e-9);
  }
}

TEST(CurvedVolume, ManyTrianglesAgreeWithTheMeshInTheLimit) {
  // Larger meshes take few Gauss points; their flat triangles are small. The mesh of deformed vertices comes near with 1/N.
  const mesh::Mesh ball = tests::makeIcosphere(4);
  const map::Lattice lattice = latticeOf({3, 3, 3}, {Vec3(-1.1, -1.1, -1.1), Mat3(2.2 * Mat3::Identity())});
  const auto nodes = posed(lattice, 2, 0.3);
  const double form = curvedForm(lattice, ball.positions(), ball.triangles()).value(nodes);
  const double coarse = subdivided(lattice, nodes, ball.positions(), ball.triangles(), 0), fine = subdivided(lattice, nodes, ball.positions(), ball.triangles(), 1);
  EXPECT_NEAR(form / (fine + (fine - coarse) / 3), 1, 1e-7);  // h^4 is left
}

TEST(CurvedVolume, OfTheWholeCubeIsTheIntegralAndForgetsInnerNodes) {
  const mesh::Mesh box = test::cube();
  const map::Lattice lattice = latticeOf({4, 3, 3}, {});
  const auto nodes = posed(lattice, 3, 0.2);
  const CubicForm form = curvedForm(lattice, box.positions(), box.triangles());
  // Gauss quadrature of det of the map's derivative over the cube: another route to the same number.
  map::Lattice moved = lattice;
  moved.displacements = test::added(nodes, lattice.restNodes(), -1);
  const map::LatticeMap map(moved);
  double sum = 0;
  const double at[] = {0.0254460438286207, 0.1292344072003028, 0.2970774243113014, 0.5, 0.7029225756886985, 0.8707655927996972, 0.9745539561713792};
  const double weight[] = {0.0647424830844348, 0.1398526957446383, 0.1909150252525595, 0.2089795918367347, 0.1909150252525595, 0.1398526957446383, 0.0647424830844348};
  for (int i = 0; i < 7; ++i)
    for (int j = 0; j < 7; ++j)
      for (int k = 0; k < 7; ++k) sum += weight[i] * weight[j] * weight[k] * map.jacobian(Vec3(at[i], at[j], at[k])).determinant();
  EXPECT_NEAR(form.value(nodes), sum, 1e-13);
  std::vector<Vec3> gradient(nodes.size());
  form.gradient(nodes, gradient);
  EXPECT_LT(gradient[lattice.index(1, 1, 1)].norm(), 1e-14);
  EXPECT_LT(gradient[lattice.index(2, 1, 1)].norm(), 1e-14);
  EXPECT_GT(gradient[lattice.index(0, 1, 1)].norm(), 1e-3);
}

TEST(CurvedVolume, ALeftHandedLatticeGivesTheSame) {
  const mesh::Mesh ball = tests::makeIcosphere(1);
  const map::Lattice right = latticeOf({3, 3, 3}, {Vec3(-1, -1, -1), Mat3(2 * Mat3::Identity())});
  map::Lattice left = right;
  left.box.origin.x() = 1, left.box.axes(0, 0) = -2;
  const double volume = curvedForm(right, ball.positions(), ball.triangles()).value(right.restNodes());
  EXPECT_NEAR(volume, SurfaceVolume(ball.positions(), ball.triangles()).value(ball.positions()), 1e-12);
  EXPECT_NEAR(curvedForm(left, ball.positions(), ball.triangles()).value(left.restNodes()), volume, 1e-12);
}

TEST(CurvedVolume, RefusesWhatItCannotDo) {
  const mesh::Mesh ball = tests::makeIcosphere(1);
  map::Lattice lattice = latticeOf({3, 3, 3}, {});
  EXPECT_THROW(curvedForm(lattice, ball.positions(), ball.triangles()), std::invalid_argument);  // outside
  lattice.box = {Vec3(-2, -2, -2), Mat3(4 * Mat3::Identity())};
  lattice.axis[1] = map::AxisBasis::bspline(6, 3, map::Border::Free);
  EXPECT_THROW(curvedForm(lattice, ball.positions(), ball.triangles()), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::volume
