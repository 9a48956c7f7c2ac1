#include <fielddeform/solid/objective.h>
#include <fielddeform/solid/size.h>
#include <fielddeform/volume/curved_volume.h>
#include <gtest/gtest.h>
#include <tests/solid/solids.h>
#include <tests/support/shapes.h>

#include <stdexcept>

namespace fielddeform::solid {
namespace {

TEST(Size, IsTheIntegralOfTheJacobian) {
  for (const std::array<int, 3> degree : {std::array{1, 1, 1}, std::array{2, 2, 2}, std::array{3, 3, 3}, std::array{3, 1, 5}, std::array{7, 2, 1}}) {
    const Object object = test::boxObject(degree, .3);
    const double exact = test::overCube(12, [&](const Vec3& u) { return derivative(object, 0, u).determinant(); });  // degree 20 < 24
    EXPECT_NEAR(Sizes(object).value(0, object.points), exact, 2e-13) << degree[0];
  }
}

TEST(Size, IsTheLatticesFormWithTheCubeAsOmega) {
  const Object object = test::boxObject({3, 2, 3}, .2);
  map::Lattice lattice;
  lattice.axis = {map::AxisBasis::bernstein(4), map::AxisBasis::bernstein(3), map::AxisBasis::bernstein(4)};
  const mesh::Mesh cube = test::cube();
  const volume::CubicForm form = volume::curvedForm(lattice, cube.positions(), cube.triangles());
  EXPECT_NEAR(Sizes(object).value(0, object.points), form.value(object.pointsOf(0)), 1e-13);
  // Its coefficients vanish unless three points share a side.
  const Solid& s = object.solids[0];
  EXPECT_NEAR(form.coefficient(s.slot(0, 0, 0), s.slot(3, 1, 1), s.slot(1, 2, 3)), 0, 1e-15);
  EXPECT_NEAR(form.coefficient(s.slot(1, 1, 1), s.slot(0, 1, 1), s.slot(0, 2, 1)), 0, 1e-15);
  EXPECT_GT(std::abs(form.coefficient(s.slot(0, 0, 0), s.slot(0, 1, 1), s.slot(0, 2, 1))), 1e-5);
}

TEST(Size, OfABoxIsItsVolumeFarFromTheOrigin) {
  Object object = test::boxObject({3, 3, 2});
  for (Vec3& p : object.points) p = Vec3(2 * p.x(), 3 * p.y(), 5 * p.z()) + Vec3(1e4, -2e4, 3e4);
  EXPECT_NEAR(Sizes(object).value(0, object.points), 30, 1e-9);  // coordinates of 3e4 carry 4e-12
}

TEST(Size, DerivativesAreThoseByCentralDifferencesAndInnerPointsHaveNone) {
  const Object object = test::row();
  std::vector<Vec3> x = object.points;
  for (std::size_t i = 0; i < x.size(); ++i) x[i] += .1 * test::randomPoint(3, i);
  const Sizes sizes(object);
  std::vector<Vec3> g(x.size(), Vec3::Zero());
  EXPECT_NEAR(sizes.addGradient(1, x, 1, g), sizes.value(1, x), 1e-14);
  const double h = 1e-4;
  for (std::size_t i = 0; i < x.size(); i += 7)
    for (int c = 0; c < 3; ++c) {
      std::vector<Vec3> a = x, b = x;
      a[i][c] += h, b[i][c] -= h;
      EXPECT_NEAR(g[i][c], (sizes.value(1, a) - sizes.value(1, b)) / (2 * h), 1e-10);  // linear in each coordinate: rounding / h
    }
  for (const auto& at : innerPoints({3, 3, 3})) EXPECT_EQ(g[object.solids[1].points[object.solids[1].slot(at[0], at[1], at[2])]], Vec3(Vec3::Zero()));
  // Second derivatives: both ways, and against differences of gradients.
  const std::vector<Vec3> p = test::cloud(9, x.size());
  std::vector<Vec3> hp(x.size(), Vec3::Zero()), plus(x.size(), Vec3::Zero()), minus(x.size(), Vec3::Zero()), a = x, b = x;
  sizes.addHessianTimes(1, x, 2, p, hp);
  const auto n = static_cast<Eigen::Index>(x.size());
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(3 * n, 3 * n);
  sizes.addHessian(1, x, 2, dense);
  const Eigen::VectorXd product = dense * Eigen::Map<const Eigen::VectorXd>(p[0].data(), 3 * n);
  for (std::size_t i = 0; i < x.size(); ++i) a[i] += h * p[i], b[i] -= h * p[i];
  sizes.addGradient(1, a, 1, plus);
  sizes.addGradient(1, b, 1, minus);
  for (std::size_t i = 0; i < x.size(); ++i) {
    EXPECT_LT((hp[i] - product.segment<3>(3 * static_cast<Eigen::Index>(i))).norm(), 1e-13);
    EXPECT_LT((hp[i] - (plus[i] - minus[i]) / h).norm(), 1e-10);
  }
}

TEST(Objective, IsTheIntegralOfItsTerms) {
  const std::array<int, 3> degree{3, 2, 4};
  const Object object = test::boxObject(degree, .4);
  const std::vector<Vec3> p = object.pointsOf(0);
  const auto quadratic = [&](const Objective& o) {
    const Eigen::MatrixXd e = energyMatrix(degree, o);
    double sum = 0;
    for (Eigen::Index i = 0; i < e.rows(); ++i)
      for (Eigen::Index j = 0; j < e.cols(); ++j) sum += e(i, j) * p[static_cast<std::size_t>(i)].dot(p[static_cast<std::size_t>(j)]);
    return sum;
  };
  const double h = 1e-3;
  EXPECT_NEAR(quadratic({0, 1, 0, 0}), test::overCube(6, [&](const Vec3& u) { return derivative(degree, p, u).squaredNorm(); }), 1e-12);
  // Second derivatives by differences of first ones; inside the cube, so that nothing is extended.
  const auto second = [&](const Vec3& u, int a, int b) {
    const Vec3 e = h * Vec3::Unit(b);
    return Vec3((derivative(degree, p, u + e).col(a) - derivative(degree, p, u - e).col(a)) / (2 * h));
  };
  EXPECT_NEAR(quadratic({0, 0, 1, 0}), test::overCube(6, [&](const Vec3& u) { return second(u, 0, 1).squaredNorm() + second(u, 0, 2).squaredNorm() + second(u, 1, 2).squaredNorm(); }), 1e-3);
  EXPECT_NEAR(quadratic({0, 0, 0, 1}), test::overCube(6, [&](const Vec3& u) { return second(u, 0, 0).squaredNorm() + second(u, 1, 1).squaredNorm() + second(u, 2, 2).squaredNorm(); }), 1e-2);
  // Symmetric, positive semidefinite, blind to translations; bend vanishes for degree 1.
  const Eigen::MatrixXd e = energyMatrix(degree, {});
  EXPECT_LT((e - e.transpose()).cwiseAbs().maxCoeff(), 1e-13);
  EXPECT_LT((e * Eigen::VectorXd::Ones(e.rows())).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT(energyMatrix({1, 1, 1}, {0, 0, 0, 1}).cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_THROW((Objective{0, 0, 0, 0}.validate()), std::invalid_argument);
  EXPECT_THROW((Objective{-1, 1, 0, 0}.validate()), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::solid
