#include <gtest/gtest.h>
#include <tests/solid/solids.h>

#include <stdexcept>

#include <fielddeform/solid/regularity.h>

namespace fielddeform::solid {
namespace {

TEST(Solid, EvaluatesTheTensorBezier) {
  for (const std::array<int, 3> degree : {std::array{1, 1, 1}, std::array{3, 2, 4}, std::array{12, 1, 5}}) {
    const LooseSolid loose = test::boxSolid("s", degree, Vec3(1, 2, 3), Vec3(2, 1, 3), .2);
    const Object object = makeObject({loose}, {});
    for (std::uint64_t k = 0; k < 20; ++k) {
      const Vec3 u = .5 * (test::randomPoint(4, k) + Vec3::Ones());
      EXPECT_LT((evaluate(object, 0, u) - test::slowPoint(loose, u)).norm(), 1e-13);
    }
  }
}

TEST(Solid, DerivativesAreThoseByCentralDifferencesAlsoBeyondTheCube) {
  const Object object = test::boxObject({3, 2, 4}, .2);
  const double h = 1e-5;
  for (std::uint64_t k = 0; k < 20; ++k) {
    const Vec3 u = Vec3::Constant(.5) + .8 * test::randomPoint(5, k);
    const Mat3 d = derivative(object, 0, u);
    for (int c = 0; c < 3; ++c) {
      const Vec3 e = h * Vec3::Unit(c);
      EXPECT_LT((d.col(c) - (evaluate(object, 0, u + e) - evaluate(object, 0, u - e)) / (2 * h)).norm(), 1e-8);  // h^2 and rounding / h
    }
  }
}

TEST(Solid, ElevationKeepsTheSolid) {
  LooseSolid loose = test::boxSolid("s", {2, 3, 1}, Vec3::Zero(), Vec3::Ones(), .3);
  const LooseSolid before = loose;
  for (const std::size_t axis : {0, 1, 2, 2, 0}) loose = elevated(loose, axis);
  EXPECT_EQ(loose.degree, (std::array{4, 4, 3}));
  for (std::uint64_t k = 0; k < 20; ++k) {
    const Vec3 u = .5 * (test::randomPoint(6, k) + Vec3::Ones());
    EXPECT_LT((test::slowPoint(loose, u) - test::slowPoint(before, u)).norm(), 1e-14);
  }
}

TEST(Solid, CoonsReproducesTrilinearNetsAndFacesOfBlends) {
  // A net that is trilinear in i, j, k comes back from its boundary.
  Object object = test::boxObject({4, 3, 5});
  for (Vec3& p : object.points) p = Vec3(p.x() + p.y() * p.z(), p.y() - 2 * p.x() * p.z(), p.z() + p.x() * p.y() * p.z());
  const std::vector<Vec3> before = object.points;
  for (const auto& at : innerPoints({4, 3, 5})) object.points[object.solids[0].points[object.solids[0].slot(at[0], at[1], at[2])]] = Vec3(9, 9, 9);
  fillInner(object);
  for (std::size_t i = 0; i < before.size(); ++i) EXPECT_LT((object.points[i] - before[i]).norm(), 1e-14);
  double sum = 0;
  for (const auto& [slot, w] : coonsWeights({4, 3, 5}, {1, 2, 3})) sum += w;
  EXPECT_NEAR(sum, 1, 1e-15);
  EXPECT_THROW(coonsWeights({4, 3, 5}, {0, 1, 1}), std::invalid_argument);
}

TEST(Object, JoinsFacesInAllEightWays) {
  // A second solid on the face u1, its axes turned: every signed permutation that keeps a face there.
  const LooseSolid a = test::boxSolid("a", {2, 3, 2}, Vec3::Zero(), Vec3::Ones(), 0);
  for (int way = 0; way < 8; ++way) {
    const bool swapped = way & 4;
    LooseSolid b{"b", swapped ? std::array{2, 2, 3} : std::array{2, 3, 2}, {}};
    for (int k = 0; k <= b.degree[2]; ++k)
      for (int j = 0; j <= b.degree[1]; ++j)
        for (int i = 0; i <= b.degree[0]; ++i) {
          double y = static_cast<double>(j) / b.degree[1], z = static_cast<double>(k) / b.degree[2];
          if (way & 1) y = 1 - y;
          if (way & 2) z = 1 - z;
          b.points.emplace_back(1 + i / 2.0, swapped ? z : y, swapped ? y : z);
        }
    const Object object = makeObject({a, b}, {{{0, Side::U1}, {1, Side::U0}, 1, 1}});
    EXPECT_EQ(object.points.size(), 2 * a.points.size() - 12);
    const auto match = matching(object, object.joints[0]);
    EXPECT_EQ(match.size(), 12u);
  }
}

TEST(Object, NamesWhatDoesNotFit) {
  const LooseSolid a = test::boxSolid("a", {2, 2, 2}), b = test::boxSolid("b", {2, 2, 2}, Vec3(1.1, 0, 0)), c = test::boxSolid("c", {2, 3, 2}, Vec3(1, 0, 0));
  const auto refusal = [](const std::vector<LooseSolid>& solids, std::vector<Joint> joints) -> std::string {
    try {
      makeObject(solids, std::move(joints));
    } catch (const std::invalid_argument& problem) {
      return problem.what();
    }
    return "";
  };
  EXPECT_NE(refusal({a, b}, {{{0, Side::U1}, {1, Side::U0}, 1, 1}}).find("a.u1 - b.u0: the control points of the faces do not coincide (off by 0.1)"), std::string::npos);
  EXPECT_NE(refusal({a, c}, {{{0, Side::U1}, {1, Side::U0}, 1, 1}}).find("degrees differ"), std::string::npos);
  EXPECT_NE(refusal({a, a}, {}).find("two are named \"a\""), std::string::npos);
  EXPECT_NE(refusal({a}, {{{0, Side::U1}, {1, Side::U0}, 1, 1}}).find("out of range"), std::string::npos);
  EXPECT_NE(refusal({a}, {{{0, Side::U1}, {0, Side::U1}, 1, 1}}).find("with itself"), std::string::npos);
  EXPECT_NE(refusal({a}, {{{0, Side::U1}, {0, Side::U0}, 3, 1}}).find("continuity 3"), std::string::npos);
  EXPECT_NE(refusal({}, {}).find("none"), std::string::npos);
}

TEST(Regularity, ProvesWhatIsPositiveAndFindsFolds) {
  EXPECT_EQ(checkRegular(test::boxObject({3, 3, 3}), 0).orientation, Orientation::Positive);
  const Object shaken = test::boxObject({3, 2, 3}, .05);
  const Regularity good = checkRegular(shaken, 0);
  EXPECT_EQ(good.orientation, Orientation::Positive);
  EXPECT_NEAR(good.mean, test::overCube(6, [&](const Vec3& u) { return derivative(shaken, 0, u).determinant(); }), 1e-13);
  // One corner pushed through the opposite one.
  Object folded = test::boxObject({2, 2, 2});
  folded.points[0] = Vec3(1.2, 1.2, 1.2);
  const Regularity bad = checkRegular(folded, 0);
  EXPECT_EQ(bad.orientation, Orientation::Folded);
  EXPECT_LT(derivative(folded, 0, bad.at).determinant(), 0);
  EXPECT_NEAR(derivative(folded, 0, bad.at).determinant(), bad.least, 1e-12);
  // A fold inside alone: the middle of a face pulled through.
  Object dent = test::boxObject({4, 4, 4});
  for (int j = 1; j < 4; ++j)
    for (int i = 1; i < 4; ++i) dent.points[dent.solids[0].slot(i, j, 4)] -= Vec3(0, 0, 2.5);
  const Regularity inner = checkRegular(dent, 0);
  EXPECT_EQ(inner.orientation, Orientation::Folded);
  EXPECT_LT(derivative(dent, 0, inner.at).determinant(), 0);
  // A collapsed edge is no fold.
  Object wedge = test::boxObject({1, 1, 1});
  wedge.points[5] = wedge.points[4], wedge.points[7] = wedge.points[6];
  EXPECT_EQ(checkRegular(wedge, 0).orientation, Orientation::Positive);
}

}  // namespace
}  // namespace fielddeform::solid
