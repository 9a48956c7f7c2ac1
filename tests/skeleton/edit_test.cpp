#include <fielddeform/core/angle.h>
#include <fielddeform/core/random.h>
#include <fielddeform/skeleton/edit.h>
#include <fielddeform/skeleton/principal_axes.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

namespace fielddeform::skeleton {
namespace {

// The line of the closed-form cases: z from -1 to 1.
Skeleton zLine(std::size_t count = 33) {
  Primitive p;
  p.name = "spine";
  p.radius = 0.5;
  for (std::size_t i = 0; i < count; ++i)
    p.points.push_back(Vec3(0, 0, -1 + 2 * static_cast<double>(i) / static_cast<double>(count - 1)));
  return {{p}, {}};
}

Vec3 somePoint(std::uint64_t i, double size = 2) {
  return size * Vec3(uniform01(i, 0) - 0.5, uniform01(i, 1) - 0.5, uniform01(i, 2) - 0.5);
}

Spine centred() {
  Spine s;
  s.axis = Vec3::UnitZ();
  s.pivot = Vec3::Zero();
  return s;
}

Bend bendOf(double degrees) {
  Bend b;
  b.spine = centred();
  b.angle = radiansFromDegrees(degrees);
  b.about = Vec3::UnitY();
  return b;
}

Edit edit(auto operation, std::string primitive = "spine") { return {std::move(primitive), std::move(operation)}; }

// Bits, so that -0.0 and 0.0 differ.
bool sameBits(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(Vec3)) == 0;
}

std::vector<Edit> oneOfEach() {
  Twist twist{centred(), 1.2};
  Taper taper{centred(), 0.4};
  Stretch stretch{centred(), 1.7};
  Rotate rotate{0.7, Vec3(1, 2, 3), Vec3(0.1, 0, 0)};
  Scale scale{Vec3(2, 2, 2), std::nullopt};
  MovePoints move{{3, 5}, {Vec3(0.1, 0.2, 0.3)}};
  Press press{Vec3(0, 0, 0.8), Vec3(0, 0.1, 1), 0.1};
  return {edit(twist), edit(bendOf(70)), edit(taper), edit(stretch), edit(Translate{Vec3(1, -2, 3)}),
          edit(rotate), edit(scale), edit(move), edit(press)};
}

// Closed form: an arc of radius L/angle, centred; the ends go on straight. Tolerance: a few roundings of coordinates of 2.
TEST(Edits, BendIsTheArcOfTheSameLength) {
  for (const double degrees : {1.0, 90.0, 180.0, 350.0}) {
    const EditMap map(zLine(), edit(bendOf(degrees)));
    const double angle = radiansFromDegrees(degrees), radius = 2 / angle;
    for (std::uint64_t i = 0; i < 200; ++i) {
      const Vec3 x = somePoint(i, 4);
      const double theta = std::clamp(x.z(), -1.0, 1.0) / radius, beyond = x.z() - std::clamp(x.z(), -1.0, 1.0);
      const Vec3 ideal(radius * (1 - std::cos(theta)) + x.x() * std::cos(theta) + beyond * std::sin(theta), x.y(),
                       radius * std::sin(theta) - x.x() * std::sin(theta) + beyond * std::cos(theta));
      EXPECT_LT((map(x) - ideal).norm(), 2e-14) << degrees;  // radius 115 at 1 degree costs two digits in the ideal
      EXPECT_NEAR(map.turnAngle(x), theta, 1e-15 * 8);
    }
  }
}

TEST(Edits, BendTurnsRightHandedAndStaysAtItsRoot) {
  Bend bend;
  bend.angle = kPi / 2;
  bend.about = Vec3::UnitY();
  const Skeleton posed = applyEdits(zLine(), std::vector{edit(bend)});
  // z turns towards x about y; the default pivot is the lower end.
  EXPECT_LT((posed.primitives[0].points.front() - Vec3(0, 0, -1)).norm(), 1e-15);
  EXPECT_LT((posed.primitives[0].points.back() - Vec3(4 / kPi, 0, -1 + 4 / kPi)).norm(), 1e-14);
}

TEST(Edits, BendByRadiusIsABendByAngle) {
  Bend byRadius = bendOf(0);
  byRadius.angle.reset();
  byRadius.radius = -2 / radiansFromDegrees(40);
  const EditMap a(zLine(), edit(byRadius)), b(zLine(), edit(bendOf(-40)));
  for (std::uint64_t i = 0; i < 50; ++i) EXPECT_LT((a(somePoint(i)) - b(somePoint(i))).norm(), 1e-15);
}

TEST(Edits, BeyondTheRangeSpaceMovesRigidly) {
  for (const int which : {0, 1, 2}) {
    Bend bend = bendOf(120);
    Twist twist{centred(), 2};
    Stretch stretch{centred(), 3};
    for (Spine* s : {&bend.spine, &twist.spine, &stretch.spine}) {
      s->pivot.reset();
      s->from = 0.25, s->to = 0.75;
    }
    const EditMap map(zLine(), which == 0 ? edit(bend) : which == 1 ? edit(twist) : edit(stretch));
    std::vector<Vec3> above, below;
    for (std::uint64_t i = 0; i < 30; ++i) {
      const Vec3 x = somePoint(i);
      above.push_back(x + Vec3(0, 0, 1.6));
      below.push_back(x - Vec3(0, 0, 1.6));
    }
    for (std::size_t i = 1; i < above.size(); ++i) {
      EXPECT_NEAR((map(above[i]) - map(above[0])).norm(), (above[i] - above[0]).norm(), 2e-15 * 4);
      EXPECT_TRUE(map(below[i]) == below[i] || (map(below[i]) - below[i]).norm() < 1e-15) << "rooted at `from`";
    }
  }
}

// The line keeps its length element by element: |dC/ds| = 1, by central differences (error h^2 k^2 / 6 = 1e-11).
TEST(Edits, BendKeepsLengthAlongTheLine) {
  const EditMap map(zLine(), edit(bendOf(200)));
  for (double z = -1.5; z < 1.5; z += 0.0917) {
    const double h = 1e-5;
    EXPECT_NEAR((map(Vec3(0, 0, z + h)) - map(Vec3(0, 0, z - h))).norm() / (2 * h), 1, 1e-9);
  }
}

TEST(Edits, SmallBendsAreContinuous) {
  const Vec3 x(0.3, 0.2, 0.9);
  const double small = 0.99e-4, h = 0.02e-4;  // on both sides of the series' switch
  const auto at = [&](double angle) { return EditMap(zLine(), edit([&] { Bend b = bendOf(0); b.angle = angle; return b; }()))(x); };
  // Second difference of a smooth function: h^2 x'' = 4e-12 at most.
  EXPECT_LT((at(small + h) - 2 * at(small) + at(small - h)).norm(), 1e-11);
  EXPECT_LT((at(1e-12) - x).norm(), 2e-12);
}

TEST(Edits, TwistTurnsSectionsAndRollsLinesAlongIt) {
  Skeleton s = zLine(5);
  Primitive off = s.primitives[0], reversed = s.primitives[0], bar = s.primitives[0];
  off.name = "off";
  for (Vec3& x : off.points) x += Vec3(0.12, 0, 0);
  reversed.name = "reversed";
  std::reverse(reversed.points.begin(), reversed.points.end());
  bar.name = "bar";
  bar.points = {Vec3(-0.5, 0, 0.5), Vec3(0.5, 0, 0.5)};
  s.primitives.insert(s.primitives.end(), {off, reversed, bar});
  const double angle = kPi;
  const Skeleton posed = applyEdits(s, std::vector{edit(Twist{centred(), angle}, "")});
  for (std::size_t i = 0; i < 5; ++i) {
    const double z = -1 + 0.5 * static_cast<double>(i), phi = angle * z / 2;
    EXPECT_LT((posed.primitives[1].points[i] - Vec3(0.12 * std::cos(phi), 0.12 * std::sin(phi), z)).norm(), 1e-15);
    EXPECT_NEAR(posed.primitives[0].roll[i], phi, 1e-15);
    EXPECT_NEAR(posed.primitives[2].roll[4 - i], -phi, 1e-15);
    // Off the axis the line leans: it takes up the cosine of its slope.
    const double chord = 0.5 / std::hypot(0.5, 2 * 0.12 * std::sin(angle / 8));
    EXPECT_NEAR(posed.primitives[1].roll[i], phi * chord, 1e-14);
  }
  EXPECT_TRUE(posed.primitives[3].roll.empty() || std::abs(posed.primitives[3].roll[1]) < 1e-15);
  EXPECT_TRUE(sameBits(posed.primitives[0].points, s.primitives[0].points)) << "on the axis nothing moves";
}

TEST(Edits, RollOfATwistKnowsNoDirectionOfALine) {
  Skeleton s = zLine(9), reversed = s;
  for (std::uint64_t i = 0; i < 9; ++i) s.primitives[0].points[i] += somePoint(i, 0.4);
  reversed.primitives[0].points.assign(s.primitives[0].points.rbegin(), s.primitives[0].points.rend());
  const std::vector<Edit> edits = {edit(Twist{centred(), 2})};
  const Skeleton a = applyEdits(s, edits), b = applyEdits(reversed, edits);
  // About a tangent that runs the other way the same turn has the other sign.
  for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(a.primitives[0].roll[i], -b.primitives[0].roll[8 - i], 1e-14);
}

TEST(Edits, TaperScalesSectionsAndRadii) {
  const EditMap map(zLine(), edit(Taper{centred(), 0.25}));
  EXPECT_LT((map(Vec3(0.4, 0.2, 1)) - Vec3(0.1, 0.05, 1)).norm(), 1e-16);
  EXPECT_LT((map(Vec3(0.4, 0.2, 0)) - 0.625 * Vec3(0.4, 0.2, 0)).norm(), 1e-16);
  EXPECT_LT((map(Vec3(0.4, 0.2, 7)) - Vec3(0.1, 0.05, 7)).norm(), 1e-16);
  EXPECT_EQ(map(Vec3(0.4, 0.2, -3)), Vec3(0.4, 0.2, -3));
  const Skeleton posed = applyEdits(zLine(3), std::vector{edit(Taper{centred(), 0.25})});
  EXPECT_EQ(posed.primitives[0].pointRadius, (std::vector<double>{0.5, 0.5 * 0.625, 0.125}));
  Skeleton bare = zLine();
  bare.primitives[0].radius.reset();
  EXPECT_THROW(applyEdits(bare, std::vector{edit(Taper{centred(), 0.25})}), std::invalid_argument);
  fillRadius(bare, 2);
  EXPECT_EQ(applyEdits(bare, std::vector{edit(Taper{centred(), 0.5})}).primitives[0].pointRadius.back(), 1);
}

TEST(Edits, StretchIsTheClosedForm) {
  const EditMap map(zLine(), edit(Stretch{centred(), 2}));
  for (std::uint64_t i = 0; i < 50; ++i) {
    const Vec3 x = somePoint(i, 4);
    EXPECT_LT((map(x) - (x + Vec3(0, 0, std::clamp(x.z(), -1.0, 1.0)))).norm(), 1e-15);
  }
}

TEST(Edits, RotateTurnsPointSetsAndScaleTheirRadii) {
  Primitive tip;
  tip.name = "tip";
  tip.type = PrimitiveType::Points;
  tip.points = {Vec3(1, 0, 0), Vec3(2, 0, 0)};
  tip.radius = 0.25;
  const Skeleton rest{{tip}, {}};
  Rotate quarter{kPi / 2, Vec3::UnitZ(), Vec3::Zero()};
  const Skeleton posed = applyEdits(rest, std::vector{edit(quarter, "tip"), edit(Scale{Vec3(3, 3, 3), Vec3::Zero()}, "")});
  EXPECT_LT((posed.primitives[0].points[1] - Vec3(0, 6, 0)).norm(), 4e-15);
  EXPECT_LT((*posed.primitives[0].rotation * Vec3::UnitX() - Vec3::UnitY()).norm(), 1e-15);
  EXPECT_EQ(posed.primitives[0].radius, 0.75);
  const Skeleton uneven = applyEdits(rest, std::vector{edit(Scale{Vec3(3, 1, 1), Vec3::Zero()}, "tip")});
  EXPECT_EQ(uneven.primitives[0].radius, 0.25);
  EXPECT_EQ(uneven.primitives[0].points[1], Vec3(6, 0, 0));
}

TEST(Edits, PressLeavesNothingBeyondThePlane) {
  const Vec3 normal = Vec3(1, 2, 2) / 3;
  for (const double softness : {0.0, 0.3}) {
    Press press{Vec3(0.1, 0, 0), 5 * normal, softness};
    const EditMap map(zLine(), edit(press));
    double last = -10;
    for (double h = -1; h < 1; h += 0.01) {
      const Vec3 x = Vec3(0.1, 0, 0) + h * normal, y = map(x);
      const double height = normal.dot(y - Vec3(0.1, 0, 0));
      EXPECT_LE(height, 1e-15);
      EXPECT_GE(height, last - 1e-15) << "no point overtakes another";
      last = height;
      if (h < -softness - 1e-12) {
        EXPECT_EQ(y, x);
      }
      if (h > softness) {
        EXPECT_NEAR(height, 0, 1e-15);
      }
    }
  }
}

TEST(Edits, MoveAndReplace) {
  const Skeleton rest = zLine(5);
  const Skeleton moved = applyEdits(rest, std::vector{edit(MovePoints{{1, 3}, {Vec3(1, 0, 0), Vec3(0, 1, 0)}})});
  EXPECT_EQ(moved.primitives[0].points[1], Vec3(1, 0, -0.5));
  EXPECT_EQ(moved.primitives[0].points[3], Vec3(0, 1, 0.5));
  EXPECT_EQ(moved.primitives[0].points[2], rest.primitives[0].points[2]);
  Replace replace{zLine(7).primitives[0]};
  replace.with.name = "other";
  const Skeleton replaced = applyEdits(rest, std::vector{edit(replace)});
  EXPECT_EQ(replaced.primitives[0].name, "spine");
  EXPECT_EQ(pairSkeletons(rest, replaced).pairs[0].kind, PairKind::Replaced);
  EXPECT_THROW(applyEdits(rest, std::vector{edit(Replace{zLine(3).primitives[0]}), edit(MovePoints{{4}, {Vec3::UnitX()}})}),
               std::invalid_argument);
}

TEST(Edits, TimeZeroIsTheRestAndTimeOneTheEditBitForBit) {
  Skeleton rest = zLine();
  rest.primitives[0].points[4].x() = -0.0;
  const std::vector<Edit> edits = oneOfEach();
  const Skeleton start = applyEditsAt(rest, edits, 0), end = applyEditsAt(rest, edits, 1), full = applyEdits(rest, edits);
  EXPECT_TRUE(sameBits(start.primitives[0].points, rest.primitives[0].points));
  EXPECT_TRUE(start.primitives[0].roll.empty());
  EXPECT_TRUE(sameBits(end.primitives[0].points, full.primitives[0].points));
  EXPECT_EQ(end.primitives[0].pointRadius, full.primitives[0].pointRadius);
  EXPECT_FALSE(sameBits(end.primitives[0].points, rest.primitives[0].points));
}

TEST(Edits, HalfTimeIsHalfTheParameter) {
  const Skeleton rest = zLine();
  const auto pointsAt = [&](const Edit& e, double t) { return applyEditsAt(rest, std::vector{e}, t).primitives[0].points; };
  EXPECT_TRUE(sameBits(pointsAt(edit(bendOf(90)), 0.5), pointsAt(edit(bendOf(45)), 1)));
  EXPECT_TRUE(sameBits(pointsAt(edit(Stretch{centred(), 3}), 0.5), pointsAt(edit(Stretch{centred(), 2}), 1)));
  EXPECT_TRUE(sameBits(pointsAt(edit(Translate{Vec3(2, 4, 6)}), 0.5), pointsAt(edit(Translate{Vec3(1, 2, 3)}), 1)));
}

TEST(Edits, WithoutEffectKeepEveryBit) {
  Skeleton rest = zLine();
  for (std::size_t i = 0; i < rest.primitives[0].points.size(); ++i) rest.primitives[0].points[i] += somePoint(i, 0.3);
  rest.primitives[0].points[7].y() = -0.0;
  Bend bend;
  bend.angle = 0;
  for (const Edit& e : {edit(bend), edit(Twist{}), edit(Taper{}), edit(Stretch{}), edit(Translate{}), edit(Rotate{}), edit(Scale{}),
                        edit(Press{Vec3(0, 0, 9), Vec3::UnitZ(), 0})}) {
    const Skeleton posed = applyEdits(rest, std::vector{e});
    EXPECT_TRUE(sameBits(posed.primitives[0].points, rest.primitives[0].points)) << operationName(e);
    EXPECT_TRUE(posed.primitives[0].roll.empty() && posed.primitives[0].pointRadius.empty()) << operationName(e);
  }
}

TEST(Edits, ScalingByAPowerOfTwoScalesEveryBit) {
  Skeleton rest = zLine();
  for (std::size_t i = 0; i < rest.primitives[0].points.size(); ++i) rest.primitives[0].points[i] += somePoint(i, 0.3);
  Skeleton large = rest;
  for (Vec3& x : large.primitives[0].points) x *= 1024;
  *large.primitives[0].radius *= 1024;
  Bend bend, byRadius;
  bend.angle = 1.3;
  byRadius.radius = 0.7;
  Bend byLargeRadius;
  byLargeRadius.radius = 0.7 * 1024;
  const std::vector<Edit> edits = {edit(bend), edit(byRadius), edit(Twist{{}, 2}), edit(Taper{{}, 0.3}), edit(Stretch{{}, 1.9}),
                                   edit(Rotate{1, {}, {}}), edit(Scale{Vec3(1.1, 2, 3), {}}), edit(Press{Vec3(0, 0, 0.5), Vec3(1, 1, 1), 0.1})};
  std::vector<Edit> largeEdits = edits;
  largeEdits[1] = edit(byLargeRadius);
  largeEdits.back() = edit(Press{Vec3(0, 0, 512), Vec3(1, 1, 1), 102.4});
  const Skeleton a = applyEdits(rest, edits), b = applyEdits(large, largeEdits);
  for (std::size_t i = 0; i < a.primitives[0].points.size(); ++i) {
    EXPECT_EQ(1024 * a.primitives[0].points[i], b.primitives[0].points[i]);
    EXPECT_EQ(1024 * a.primitives[0].pointRadius[i], b.primitives[0].pointRadius[i]);
    EXPECT_EQ(a.primitives[0].roll[i], b.primitives[0].roll[i]);
  }
}

TEST(Edits, ResolvedEditsRepeatTheResultExactly) {
  Skeleton rest = zLine();
  for (std::size_t i = 0; i < rest.primitives[0].points.size(); ++i) rest.primitives[0].points[i] += somePoint(i, 0.3);
  Bend bend;
  bend.radius = 0.9;
  const std::vector<Edit> edits = {edit(Twist{{}, 1}), edit(bend), edit(Rotate{1, {}, {}}), edit(Scale{Vec3(2, 2, 2), {}})};
  const std::vector<Edit> resolved = resolve(rest, edits);
  EXPECT_TRUE(std::get<Bend>(resolved[1].operation).angle && std::get<Bend>(resolved[1].operation).spine.pivot);
  const Skeleton a = applyEdits(rest, edits), b = applyEdits(rest, resolved);
  for (std::size_t i = 0; i < a.primitives[0].points.size(); ++i)
    EXPECT_LT((a.primitives[0].points[i] - b.primitives[0].points[i]).norm(), 1e-14);
  // Resolving again changes nothing any more.
  EXPECT_TRUE(sameBits(applyEdits(rest, resolve(rest, resolved)).primitives[0].points, b.primitives[0].points));
}

TEST(Edits, MistakesAreRefusedAtAnyTime) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Skeleton rest = zLine();
  Bend none = bendOf(90), both = bendOf(90), along = bendOf(90), badRange = bendOf(90), zero = bendOf(90);
  none.angle.reset();
  both.radius = 1;
  along.about = Vec3(0, 0, 2);
  badRange.spine.from = badRange.spine.to = 0.5;
  zero.spine.axis = Vec3::Zero();
  Bend across = bendOf(90);
  across.spine.axis = Vec3::UnitX();
  for (const Edit& e : {edit(none), edit(both), edit(along), edit(badRange), edit(zero), edit(across), edit(bendOf(nan)), edit(bendOf(90), "spin"),
                        edit(Taper{{}, 0}), edit(Taper{{}, nan}), edit(Stretch{{}, -1}), edit(Scale{Vec3(1, 0, 1), {}}), edit(Translate{Vec3(0, nan, 0)}),
                        edit(Twist{{}, INFINITY}), edit(Rotate{nan, {}, {}}), edit(MovePoints{{33}, {Vec3::Zero()}}), edit(MovePoints{{1, 2}, {}}),
                        edit(MovePoints{{1, 1}, {Vec3::Zero()}}), edit(MovePoints{{1}, {Vec3::Zero()}}, ""), edit(Press{Vec3::Zero(), Vec3::Zero(), 0}),
                        edit(Press{Vec3::Zero(), Vec3::UnitX(), -1}), edit(Replace{})})
    for (const double t : {0.0, 1.0}) EXPECT_THROW(applyEditsAt(rest, std::vector{e}, t), std::invalid_argument) << operationName(e);
  EXPECT_THROW(applyEditsAt(rest, {}, nan), std::invalid_argument);
  EXPECT_THROW(applyEditsAt(rest, {}, 1.5), std::invalid_argument);
  EXPECT_THROW(EditMap(rest, edit(MovePoints{{1}, {Vec3::Zero()}})), std::invalid_argument);
  EXPECT_THROW(applyEdits(rest, std::vector{edit(Translate{Vec3(1e308, 0, 0)}), edit(Translate{Vec3(1e308, 0, 0)})}), std::invalid_argument);
}

TEST(Subdivide, KeepsCornersAndRespectsTheLength) {
  Skeleton s = zLine(3);
  s.primitives[0].points[2] = Vec3(0.7, 0, 0);
  s.primitives[0].pointRadius = {1, 2, 3};
  s.primitives[0].roll = {0, 1, 0};
  s.primitives[0].closed = true;
  const Primitive p = subdivide(s, 0.25).primitives[0];
  EXPECT_EQ(p.points.size(), 4u + 3u + 5u);  // lengths 1, 0.7 and 1.22
  for (std::size_t i = 0; i < p.points.size(); ++i) EXPECT_LE((p.points[(i + 1) % p.points.size()] - p.points[i]).norm(), 0.25 + 1e-12);
  EXPECT_EQ(p.points[4], s.primitives[0].points[1]);
  EXPECT_EQ(p.pointRadius[2], 1.5);
  EXPECT_EQ(p.roll[2], 0.5);
  EXPECT_TRUE(sameBits(subdivide(zLine(), 1e9).primitives[0].points, zLine().primitives[0].points));
  EXPECT_EQ(subdivide(zLine(2), 0.2).primitives[0].points.size(), 11u);
  EXPECT_THROW(subdivide(s, 1e-12), std::invalid_argument);
  EXPECT_THROW(subdivide(s, 0), std::invalid_argument);
}

Bulk bulkOfPoints(std::vector<Vec3> points) {
  Primitive p;
  p.name = "p";
  p.type = PrimitiveType::Points;
  p.points = std::move(points);
  const Primitive* list[] = {&p};
  return bulkOf(list);
}

TEST(PrincipalAxes, FollowLargestVarianceWithPositiveLargestComponent) {
  const Skeleton rest = zLine();
  const Primitive* list[] = {&rest.primitives[0]};
  EXPECT_LT((autoAxis(bulkOf(list)) - Vec3::UnitZ()).norm(), 1e-15);
  // Length-weighted: a crowd of points at one end does not pull the centre.
  Primitive crowded = rest.primitives[0];
  crowded.points = {Vec3(0, 0, -1), Vec3(0, 0, -0.99), Vec3(0, 0, -0.98), Vec3(0, 0, 1)};
  list[0] = &crowded;
  EXPECT_LT(bulkOf(list).centre.norm(), 1e-15);
  EXPECT_NEAR(bulkOf(list).covariance(2, 2), 1.0 / 3, 1e-15);  // variance of [-1, 1]
  const Bulk tilted = bulkOfPoints({Vec3(3, -9, 1), Vec3(-3, 9, -1), Vec3(1, 0, 0), Vec3(-1, 0, 0)});
  EXPECT_GT(autoAxis(tilted).y(), 0.9);
  EXPECT_NEAR(autoAbout(tilted, autoAxis(tilted)).dot(autoAxis(tilted)), 0, 1e-15);
  EXPECT_GT(autoAbout(tilted, autoAxis(tilted)).x(), 0.9);
}

TEST(PrincipalAxes, TiesGoToTheLongestSideThenXYZ) {
  EXPECT_EQ(autoAxis(bulkOfPoints({Vec3(1, 0, 0), Vec3(-1, 0, 0), Vec3(0, 1, 0), Vec3(0, -1, 0)})), Vec3::UnitX());
  EXPECT_EQ(autoAxis(bulkOfPoints({Vec3(1, 0, 0), Vec3(-1, 0, 0), Vec3(0, 1.004, 0), Vec3(0, -1.004, 0)})), Vec3::UnitX());
  EXPECT_EQ(autoAxis(bulkOfPoints({Vec3(1, 0, 0), Vec3(-1, 0, 0), Vec3(0, 1.1, 0), Vec3(0, -1.1, 0)})), Vec3::UnitY());
  EXPECT_EQ(autoAxis(bulkOfPoints({Vec3(5, 5, 5)})), Vec3::UnitX());
  // Two equal variances, but one box side is longer.
  EXPECT_EQ(autoAxis(bulkOfPoints({Vec3(1, 0, 0), Vec3(-1, 0, 0), Vec3(0, std::sqrt(2), 0), Vec3(0, -std::sqrt(2), 0), Vec3(1, 0, 0), Vec3(-1, 0, 0)})),
            Vec3::UnitY());
  // A thin line has no second direction: x, or y for a line along x.
  const Bulk thinZ = bulkOfPoints({Vec3(0, 0, 0), Vec3(0, 0, 1)}), thinX = bulkOfPoints({Vec3(0, 0, 0), Vec3(1, 0, 0)});
  EXPECT_EQ(autoAbout(thinZ, autoAxis(thinZ)), Vec3::UnitX());
  EXPECT_EQ(autoAbout(thinX, autoAxis(thinX)), Vec3::UnitY());
}

}  // namespace
}  // namespace fielddeform::skeleton
