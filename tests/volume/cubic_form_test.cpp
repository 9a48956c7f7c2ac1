#include <fielddeform/core/parallel.h>
#include <fielddeform/volume/cubic_form.h>
#include <fielddeform/volume/surface_volume.h>
#include <gtest/gtest.h>

#include "tests/support/volume_cases.h"
#include "tests/volume/volume_testing.h"

namespace fielddeform::volume {
namespace {

using test::added, test::noise;
using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Any basis: the form knows nothing of lattices.
RowMatrix randomBasis(Eigen::Index vertices, Eigen::Index nodes) {
  RowMatrix out(vertices, nodes);
  for (Eigen::Index v = 0; v < vertices; ++v)
    for (Eigen::Index i = 0; i < nodes; ++i) out(v, i) = uniform01(77, static_cast<std::uint64_t>(v * nodes + i)) - 0.5;
  return out;
}
std::vector<Vec3> pointsOf(const RowMatrix& basis, const std::vector<Vec3>& nodes) {
  std::vector<Vec3> out(static_cast<std::size_t>(basis.rows()), Vec3::Zero());
  for (std::size_t v = 0; v < out.size(); ++v)
    for (std::size_t i = 0; i < nodes.size(); ++i) out[v] += basis(static_cast<Eigen::Index>(v), static_cast<Eigen::Index>(i)) * nodes[i];
  return out;
}

TEST(CubicForm, IsTheMeshsVolumeForAnyNodes) {
  const mesh::Mesh ball = tests::makeIcosphere(2);
  for (const std::size_t n : {std::size_t{3}, std::size_t{5}, std::size_t{20}, std::size_t{27}}) {
    const RowMatrix basis = randomBasis(static_cast<Eigen::Index>(ball.vertexCount()), static_cast<Eigen::Index>(n));
    const auto triangles = ball.triangles();
    const CubicForm form = CubicForm::ofMesh(basis, triangles);
    const auto nodes = noise(n, n);
    const auto x = pointsOf(basis, nodes);
    const double expected = SurfaceVolume(x, triangles).value(x);
    EXPECT_NEAR(form.value(nodes), expected, 1e-12 * (1 + std::abs(expected))) << n;
  }
}

TEST(CubicForm, IsAntisymmetricAndKeepsItsNumbers) {
  const mesh::Mesh ball = tests::makeIcosphere(1);
  const CubicForm form = CubicForm::ofMesh(randomBasis(static_cast<Eigen::Index>(ball.vertexCount()), 6), ball.triangles());
  EXPECT_EQ(form.unique().size(), 20u);
  EXPECT_EQ(form.coefficient(1, 2, 4), -form.coefficient(2, 1, 4));
  EXPECT_EQ(form.coefficient(1, 2, 4), form.coefficient(2, 4, 1));
  EXPECT_EQ(form.coefficient(3, 3, 4), 0);
  EXPECT_EQ(CubicForm(6, form.unique()).unique(), form.unique());
  EXPECT_THROW(CubicForm(6, {1, 2}), std::invalid_argument);
  EXPECT_THROW(CubicForm(2, {}), std::invalid_argument);
}

TEST(CubicForm, DerivativesAgreeWithCentralDifferences) {
  const mesh::Mesh ball = tests::makeIcosphere(1);
  const std::size_t n = 10;
  const CubicForm form = CubicForm::ofMesh(randomBasis(static_cast<Eigen::Index>(ball.vertexCount()), static_cast<Eigen::Index>(n)), ball.triangles());
  const auto x = noise(1, n), p = noise(2, n);
  std::vector<Vec3> g(n), plus(n), minus(n);
  form.gradient(x, g);
  const double h = 1e-4;  // exact for a cubic up to h^2 times its third derivative
  EXPECT_NEAR(test::dot(g, p), (form.value(added(x, p, h)) - form.value(added(x, p, -h))) / (2 * h), 1e-7);
  form.gradient(added(x, p, h), plus);
  form.gradient(added(x, p, -h), minus);
  std::vector<Index> rows{0, 1, 2, kNoIndex, 3, 4, 5, 6, 7, 8};
  Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(27, 27);
  form.addHessian(x, 2, rows, hessian);
  EXPECT_LT((hessian - hessian.transpose()).norm(), 1e-15);
  Eigen::VectorXd q = Eigen::VectorXd::Zero(27);
  for (std::size_t i = 0; i < n; ++i)
    if (rows[i] != kNoIndex) q.segment<3>(3 * rows[i]) = p[i];
  auto held = p;
  held[3].setZero();
  form.gradient(added(x, held, h), plus);
  form.gradient(added(x, held, -h), minus);
  const Eigen::VectorXd hq = hessian * q;
  for (std::size_t i = 0; i < n; ++i)
    if (rows[i] != kNoIndex) { EXPECT_LT((hq.segment<3>(3 * rows[i]) - 2 * (plus[i] - minus[i]) / (2 * h)).norm(), 1e-8); }
}

TEST(CubicForm, SameBitsOnAnyNumberOfThreads) {
  const mesh::Mesh ball = tests::makeIcosphere(5);
  const RowMatrix basis = randomBasis(static_cast<Eigen::Index>(ball.vertexCount()), 9);
  std::vector<std::vector<double>> forms;
  for (const int threads : {1, 2, 7}) {
    const ThreadLimit limit(threads);
    forms.push_back(CubicForm::ofMesh(basis, ball.triangles()).unique());
  }
  EXPECT_EQ(forms[0], forms[1]);
  EXPECT_EQ(forms[0], forms[2]);
}

}  // namespace
}  // namespace fielddeform::volume
