#include <fielddeform/map/axial.h>
#include <gtest/gtest.h>

#include <numbers>
#include <stdexcept>

#include "classic.h"

namespace fielddeform::map {
namespace {

using namespace test;
using std::numbers::pi;

skeleton::Skeleton curved() {
  skeleton::Skeleton s;
  std::vector<Vec3> p;
  for (int i = 0; i <= 40; ++i) {
    const double t = -1 + i / 20.0;
    p.emplace_back(0.2 * std::sin(2 * t), 0.1 * t * t, t);
  }
  s.primitives.push_back(line("axis", p));
  return s;
}

skeleton::Skeleton ring(double radius, int n = 48) {
  skeleton::Skeleton s;
  std::vector<Vec3> p;
  for (int i = 0; i < n; ++i) p.emplace_back(radius * std::cos(2 * pi * i / n), radius * std::sin(2 * pi * i / n), 0);
  s.primitives.push_back(line("ring", p));
  s.primitives[0].closed = true;
  return s;
}

const skeleton::Spine kZ{.axis = Vec3(0, 0, 1), .pivot = Vec3::Zero()};

TEST(SplineCurve, InterpolatesAndIsSmooth) {
  const std::vector<Vec3> p = cloud(3, 12);
  for (const bool closed : {false, true}) {
    const std::vector<double> t = SplineCurve::chordParameters(p, closed);
    const SplineCurve c(p, closed, t);
    for (std::size_t i = 0; i < p.size(); ++i) EXPECT_LT((c.at(t[i]).point - p[i]).norm(), 1e-14);
    for (std::size_t i = closed ? 0 : 1; i + 1 < p.size(); ++i) {
      const double h = 1e-9;
      const auto a = c.at(t[i] - h), b = c.at(t[i] + h);
      EXPECT_LT((a.first - b.first).norm(), 1e-6);
      EXPECT_LT((a.second - b.second).norm(), 1e-5);
    }
    for (double x = 0.1; x < c.end(); x += 0.3) {
      const double h = 1e-5;
      const Vec3 first = (c.at(x + h).point - c.at(x - h).point) / (2 * h), second = (c.at(x + h).first - c.at(x - h).first) / (2 * h);
      EXPECT_LT((c.at(x).first - first).norm(), 1e-7);
      EXPECT_LT((c.at(x).second - second).norm(), 1e-7 * std::max(1.0, second.norm() * 100));
    }
  }
}

TEST(SplineCurve, TheClosestPointIsCloserThanAnyOtherTried) {
  const std::vector<Vec3> p = curved().primitives[0].points;
  const SplineCurve c(p, false, SplineCurve::chordParameters(p, false));
  for (const Vec3& x : cloud(4, 100, 1.5)) {
    const SplineCurve::Foot foot = c.closest(x);
    const auto place = c.at(foot.t);
    const double d = (x - place.point).norm();
    for (int i = 0; i <= 2000; ++i) EXPECT_LE(d, (x - c.at(c.end() * i / 2000).point).norm() + 1e-12);
    if (foot.inside) {
      EXPECT_LT(std::abs((x - place.point).dot(place.first)), 1e-13);
    }
  }
}

TEST(SplineCurve, RefusesWhatIsNoCurve) {
  const std::vector<Vec3> p{Vec3(0, 0, 0), Vec3(1, 0, 0)};
  EXPECT_THROW(SplineCurve(p, false, {0, 0}), std::invalid_argument);
  EXPECT_THROW(SplineCurve(p, true, {0, 1, 2}), std::invalid_argument);
  EXPECT_THROW(SplineCurve(Points(p).first(1), false, {0}), std::invalid_argument);
}

TEST(Axial, AnUneditedAxisIsTheIdentityBitForBit) { expectIdentity(AxialMap(motionBetween(curved(), curved()))); }

TEST(Axial, RigidMotionsOfACurvedAxisAreExact) {
  for (const skeleton::Skeleton& rest : {curved(), ring(0.8)}) {
    const AxialMap map(motionBetween(rest, rigidlyMoved(rest, someMotion())));
    for (const Vec3& x : cloud(2, 100)) EXPECT_LT((map.position(x) - someMotion()(x)).norm(), 1e-11);
  }
}

TEST(Axial, PointsOfTheAxisStayOnIt) {
  const skeleton::Skeleton rest = curved();
  skeleton::Skeleton posed = rest;
  for (Vec3& p : posed.primitives[0].points) p += 0.3 * Vec3(std::cos(3 * p.z()), p.z(), std::sin(p.z()));
  const AxialMap map(motionBetween(rest, posed));
  for (std::size_t i = 0; i < 41; ++i)
    EXPECT_LT((map.position(rest.primitives[0].points[i]) - posed.primitives[0].points[i]).norm(), 1e-12);
}

TEST(Axial, FramesAreKept) {
  // Distances to the axis, and the plane across it: what the method promises.
  const skeleton::Skeleton rest = spine();
  skeleton::Skeleton posed = rest;
  for (Vec3& p : posed.primitives[0].points) {
    posed.primitives[0].roll.push_back(2 * p.z());
    p = Vec3(0.5 * p.z() * p.z(), 0.2 * std::sin(2 * p.z()), p.z());
  }
  const SkeletonMotion motion = motionBetween(rest, posed);
  const AxialMap map(motion);
  const SplineCurve c(posed.primitives[0].points, false, SplineCurve::chordParameters(rest.primitives[0].points, false));
  for (const Vec3& x : cloud(3, 60, 0.9)) {
    const auto place = c.at(x.z() + 1);
    const Vec3 offset = map.position(x) - place.point;
    EXPECT_NEAR(offset.norm(), x.head<2>().norm(), 1e-12);
    // Between eight rotations a span, a cubic: 1e-6 off the tangent at most.
    EXPECT_LT(std::abs(offset.dot(place.first.normalized())), 1e-6);
  }
}

TEST(Axial, ABentSpineBendsAsBarrDoes) {
  const skeleton::Edit bend{"", skeleton::Bend{.spine = kZ, .angle = pi / 2, .about = Vec3(0, 1, 0)}};
  const AxialMap map(edited(spine(129), {bend}));
  const skeleton::EditMap ideal(spine(129), bend);
  // Natural ends have no curvature: within a few spans of them the spline leaves the arc, by the square of a span.
  for (const Vec3& x : cloud(1, 100, 0.5)) EXPECT_LT((map.position(x) - ideal(x)).norm(), 1e-6);
}

TEST(Axial, RollTwistsAndRadiiScale) {
  const skeleton::Edit twist{"", skeleton::Twist{kZ, 4.0}}, taper{"", skeleton::Taper{kZ, 0.3}};
  for (const skeleton::Edit& edit : {twist, taper}) {
    const AxialMap map(edited(spine(), {edit}));
    const skeleton::EditMap ideal(spine(), edit);
    for (const Vec3& x : cloud(1, 100, 0.9)) EXPECT_LT((map.position(x) - ideal(x)).norm(), 1e-5) << skeleton::operationName(edit);
  }
}

TEST(Axial, JacobiansAgreeWithCentralDifferences) {
  const std::vector<skeleton::Edit> edits{{"", skeleton::Bend{.spine = kZ, .angle = 1.2, .about = Vec3(0, 1, 0)}},
                                          {"", skeleton::Twist{kZ, 3.0}},
                                          {"", skeleton::Taper{kZ, 0.5}}};
  expectJacobians(AxialMap(edited(curved(), edits)), cloud(5, 60, 0.5), 1e-6);
  skeleton::Skeleton posed = ring(0.8);
  for (Vec3& p : posed.primitives[0].points) p.z() = 0.4 * p.x() * p.y();
  std::vector<Vec3> points;
  for (const Vec3& x : cloud(6, 60))
    if (x.head<2>().norm() > 0.2) points.push_back(x);  // the ring's centre is its centre of curvature
  expectJacobians(AxialMap(motionBetween(ring(0.8), posed)), points, 2e-5);
  skeleton::Skeleton two = spine(33, 0.8);
  two.primitives.push_back(line("other", straight(Vec3(0.8, 0, -1), Vec3(0.9, 0.3, 1), 33), 0.6));
  skeleton::Skeleton twoPosed = two;
  for (Vec3& p : twoPosed.primitives[1].points) p.y() += 0.4 * std::sin(2 * p.z());
  points.clear();
  for (const Vec3& x : cloud(7, 60, 0.9))
    if (x.head<2>().norm() > 0.05) points.push_back(x);
  expectJacobians(AxialMap(motionBetween(two, twoPosed)), points, 2e-5);
}

TEST(Axial, SeveralAxesWithOneMotionAreOne) {
  skeleton::Skeleton two = spine(33, 0.8);
  two.primitives.push_back(line("other", straight(Vec3(0.8, 0, -1), Vec3(0.9, 0.3, 1), 33), 0.6));
  const AxialMap map(motionBetween(two, rigidlyMoved(two, someMotion())));
  for (const Vec3& x : cloud(7, 60, 2)) EXPECT_LT((map.position(x) - someMotion()(x)).norm(), 1e-11);
}

TEST(Axial, RefusesWhatHasNoAxis) {
  skeleton::Skeleton points = spine();
  points.primitives[0].type = skeleton::PrimitiveType::Points;
  EXPECT_THROW(AxialMap(motionBetween(points, points)), std::invalid_argument);
  skeleton::Skeleton flat = spine(3);
  for (Vec3& p : flat.primitives[0].points) p = Vec3(1, 1, 1);
  EXPECT_THROW(AxialMap(motionBetween(flat, flat)), std::invalid_argument);
  EXPECT_THROW(AxialMap(motionBetween(spine(), spine()), 0), std::invalid_argument);
}

TEST(Axial, PointsThatCoincideCountOnce) {
  skeleton::Skeleton rest = spine(9), twice = spine(9);
  twice.primitives[0].points.insert(twice.primitives[0].points.begin() + 4, twice.primitives[0].points[4]);
  skeleton::Skeleton posed = rest, twicePosed = twice;
  for (auto* s : {&posed, &twicePosed})
    for (Vec3& p : s->primitives[0].points) p.x() += 0.3 * p.z() * p.z();
  const AxialMap a(motionBetween(rest, posed)), b(motionBetween(twice, twicePosed));
  for (const Vec3& x : cloud(8, 40)) EXPECT_LT((a.position(x) - b.position(x)).norm(), 1e-12);
}

}  // namespace
}  // namespace fielddeform::map
