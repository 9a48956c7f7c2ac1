#include <fielddeform/map/barr_fit.h>
#include <fielddeform/map/chain.h>
#include <fielddeform/map/influence.h>
#include <gtest/gtest.h>

#include <numbers>
#include <stdexcept>

#include "classic.h"

namespace fielddeform::map {
namespace {

using namespace test;
using std::numbers::pi;

BarrEdit oblique(BarrKind kind) {
  BarrEdit e;
  e.kind = kind;
  e.pivot = Vec3(0.1, -0.2, 0.05);
  e.axis = Vec3(1, 2, 2).normalized();
  e.about = anyPerpendicular(e.axis);
  e.begin = -0.6;
  e.end = 0.7;
  e.angle = 1.3;
  e.factor = Vec3(0.6, 1.7, 1.2);
  return e;
}

const std::vector<BarrKind> kAll{BarrKind::Scale, BarrKind::Stretch, BarrKind::Taper, BarrKind::Twist, BarrKind::Bend};

// Away from the ends of the range, where the maps have a kink.
std::vector<Vec3> smoothPoints(const BarrEdit& e, double size = 1) {
  std::vector<Vec3> out;
  for (const Vec3& p : cloud(7, 120, size)) {
    const double s = e.axis.dot(p - e.pivot);
    if (std::abs(s - e.begin) > 1e-3 && std::abs(s - e.end) > 1e-3) out.push_back(p);
  }
  return out;
}

Mat3 jacobianAt(const BarrMap& map, const Vec3& x) { return map.jacobian(x); }

TEST(Barr, NothingToDoIsTheIdentityBitForBit) {
  for (const BarrKind kind : kAll) {
    BarrEdit e = oblique(kind);
    e.angle = 0;
    e.factor = Vec3::Ones();
    expectIdentity(BarrMap(e));
  }
}

TEST(Barr, JacobiansAgreeWithCentralDifferences) {
  for (const BarrKind kind : kAll) {
    const BarrEdit e = oblique(kind);
    expectJacobians(BarrMap(e), smoothPoints(e));
    expectJacobians(BarrMap(e, someMotion().rotation, Vec3(1, 2, 3)), smoothPoints(e));
  }
  BarrEdit taper = oblique(BarrKind::Taper);
  taper.law = TaperLaw::AreaPreserving;
  expectJacobians(BarrMap(taper), smoothPoints(taper));
}

TEST(Barr, ATwistKeepsVolumeAtEveryPoint) {
  const BarrMap map(oblique(BarrKind::Twist));
  for (const Vec3& x : cloud(3, 200, 3)) EXPECT_NEAR(jacobianAt(map, x).determinant(), 1, 1e-13);
}

TEST(Barr, AnAreaPreservingTaperKeepsVolumeAtEveryPoint) {
  BarrEdit e = oblique(BarrKind::Taper);
  e.law = TaperLaw::AreaPreserving;
  const BarrMap map(e);
  for (const Vec3& x : cloud(3, 200, 3)) EXPECT_NEAR(jacobianAt(map, x).determinant(), 1, 1e-13);
  // A linear taper scales areas by the product of its two factors, from section to section.
  const BarrMap linear(oblique(BarrKind::Taper));
  const Vec3 beyond = linear.edit().pivot + 2 * linear.edit().axis;
  EXPECT_NEAR(jacobianAt(linear, beyond).determinant(), 0.6 * 1.7, 1e-13);
}

TEST(Barr, ABendScalesVolumeByTheDistanceFromItsCentre) {
  const BarrEdit e = oblique(BarrKind::Bend);
  const BarrMap map(e);
  const double curvature = e.angle / (e.end - e.begin);
  const Vec3 inward = e.about.cross(e.axis);
  for (const Vec3& x : smoothPoints(e)) {
    const double s = e.axis.dot(x - e.pivot), inside = s > e.begin && s < e.end ? 1 : 0;
    EXPECT_NEAR(jacobianAt(map, x).determinant(), 1 - inside * curvature * inward.dot(x - e.pivot), 1e-13);
  }
}

TEST(Barr, ABendKeepsLengthsAlongItsAxis) {
  const BarrEdit e = oblique(BarrKind::Bend);
  const BarrMap map(e);
  for (double s = -1; s < 1; s += 0.07) EXPECT_NEAR((jacobianAt(map, e.pivot + s * e.axis) * e.axis).norm(), 1, 1e-13);
}

TEST(Barr, InversesAreExact) {
  for (const BarrKind kind : kAll) {
    const BarrEdit e = oblique(kind);
    const BarrMap map(e, someMotion().rotation, Vec3(1, 2, 3));
    // Within the bend's radius of curvature, 1.3 / 1.3 = 1, on its near side.
    for (const Vec3& x : cloud(5, 200, 0.4)) EXPECT_LT((map.inverse(map.position(x)) - x).norm(), 1e-13);
    for (const double s : {-3.0, 3.0}) {
      const Vec3 x = e.pivot + s * e.axis + 0.1 * e.about;
      EXPECT_LT((map.inverse(map.position(x)) - x).norm(), 1e-13);
    }
  }
}

TEST(Barr, NormalsStandOnTheDeformedSurface) {
  for (const BarrKind kind : kAll) {
    const BarrEdit e = oblique(kind);
    const BarrMap map(e);
    for (const Vec3& x : smoothPoints(e, 0.6)) {
      // The tangents of a plane through x go over to tangents of its image.
      const Vec3 n = Vec3(0.3, -1, 0.5).normalized(), u = anyPerpendicular(n), v = n.cross(u);
      constexpr double h = 1e-5;
      const auto tangent = [&](const Vec3& d) { return Vec3((map.position(x + h * d) - map.position(x - h * d)) / (2 * h)); };
      const Vec3 expected = tangent(u).cross(tangent(v)).normalized(), found = map.normal(x, n);
      EXPECT_LT((found - expected).norm(), 1e-7);
    }
  }
}

TEST(Barr, DoesWhatTheSkeletonsEditDoes) {
  const skeleton::Skeleton rest = spine();
  const skeleton::Spine from{.axis = Vec3(0, 0, 1), .pivot = Vec3(0, 0, 0.3), .from = 0.2, .to = 0.8};
  const std::vector<skeleton::Edit> edits{{"", skeleton::Bend{.spine = from, .angle = 1.2, .about = Vec3(0, 1, 0)}},
                                          {"", skeleton::Twist{from, 2.0}},
                                          {"", skeleton::Taper{from, 0.5}},
                                          {"", skeleton::Stretch{from, 1.5}},
                                          {"", skeleton::Scale{Vec3(1, 2, 0.5), Vec3(0, 0, 0.1)}}};
  for (const skeleton::Edit& edit : edits) {
    const skeleton::EditMap expected(rest, edit);
    const auto barr = barrEditOf(rest, edit);
    ASSERT_TRUE(barr);
    const BarrMap map(*barr);
    for (const Vec3& x : cloud(1, 100)) EXPECT_LT((map.position(x) - expected(x)).norm(), 1e-14) << skeleton::operationName(edit);
  }
  EXPECT_FALSE(barrEditOf(rest, {"", skeleton::Translate{Vec3(1, 0, 0)}}));
}

TEST(Barr, RefusesWhatIsNoDeformation) {
  BarrEdit e = oblique(BarrKind::Bend);
  e.end = e.begin;
  EXPECT_THROW(BarrMap{e}, std::invalid_argument);
  e = oblique(BarrKind::Bend);
  e.about = e.axis;
  EXPECT_THROW(BarrMap{e}, std::invalid_argument);
  e = oblique(BarrKind::Taper);
  e.factor[0] = 0;
  EXPECT_THROW(BarrMap{e}, std::invalid_argument);
  e = oblique(BarrKind::Twist);
  e.angle = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(BarrMap{e}, std::invalid_argument);
}

// A line that is edited and then moved as a whole.
SkeletonMotion movedAfter(const skeleton::Edit& edit, int n = 65) {
  const skeleton::Skeleton rest = spine(n);
  return motionBetween(rest, rigidlyMoved(skeleton::applyEdits(rest, std::vector<skeleton::Edit>{edit}), {Quat(Eigen::AngleAxisd(0.4, Vec3(0, 0.6, 0.8))), Vec3(1, 2, 3)}));
}

TEST(BarrFit, RecoversABendWithItsRangeAndAngle) {
  const skeleton::Spine from{.axis = Vec3(0, 0, 1), .pivot = Vec3::Zero(), .from = 0.2, .to = 0.8};
  for (const double angle : {0.3, pi / 2, -2.5}) {
    const BarrFit fit = fitBarr(movedAfter({"", skeleton::Bend{.spine = from, .angle = angle, .about = Vec3(1, 0, 0)}}));
    EXPECT_EQ(fit.edit.kind, BarrKind::Bend);
    EXPECT_FALSE(fit.rigid);
    // Frames of a polygon differ from the arc's by half a segment's turn and count 1e-6: parameters to about 1e-6.
    EXPECT_NEAR(std::abs(fit.edit.angle), std::abs(angle), 1e-5);
    EXPECT_NEAR(fit.edit.end - fit.edit.begin, 1.2, 1e-5);
    EXPECT_LT(fit.max, 1e-6);
    EXPECT_EQ(fit.pairs, 65u);
  }
}

TEST(BarrFit, RecoversATwistOfALineThatStaysWhereItIs) {
  const BarrFit fit = fitBarr(edited(spine(), {{"", skeleton::Twist{{.axis = Vec3(0, 0, 1), .pivot = Vec3::Zero()}, 3 * pi}}}));
  EXPECT_EQ(fit.edit.kind, BarrKind::Twist);
  EXPECT_NEAR(std::abs(fit.edit.angle), 3 * pi, 1e-5);
  EXPECT_LT(fit.max, 1e-9);
}

TEST(BarrFit, RecoversATaperFromTheRadii) {
  const BarrFit fit = fitBarr(edited(spine(), {{"", skeleton::Taper{{.axis = Vec3(0, 0, 1), .pivot = Vec3::Zero()}, 0.4}}}));
  EXPECT_EQ(fit.edit.kind, BarrKind::Taper);
  const BarrMap map = fit.map();
  for (const double s : {-0.8, 0.0, 0.8})
    EXPECT_NEAR((map.position(Vec3(0.2, 0, s)) - map.position(Vec3(0, 0, s))).norm(), 0.2 * (1 - 0.3 * (s + 1)), 1e-6);
}

TEST(BarrFit, RecoversAStretch) {
  const skeleton::Spine from{.axis = Vec3(0, 0, 1), .pivot = Vec3::Zero(), .from = 0.25, .to = 0.75};
  const BarrFit fit = fitBarr(movedAfter({"", skeleton::Stretch{from, 1.8}}));
  EXPECT_EQ(fit.edit.kind, BarrKind::Stretch);
  EXPECT_NEAR(fit.edit.factor[0], 1.8, 1e-5);
  EXPECT_LT(fit.max, 1e-6);
}

TEST(BarrFit, RecoversAScaleOfACage) {
  skeleton::Skeleton rest;
  skeleton::Primitive cage;
  cage.name = "cage";
  cage.type = skeleton::PrimitiveType::Mesh;
  for (int i = 0; i < 8; ++i) cage.points.emplace_back(2 * (i & 1), 3 * (i >> 1 & 1), i >> 2 & 1);
  cage.faces = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  cage.radius = 1;
  rest.primitives.push_back(cage);
  skeleton::Skeleton posed = rest;
  for (Vec3& p : posed.primitives[0].points) p = Vec3(1.5 * p.x(), 0.7 * p.y(), 2 * p.z());
  const BarrFit fit = fitBarr(motionBetween(rest, posed));
  EXPECT_EQ(fit.edit.kind, BarrKind::Scale);
  EXPECT_LT(fit.max, 1e-9);
}

TEST(BarrFit, ARigidMotionIsRecognised) {
  const skeleton::Skeleton rest = spine();
  const BarrFit fit = fitBarr(motionBetween(rest, rigidlyMoved(rest, someMotion())));
  EXPECT_TRUE(fit.rigid);
  EXPECT_LT(fit.max, 1e-14 * 10);
}

double amountOf(const BarrSequence& s, BarrKind kind) {
  for (const BarrEdit& e : s.edits)
    if (e.kind == kind) return kind == BarrKind::Twist || kind == BarrKind::Bend ? e.angle : e.factor[0];
  return 0;
}

TEST(BarrFit, RecoversTaperTwistAndBendOfOnePoseInBarrsOrder) {
  const skeleton::Spine whole{.axis = Vec3(0, 0, 1), .pivot = Vec3(0, 0, -1)}, part{.axis = Vec3(0, 0, 1), .pivot = Vec3(0, 0, -1), .from = 0.2, .to = 0.8};
  const std::vector<skeleton::Edit> edits{{"", skeleton::Taper{whole, 0.6}}, {"", skeleton::Twist{whole, 1.8}},
                                          {"", skeleton::Bend{.spine = part, .angle = 1.2, .about = Vec3(1, 0, 0)}}};
  skeleton::Skeleton rest = spine();
  std::vector<std::shared_ptr<const SpaceMap>> maps;
  for (const skeleton::Edit& e : edits) maps.push_back(std::make_shared<BarrMap>(*barrEditOf(rest, e)));
  const Chain exact(maps);
  // The pose that the deformations themselves give: rolls and radii are the twist's and the taper's.
  skeleton::Skeleton posed = rest;
  skeleton::Primitive& line = posed.primitives[0];
  for (std::size_t i = 0; i < line.points.size(); ++i) {
    const double share = static_cast<double>(i) / 64;
    line.points[i] = image(exact, line.points[i]);
    line.roll.push_back(1.8 * share);
    line.pointRadius.push_back(1 - 0.4 * share);
  }
  const SkeletonMotion motion = motionBetween(rest, posed);
  const BarrSequence fit = fitBarrSequence(motion);
  EXPECT_LT(fit.max, 1e-4);
  ASSERT_EQ(fit.edits.size(), 3u);
  EXPECT_EQ(fit.edits[0].kind, BarrKind::Taper);
  EXPECT_EQ(fit.edits[1].kind, BarrKind::Twist);
  EXPECT_EQ(fit.edits[2].kind, BarrKind::Bend);
  // Frames are those of a polygon of 64 segments: parameters to a share of a segment's.
  EXPECT_NEAR(std::abs(amountOf(fit, BarrKind::Twist)), 1.8, 0.02);
  EXPECT_NEAR(std::abs(amountOf(fit, BarrKind::Bend)), 1.2, 1e-3);
  EXPECT_NEAR(amountOf(fit, BarrKind::Taper), 0.6, 0.02);
  // Beside the line, too, the map is the three deformations'.
  const auto map = fit.map();
  for (const Vec3& p : cloud(7, 100, 0.3)) {
    const Vec3 x(p.x(), p.y(), 3 * p.z());
    EXPECT_LT((image(*map, x) - image(exact, x)).norm(), 0.01);
  }
  EXPECT_GT(fitBarr(motion).rms, 100 * fit.rms);  // no single one comes near
}

TEST(BarrFit, RecoversAScaleBeforeABend) {
  const skeleton::Spine whole{.axis = Vec3(0, 0, 1), .pivot = Vec3(0, 0, -1)};
  const std::vector<skeleton::Edit> edits{{"", skeleton::Scale{.factor = Vec3::Constant(1.4)}}, {"", skeleton::Bend{.spine = whole, .angle = 0.9, .about = Vec3(0, 1, 0)}}};
  const BarrSequence fit = fitBarrSequence(edited(spine(), edits));
  EXPECT_LT(fit.max, 1e-4);
  ASSERT_EQ(fit.edits.size(), 2u);
  EXPECT_EQ(fit.edits[0].kind, BarrKind::Scale);
  EXPECT_LT((fit.edits[0].factor - Vec3::Constant(1.4)).norm(), 0.02);
  EXPECT_NEAR(std::abs(amountOf(fit, BarrKind::Bend)), 0.9, 1e-3);
}

TEST(BarrFit, OneDeformationStaysOne) {
  const skeleton::Spine whole{.axis = Vec3(0, 0, 1), .pivot = Vec3::Zero()};
  const BarrSequence fit = fitBarrSequence(edited(spine(), {{"", skeleton::Bend{.spine = whole, .angle = 0.9, .about = Vec3(0, 1, 0)}}}));
  ASSERT_EQ(fit.edits.size(), 1u);
  EXPECT_EQ(fit.edits[0].kind, BarrKind::Bend);
  EXPECT_LT(fit.max, 1e-5);
}

TEST(BarrFit, SaysHowFarOffTheNearestIs) {
  const skeleton::Skeleton rest = spine();
  skeleton::Skeleton posed = rest;
  for (Vec3& p : posed.primitives[0].points) p.x() += 0.2 * std::sin(5 * p.z());
  const BarrFit fit = fitBarr(motionBetween(rest, posed));
  EXPECT_GT(fit.max, 0.02);
  EXPECT_LT(fit.max, 0.4);  // but not farther than no deformation is
  double worst = 0;
  const BarrMap map = fit.map();
  for (std::size_t i = 0; i < 65; ++i)
    worst = std::max(worst, (map.position(rest.primitives[0].points[i]) - posed.primitives[0].points[i]).norm());
  EXPECT_DOUBLE_EQ(worst, fit.max);
}

}  // namespace
}  // namespace fielddeform::map
