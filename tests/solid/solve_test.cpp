#include <fielddeform/core/error.h>
#include <fielddeform/solid/regularity.h>
#include <fielddeform/solid/size.h>
#include <fielddeform/solid/solve.h>
#include <gtest/gtest.h>
#include <tests/solid/solids.h>

#include <cmath>

namespace fielddeform::solid {
namespace {

Result solved(const Problem& problem, const Options& options = {}) {
  Progress silent;
  return solve(problem, options, silent);
}

/// Points of a side moved along an axis.
void moveSide(Problem& p, const FaceRef& side, const Vec3& by) {
  if (p.wanted.empty()) p.wanted = p.object.points;
  const Solid& s = p.object.solids[side.solid];
  for (const std::size_t slot : layerOf(s, side.side).slots) p.wanted[s.points[slot]] += by;
}
void append(std::vector<Row>& rows, std::vector<Row> more) { rows.insert(rows.end(), more.begin(), more.end()); }

/// The telephone's problem: three cubes in a row, the middle one stretched, the ends' outer sides fixed.
Problem stretched(double by, const Objective& objective = {}) {
  Problem p;
  p.object = test::row();
  p.objective = objective;
  moveSide(p, {2, Side::U1}, Vec3(by, 0, 0));
  append(p.rows, fixedSide(p.object, {0, Side::U0}, p.wanted));
  append(p.rows, fixedSide(p.object, {2, Side::U1}, p.wanted));
  return p;
}

TEST(Solve, AnObjectThatIsAsWantedKeepsEveryBit) {
  for (const Problem::Inner inner : {Problem::Inner::Free, Problem::Inner::Coons}) {
    Problem p;
    p.object = test::row();
    p.inner = inner;
    append(p.rows, fixedSide(p.object, {0, Side::U0}, p.object.points));
    const Result r = solved(p);
    EXPECT_EQ(r.points, p.object.points);
    EXPECT_EQ(r.report.outcome, Outcome::Converged);
    EXPECT_EQ(r.report.iterations, 0);
  }
}

TEST(Solve, SizesAndRowsHoldAndTheObjectiveIsStationary) {
  for (const Objective& objective : {Objective{}, Objective::leastSquaresOnly(), Objective{.1, 1, 0, 2}}) {
    const Problem p = stretched(.6, objective);
    const Result r = solved(p);
    EXPECT_EQ(r.report.outcome, Outcome::Converged) << r.report.message;
    EXPECT_LT(r.report.deviation, 1e-12);
    EXPECT_LT(r.report.rowResidual, 1e-12);
    for (const SizeReport& s : r.report.sizes) EXPECT_NEAR(s.after, 1, 1e-12);
    for (std::size_t s = 0; s < 3; ++s) {
      Object result = p.object;
      result.points = r.points;
      EXPECT_EQ(checkRegular(result, s).orientation, Orientation::Positive);
    }
    // The gradient of the objective lies in the span of the constraints' gradients.
    std::vector<Row> rows = p.rows;
    for (const Joint& j : p.object.joints) append(rows, continuity(p.object, j));
    const auto n = static_cast<Eigen::Index>(r.points.size());
    Eigen::MatrixXd d(n, 3);
    for (Eigen::Index i = 0; i < n; ++i) d.row(i) = (r.points[static_cast<std::size_t>(i)] - p.wanted[static_cast<std::size_t>(i)]).transpose();
    const Eigen::MatrixXd g = objectiveMatrix(p.object, objective) * d;
    const RowSpace space(rows, r.points.size());
    const auto projected = [&](const Eigen::MatrixXd& m) { return Eigen::MatrixXd(m - space.basis().transpose() * (space.basis() * m)); };
    Eigen::MatrixXd a(3 * n, 3);
    const Sizes sizes(p.object);
    for (std::size_t s = 0; s < 3; ++s) {
      std::vector<Vec3> v(r.points.size(), Vec3::Zero());
      sizes.addGradient(s, r.points, 1, v);
      Eigen::MatrixXd m(n, 3);
      for (Eigen::Index i = 0; i < n; ++i) m.row(i) = v[static_cast<std::size_t>(i)].transpose();
      a.col(static_cast<Eigen::Index>(s)) = Eigen::Map<const Eigen::VectorXd>(Eigen::MatrixXd(projected(m)).data(), 3 * n);
    }
    const Eigen::MatrixXd pg = projected(g);
    const Eigen::VectorXd b = Eigen::Map<const Eigen::VectorXd>(pg.data(), 3 * n);
    const Eigen::VectorXd lambda = (a.transpose() * a).ldlt().solve(a.transpose() * b);
    EXPECT_LT((b - a * lambda).cwiseAbs().maxCoeff(), 1e-7 * std::max(1.0, g.cwiseAbs().maxCoeff()));
  }
}

TEST(Solve, UzawaComesToTheSamePointAsTheExactSolver) {
  Problem p;
  p.object = test::boxObject({2, 2, 2});
  p.objective = Objective::leastSquaresOnly();
  p.wanted = p.object.points;
  p.wanted[26] += Vec3(.5, .5, .5);
  const Result exact = solved(p);
  Options options{.method = Method::Uzawa};
  options.uzawa.sizeTolerance = 1e-11, options.uzawa.distanceTolerance = 1e-11, options.uzawa.maxOuter = 2000, options.uzawa.maxInner = 20;
  Result uzawa = solved(p, options);
  EXPECT_EQ(uzawa.report.outcome, Outcome::Converged) << uzawa.report.message;
  for (std::size_t i = 0; i < exact.points.size(); ++i) EXPECT_LT((uzawa.points[i] - exact.points[i]).norm(), 1e-9);
  // With rows, by multipliers and by elimination.
  Problem rows = stretched(.2, Objective::leastSquaresOnly());
  options.uzawa.sizeTolerance = 1e-6, options.uzawa.distanceTolerance = 1e-6, options.uzawa.maxOuter = 5000, options.uzawa.maxInner = 2;
  const Result wanted = solved(rows);
  for (const bool eliminate : {false, true}) {
    options.uzawa.eliminateRows = eliminate;
    uzawa = solved(rows, options);
    EXPECT_EQ(uzawa.report.outcome, Outcome::Converged) << uzawa.report.message;
    for (std::size_t i = 0; i < wanted.points.size(); ++i) EXPECT_LT((uzawa.points[i] - wanted.points[i]).norm(), 1e-3) << eliminate;  // 1e-6 over rows that are nearly dependent
    EXPECT_EQ(uzawa.report.steps.size(), static_cast<std::size_t>(uzawa.report.iterations));
  }
}

TEST(Solve, UzawaWorksWithAnEnergyThatLeavesTranslationsFree) {
  const Problem p = stretched(.3);
  Options options{.method = Method::Uzawa};
  options.uzawa.sizeTolerance = 1e-6, options.uzawa.distanceTolerance = 1e-6, options.uzawa.maxOuter = 5000;
  const Result exact = solved(p), uzawa = solved(p, options);
  EXPECT_EQ(uzawa.report.outcome, Outcome::Converged) << uzawa.report.message;
  for (std::size_t i = 0; i < exact.points.size(); ++i) EXPECT_LT((uzawa.points[i] - exact.points[i]).norm(), 1e-3);
}

TEST(Solve, UzawaEndsWithAMessageWhereItDiverges) {
  Problem p;
  p.object = test::boxObject({2, 2, 2});
  p.sizes = {1.5};
  Options options{.method = Method::Uzawa};
  options.uzawa.rho1 = 50;
  const Result r = solved(p, options);
  EXPECT_EQ(r.report.outcome, Outcome::Unmet);
  EXPECT_NE(r.report.message.find("rho1"), std::string::npos);
  options.uzawa.rho1 = .5, options.uzawa.maxOuter = 2;
  EXPECT_NE(solved(p, options).report.message.find("stopped after 2"), std::string::npos);
}

TEST(Solve, ScalesWithTheObject) {
  Problem p = stretched(.5), scaled = p;
  for (Vec3& x : scaled.object.points) x *= 1024;
  for (Vec3& x : scaled.wanted) x *= 1024;
  for (Row& row : scaled.rows) row.value *= 1024;
  const Result a = solved(p), b = solved(scaled);
  for (std::size_t i = 0; i < a.points.size(); ++i) EXPECT_EQ(b.points[i], Vec3(1024 * a.points[i]));
}

TEST(Solve, MovesRigidlyWithTheObject) {
  const Problem p = stretched(.5);
  const Quat turn(Eigen::AngleAxisd(.7, Vec3(1, -1, 2).normalized()));
  const auto moved = [&](const Vec3& x) { return Vec3(turn * x + Vec3(3, -2, 1)); };
  Problem q = p;
  for (Vec3& x : q.object.points) x = moved(x);
  for (Vec3& x : q.wanted) x = moved(x);
  for (Row& row : q.rows) row.value = moved(row.value);
  const Result a = solved(p), b = solved(q);
  for (std::size_t i = 0; i < a.points.size(); ++i) EXPECT_LT((b.points[i] - moved(a.points[i])).norm(), 1e-7);  // optimality 1e-9 of the curvature
}

TEST(Solve, KeepsContinuityAndAttachments) {
  Problem p = stretched(.8);
  p.rows.push_back(fixedPoint(p.object, {1, Vec3(.5, .5, 1)}, Vec3(1.9, .5, 1.3)));
  p.rows.push_back(fixedDifference(p.object, {1, std::array{1, 0, 0}}, {1, std::array{2, 0, 0}}, Vec3(.4, .1, 0)));
  const Result r = solved(p);
  EXPECT_EQ(r.report.outcome, Outcome::Converged) << r.report.message;
  Object out = p.object;
  out.points = r.points;
  EXPECT_LT((evaluate(out, 1, Vec3(.5, .5, 1)) - Vec3(1.9, .5, 1.3)).norm(), 1e-12);
  for (const double v : {0.0, .3, 1.0})
    EXPECT_LT((derivative(out, 0, Vec3(1, v, .4)) - derivative(out, 1, Vec3(0, v, .4))).norm(), 1e-11);
}

TEST(Solve, CoonsInsideHoldsAndDoesNotChangeTheSizes) {
  Problem p = stretched(.5);
  p.inner = Problem::Inner::Coons;
  const Result r = solved(p);
  EXPECT_EQ(r.report.outcome, Outcome::Converged);
  Object out = p.object;
  out.points = r.points;
  fillInner(out);
  for (std::size_t i = 0; i < out.points.size(); ++i) EXPECT_LT((out.points[i] - r.points[i]).norm(), 1e-12);
  EXPECT_LT(r.report.deviation, 1e-12);
}

TEST(Solve, SolidsHaveTargetsOfTheirOwnOrNone) {
  Problem p;
  p.object = test::row();
  p.sizes = {1.3, std::nullopt, .8};
  const Result r = solved(p);
  EXPECT_EQ(r.report.outcome, Outcome::Converged);
  EXPECT_NEAR(r.report.sizes[0].after, 1.3, 1e-11);
  EXPECT_NEAR(r.report.sizes[2].after, .8, 1e-11);
  EXPECT_NE(r.report.sizes[1].after, 1);
  // Large changes, too.
  for (const double target : {.05, 20.0}) {
    p.object = test::boxObject({2, 2, 2});
    p.sizes = {target};
    const Result large = solved(p);
    EXPECT_NE(large.report.outcome, Outcome::Unmet) << large.report.message;
    EXPECT_NEAR(large.report.sizes[0].after / target, 1, 1e-9);
  }
}

TEST(Solve, SaysWhatCannotBe) {
  const auto refusal = [](const Problem& p) -> std::string {
    try {
      solved(p);
    } catch (const InfeasibleError& problem) {
      return problem.what();
    }
    return "";
  };
  Problem p;
  p.object = test::boxObject({2, 2, 2});
  p.sizes = {-1.0};
  EXPECT_NE(refusal(p).find("target size is -1"), std::string::npos);
  p.sizes = {1.2};
  for (int k = 0; k < 6; ++k) append(p.rows, fixedSide(p.object, {0, static_cast<Side>(k)}, p.object.points));
  EXPECT_NE(refusal(p).find("leave nothing that changes its size"), std::string::npos);
  p.rows.push_back(fixedPoint(p.object, {0, std::array{0, 0, 0}}, Vec3(1, 0, 0)));
  EXPECT_NE(refusal(p).find("contradicts \"fixed side box.u0\""), std::string::npos);
  Problem mirrored;
  mirrored.object = test::boxObject({1, 1, 1});
  for (Vec3& x : mirrored.object.points) x.x() = -x.x();
  mirrored.sizes = {1.0};
  EXPECT_NE(refusal(mirrored).find("left-handed"), std::string::npos);
  Problem point;
  point.object = test::boxObject({1, 1, 1});
  for (Vec3& x : point.object.points) x.setZero();
  EXPECT_NE(refusal(point).find("single point"), std::string::npos);
  // Five of six sides fixed, and the last one cannot take away more than there is: it ends, and says so or turns inside out.
  Problem tight;
  tight.object = test::boxObject({1, 1, 1});
  for (const Side s : {Side::U0, Side::U1, Side::V0, Side::W0}) append(tight.rows, fixedSide(tight.object, {0, s}, tight.object.points));
  tight.sizes = {1e-9};
  EXPECT_NE(refusal(tight), "");
}

TEST(Session, DragsToWhatASingleSolveGivesAndIsWarm) {
  Problem p = stretched(0);
  Session session(p, {});
  for (int frame = 1; frame <= 10; ++frame) {
    std::vector<Vec3> values;
    for (const Row& row : p.rows) values.push_back(row.value);
    for (std::size_t r = 16; r < 32; ++r) values[r].x() += .05 * frame;
    std::vector<Vec3> wanted = p.object.points;
    const Solid& last = p.object.solids[2];
    for (const std::size_t slot : layerOf(last, Side::U1).slots) wanted[last.points[slot]].x() += .05 * frame;
    session.setValues(values);
    session.setWanted(wanted);
    session.solve(frame < 10 ? Effort::Drag : Effort::Release);
    EXPECT_LT(session.report().deviation, 1e-5);
    EXPECT_LE(session.report().iterations, 8);
  }
  const Result once = solved(stretched(.5));
  const std::vector<Vec3>& points = session.solve(Effort::Release);
  for (std::size_t i = 0; i < points.size(); ++i) EXPECT_LT((points[i] - once.points[i]).norm(), 1e-8);
  // Without sizes the edit is linear; sizes can be dragged, too.
  session.solve(Effort::Edit);
  EXPECT_GT(session.report().deviation, 1e-3);
  session.setSizes(std::vector<std::optional<double>>{1.0, 1.4, 1.0});
  session.solve();
  EXPECT_NEAR(session.report().sizes[1].after, 1.4, 1e-11);
  EXPECT_THROW(session.setSizes(std::vector<std::optional<double>>{1.0, std::nullopt, 1.0}), std::invalid_argument);
  EXPECT_THROW(session.setSizes(std::vector<std::optional<double>>{1.0, -1.0, 1.0}), InfeasibleError);
}

}  // namespace
}  // namespace fielddeform::solid
