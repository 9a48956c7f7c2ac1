#include <fielddeform/core/detail/simd.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/volume/cubic_form.h>
#include <fielddeform/volume/detail/wedge_plan.h>
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

TEST(CubicForm, SameBytesInAnyInstructions) {
  const mesh::Mesh ball = tests::makeIcosphere(3);
  for (const Eigen::Index n : {3, 7, 20, 33}) {  // 1 to 9 packs a row, with every rest
    const RowMatrix basis = randomBasis(static_cast<Eigen::Index>(ball.vertexCount()), n);
    const auto nodes = noise(4, static_cast<std::size_t>(n));
    std::vector<std::vector<double>> forms;
    std::vector<std::vector<Vec3>> gradients;
    for (const auto level : {fielddeform::detail::SimdLevel::Baseline, fielddeform::detail::SimdLevel::Avx2, fielddeform::detail::SimdLevel::Avx512}) {
      const fielddeform::detail::SimdLimit limit(level);
      const CubicForm form = CubicForm::ofMesh(basis, ball.triangles());
      forms.push_back(form.unique());
      gradients.emplace_back(nodes.size());
      form.gradient(nodes, gradients.back());
    }
    for (std::size_t k = 1; k < forms.size(); ++k) {
      EXPECT_EQ(forms[k], forms[0]) << n;
      EXPECT_EQ(gradients[k], gradients[0]) << n;
    }
  }
}

TEST(WedgePlan, CountsEveryTriangleOnceInFewProducts) {
  const mesh::Mesh torus = tests::makeTorus(24, 12);
  std::vector<Index> soup = torus.triangles();
  soup.insert(soup.end(), {0, 1, 2, 0, 2, 1, 5, 5, 9});  // no surface at all
  for (const std::vector<Index>& triangles : {torus.triangles(), soup}) {
    const detail::WedgePlan plan(torus.vertexCount(), triangles);
    // Numbers i^1, i^2, i^3 as a basis: determinants of any three rows differ from 0.
    const auto row = [](Index v) { const double t = 0.01 * (v + 1); return Vec3(t, t * t, t * t * t); };
    double sum = 0, expected = 0, size = 0;
    for (std::size_t o = 0; o < plan.owner.size(); ++o)
      for (std::size_t m = plan.start[o]; m < plan.start[o + 1]; ++m) {
        const auto& p = plan.product[m];
        const Vec3 first = p.minus == kNoIndex ? row(p.first) : Vec3(row(p.first) - row(p.minus));
        sum += row(plan.owner[o]).dot(first.cross(row(p.second)));
      }
    for (std::size_t t = 0; t < triangles.size(); t += 3) {
      const double one = row(triangles[t]).dot(row(triangles[t + 1]).cross(row(triangles[t + 2])));
      expected += one, size += std::abs(one);
    }
    EXPECT_NEAR(sum, expected, 1e-12 * size);  // the terms cancel: neighbours are nearly in line
  }
  const detail::WedgePlan plan(torus.vertexCount(), torus.triangles());
  EXPECT_LE(plan.owner.size(), torus.faceCount() / 4);
  EXPECT_LE(plan.product.size(), 6 * torus.faceCount() / 10);
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
