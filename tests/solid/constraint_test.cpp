#include <fielddeform/core/error.h>
#include <fielddeform/solid/constraint.h>
#include <gtest/gtest.h>
#include <tests/solid/solids.h>

namespace fielddeform::solid {
namespace {

const PointRef kCorner{0, std::array{0, 0, 0}}, kOther{0, std::array{1, 0, 0}}, kMiddle{0, Vec3(.5, .5, .5)};

std::string refusal(const RowSpace& space, const std::vector<Row>& rows) {
  try {
    space.solve(rows, valuesOf(rows), 1);
  } catch (const InfeasibleError& problem) {
    return problem.what();
  }
  return "";
}

TEST(Constraints, ContinuityRowsHoldExactlyForOneSolidCutInTwo) {
  // A solid and its other half by evaluating: both halves of one polynomial are C^k for all k, and rows of another ratio are not met.
  const LooseSolid whole = test::boxSolid("w", {3, 2, 3}, Vec3::Zero(), Vec3::Ones(), .2);
  const auto part = [&](double from, double to, const char* name) {
    // Control points of F(from + (to - from) u) by blossoming along u: repeated de Casteljau with different parameters.
    LooseSolid out = whole;
    out.name = name;
    for (int k = 0; k <= 3; ++k)
      for (int j = 0; j <= 2; ++j)
        for (int i = 0; i <= 3; ++i) {
          std::vector<Vec3> r;
          for (int a = 0; a <= 3; ++a) r.push_back(whole.points[static_cast<std::size_t>(a + 4 * (j + 3 * k))]);
          for (int step = 0; step < 3; ++step) {
            const double t = step < i ? to : from;
            for (int a = 0; a + step < 3; ++a) r[static_cast<std::size_t>(a)] = (1 - t) * r[static_cast<std::size_t>(a)] + t * r[static_cast<std::size_t>(a + 1)];
          }
          out.points[static_cast<std::size_t>(i + 4 * (j + 3 * k))] = r[0];
        }
    return out;
  };
  for (const double cut : {.5, .25}) {
    const double ratio = (1 - cut) / cut;
    Object object = makeObject({part(0, cut, "a"), part(cut, 1, "b")}, {{{0, Side::U1}, {1, Side::U0}, 3, ratio}});
    const std::vector<Row> rows = continuity(object, object.joints[0]);
    EXPECT_EQ(rows.size(), 3u * 12);
    EXPECT_LT(residualsOf(rows, object.points).cwiseAbs().maxCoeff(), 1e-12 * 6 * ratio * ratio * ratio + 1e-12);
    object.joints[0].ratio = 1.5 * ratio;
    EXPECT_GT(residualsOf(continuity(object, object.joints[0]), object.points).cwiseAbs().maxCoeff(), .1);
  }
}

TEST(Constraints, ContinuityKnowsFacesThatRunAgainstEachOther) {
  // b is the mirror image in its own parameter: both faces are starts.
  const LooseSolid a = test::boxSolid("a", {2, 2, 2}, Vec3(-1, 0, 0)), b = test::boxSolid("b", {2, 2, 2});
  LooseSolid mirrored = a;
  for (std::size_t s = 0; s < a.points.size(); ++s) mirrored.points[s] = a.points[s - s % 3 + (2 - s % 3)];
  const Object object = makeObject({mirrored, b}, {{{0, Side::U0}, {1, Side::U0}, 2, 1}});
  EXPECT_LT(residualsOf(continuity(object, object.joints[0]), object.points).cwiseAbs().maxCoeff(), 1e-15);
}

TEST(Constraints, RedundantRowsAreFoundByRankAndContradictingOnesNamed) {
  const Object object = test::boxObject({2, 2, 2});
  std::vector<Row> rows{fixedPoint(object, kCorner, Vec3(0, 0, 0)), fixedPoint(object, kOther, Vec3(1, 0, 0)),
                        fixedDifference(object, kCorner, kOther, Vec3(1, 0, 0)), fixedPoint(object, kMiddle, Vec3(.5, .5, .5))};
  const RowSpace space(rows, object.points.size());
  EXPECT_EQ(space.rank(), 3);
  EXPECT_EQ(space.redundant(), std::vector<std::size_t>{2});
  EXPECT_EQ(refusal(space, rows), "");
  rows[2].value.x() = 1.5;
  EXPECT_EQ(refusal(space, rows), "the constraint \"difference box[0,0,0] - box[1,0,0]\" contradicts \"fixed box[0,0,0]\", \"fixed box[1,0,0]\" (off by 0.5)");
  // A row without terms: trivial, or impossible.
  std::vector<Row> nothing{attached(object, kCorner, kCorner)};
  EXPECT_EQ(refusal(RowSpace(nothing, object.points.size()), nothing), "");
  nothing[0].value.y() = 1;
  EXPECT_NE(refusal(RowSpace(nothing, object.points.size()), nothing).find("contradicts itself"), std::string::npos);
  // The rows' solution satisfies them.
  const Eigen::MatrixXd y = space.solve({rows[0], rows[1], rows[2], rows[3]}, [&] {
    auto good = rows;
    good[2].value.x() = 1;
    return valuesOf(good);
  }(), 1);
  const Eigen::MatrixXd p = space.basis().transpose() * y;
  std::vector<Vec3> points;
  for (Eigen::Index i = 0; i < p.rows(); ++i) points.push_back(p.row(i).transpose());
  rows[2].value.x() = 1;
  EXPECT_LT(residualsOf(rows, points).cwiseAbs().maxCoeff(), 1e-14);
}

TEST(Constraints, SurfacePointsAreCombinations) {
  const Object object = test::row();
  const PointRef shared{1, Vec3(0, .3, .6)};
  double sum = 0;
  Vec3 at = Vec3::Zero();
  for (const auto& [i, w] : combination(object, shared)) sum += w, at += w * object.points[i];
  EXPECT_NEAR(sum, 1, 1e-14);
  EXPECT_LT((at - Vec3(1, .3, .6)).norm(), 1e-14);
  EXPECT_THROW(combination(object, {1, Vec3(0, 1.3, 0)}), std::invalid_argument);
  EXPECT_THROW(combination(object, {0, std::array{4, 0, 0}}), std::invalid_argument);
  EXPECT_EQ(fixedSide(object, {2, Side::W1}, object.points).size(), 16u);
  EXPECT_EQ(coonsInside(object).size(), 24u);
}

}  // namespace
}  // namespace fielddeform::solid
