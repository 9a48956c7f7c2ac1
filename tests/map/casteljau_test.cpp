#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/map/casteljau_io.h>
#include <fielddeform/map/detail/casteljau_kernels.h>
#include <gtest/gtest.h>
#include <tests/map/lattices.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace fielddeform::map {
namespace {

using test::randomPoint;

/// A curve near the straight one, every handle of every level shaken.
CasteljauCurve shaken(const LatticeBox& frame, int degree, std::vector<double> lengths, std::uint64_t seed, double size) {
  CasteljauCurve curve = straightCurve(frame, degree, lengths);
  std::uint64_t i = 0;
  for (CasteljauPiece& piece : curve.pieces) {
    for (Vec3& p : piece.points) p += size * randomPoint(seed, i++);
    for (auto* handles : {&piece.s, &piece.t}) {
      handles->resize(static_cast<std::size_t>(degree));
      for (std::size_t j = 0; j < handles->size(); ++j) {
        (*handles)[j].resize(static_cast<std::size_t>(degree) - j, Vec3::Zero());
        for (Vec3& h : (*handles)[j]) h += size * randomPoint(seed, i++);
      }
    }
  }
  return curve;
}

/// The paper's recurrence as printed, by function calls.
Vec3 recurrence(const CasteljauPiece& p, int j, int i, const Vec3& u) {
  const auto a = static_cast<std::size_t>(i), b = static_cast<std::size_t>(j - 1);
  if (j == 0) return p.points[a];
  const auto handle = [&](const auto& levels) { return b < levels.size() && !levels[b].empty() ? levels[b][a] : Vec3(Vec3::Zero()); };
  return (1 - u.x()) * recurrence(p, j - 1, i, u) + u.x() * recurrence(p, j - 1, i + 1, u) + u.y() * handle(p.s) + u.z() * handle(p.t);
}

std::vector<Vec3> applied(const CasteljauMap& map, Points points, std::vector<Status>* status = nullptr) {
  std::vector<Vec3> out(points.size());
  std::vector<Status> s(points.size());
  Progress silent;
  map.apply(*map.bind(points), {.position = out, .safe = {}, .status = s, .residual = {}}, silent);
  if (status) *status = s;
  return out;
}

TEST(Casteljau, IsThePapersRecurrenceForAnyDegree) {
  const LatticeBox frame = test::skewBox();
  for (const int degree : {1, 2, 3, 4, 7, 12}) {
    const CasteljauCurve curve = shaken(frame, degree, {1}, 3, .5);
    const CasteljauMap map(curve, frame);
    for (std::uint64_t k = 0; k < 20; ++k) {
      const Vec3 u(uniform01(9, k), randomPoint(5, k).y(), randomPoint(5, k).z());
      const Vec3 wanted = recurrence(curve.pieces[0], degree, 0, u);
      // Rounding of sizes of about 5 and of the frame's inverse.
      EXPECT_LT((map.position(frame.origin + frame.axes * u) - wanted).norm(), 1e-12) << degree;
      for (int j = 0; j <= degree && degree <= 4; ++j) {
        const std::vector<Vec3> level = casteljauLevel(curve.pieces[0], j, u);
        ASSERT_EQ(level.size(), static_cast<std::size_t>(degree - j + 1));
        for (int i = 0; i <= degree - j; ++i) EXPECT_LT((level[static_cast<std::size_t>(i)] - recurrence(curve.pieces[0], j, i, u)).norm(), 1e-13);
      }
    }
  }
}

TEST(Casteljau, AStraightCurveLeavesEveryBit) {
  const LatticeBox frame = test::skewBox();
  const std::vector<Vec3> points = test::cloud(1, 200);
  for (const int degree : {1, 2, 5}) {
    std::vector<Status> status;
    EXPECT_EQ(applied(CasteljauMap(straightCurve(frame, degree, std::vector{1.0, 2.5}), frame), points, &status), points);
    EXPECT_EQ(countStatuses(status)[static_cast<std::size_t>(Status::Fixed)], points.size());
  }
}

TEST(Casteljau, ReproducesAffineMaps) {
  const LatticeBox frame = test::skewBox();
  Mat3 a;
  a << 1.2, .3, -.1, .2, .7, .4, -.5, .1, 1.5;
  const Vec3 b(3, -1, 2);
  CasteljauCurve curve = straightCurve(frame, 4, std::vector{1.0, 3.0, .2});
  for (CasteljauPiece& p : curve.pieces) {
    for (Vec3& x : p.points) x = a * x + b;
    for (Vec3& h : p.s[0]) h = a * h;
    for (Vec3& h : p.t[0]) h = a * h;
  }
  const CasteljauMap map(curve, frame);
  for (const Vec3& x : test::cloud(2, 100)) EXPECT_LT((map.position(3 * x) - (a * (3 * x) + b)).norm(), 2e-13);  // also outside
}

TEST(Casteljau, JacobiansAreTheDerivatives) {
  const LatticeBox frame = test::skewBox();
  const CasteljauMap map(shaken(frame, 4, {1, 2}, 4, .3), frame);
  // h^2 of third derivatives of about 10, and rounding / h; points on the joint of an unjoined curve are left out.
  const double h = 1e-5;
  for (std::uint64_t k = 0; k < 60; ++k) {
    const Vec3 x = 2.5 * randomPoint(7, k);
    std::vector<Vec3> around{x};
    for (int c = 0; c < 3; ++c) around.push_back(x + h * Vec3::Unit(c)), around.push_back(x - h * Vec3::Unit(c));
    const std::vector<Vec3> out = applied(map, around);
    Mat3 j;
    map.jacobians(*map.bind({&x, 1}), {&j, 1});
    const double u = (frame.axes.inverse() * (x - frame.origin)).x();
    if (std::abs(u - 1.0 / 3) < 1e-3 || std::abs(u) < 1e-3 || std::abs(u - 1) < 1e-3) continue;
    for (int c = 0; c < 3; ++c) EXPECT_LT((j.col(c) - (out[static_cast<std::size_t>(2 * c + 1)] - out[static_cast<std::size_t>(2 * c + 2)]) / (2 * h)).norm(), 1e-8);
  }
}

TEST(Casteljau, ZeroHandlesCollapseTheSolidAsThePaperSays) {
  const LatticeBox frame;
  CasteljauCurve curve = shaken(frame, 3, {1}, 5, .3);
  CasteljauPiece& piece = curve.pieces[0];
  // s = 0 at every level: v has no effect, a patch is left.
  piece.s.clear();
  for (const double v : {0.0, .4, -3.0})
    EXPECT_EQ(casteljauLevel(piece, 3, Vec3(.3, v, .6))[0], casteljauLevel(piece, 3, Vec3(.3, 0, .6))[0]);
  // Both: the classic Bezier curve.
  piece.t.clear();
  const double u = .3;
  const auto& p = piece.points;
  const Vec3 bezier = std::pow(1 - u, 3) * p[0] + 3 * u * std::pow(1 - u, 2) * p[1] + 3 * u * u * (1 - u) * p[2] + u * u * u * p[3];
  EXPECT_LT((casteljauLevel(piece, 3, Vec3(u, 5, -2))[0] - bezier).norm(), 1e-14);
  // Handles above level 1 zero: the images of the segments are blended linearly.
  const CasteljauCurve plain = shaken(frame, 2, {1}, 6, .3);
  CasteljauPiece quadratic = plain.pieces[0];
  quadratic.s[1] = quadratic.t[1] = {};
  const Vec3 uvw(.7, .2, .9);
  const auto first = casteljauLevel(quadratic, 1, uvw);
  EXPECT_LT((casteljauLevel(quadratic, 2, uvw)[0] - (.3 * first[0] + .7 * first[1])).norm(), 1e-15);
  // A handle of level 2 shears the whole by v along its direction.
  CasteljauPiece sheared = quadratic;
  sheared.s[1] = {Vec3(.1, 0, 0)};
  EXPECT_LT((casteljauLevel(sheared, 2, uvw)[0] - casteljauLevel(quadratic, 2, uvw)[0] - Vec3(.02, 0, 0)).norm(), 1e-15);
}

TEST(Casteljau, JoinedCurvesMakeAMapWithContinuousSlopes) {
  const LatticeBox frame = test::skewBox();
  for (const int degree : {3, 5}) {
    const CasteljauCurve loose = shaken(frame, degree, {1, 2.5, .5}, 8, .2), joined = joinC1(loose);
    EXPECT_GT(jointGaps(loose).slope, .1);
    const JointGaps gaps = jointGaps(joined);
    for (const double gap : {gaps.position, gaps.handle, gaps.slope, gaps.handleSlope}) EXPECT_LT(gap, 2e-13);  // slopes are about 10
    // The Jacobians of the map agree from both sides.
    const CasteljauMap map(joined, frame);
    for (const double knot : {.25, .875})
      for (std::uint64_t k = 0; k < 5; ++k) {
        const Vec3 u(knot, randomPoint(1, k).x(), randomPoint(1, k).y());
        const std::vector<Vec3> sides{frame.origin + frame.axes * (u - Vec3(1e-12, 0, 0)), frame.origin + frame.axes * (u + Vec3(1e-12, 0, 0))};
        std::vector<Mat3> j(2);
        map.jacobians(*map.bind(sides), j);
        EXPECT_LT((j[0] - j[1]).norm(), 1e-9);  // second derivatives times 1e-12
      }
    // What is not at a joint stays.
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t i = 1; i < static_cast<std::size_t>(degree); ++i) EXPECT_EQ(joined.pieces[k].points[i], loose.pieces[k].points[i]);
  }
  EXPECT_THROW(joinC1(straightCurve(frame, 2, std::vector{1.0, 1.0})), std::invalid_argument);
}

TEST(Casteljau, CarriesAlongTheTangentsBeyondTheEndsOrKeeps) {
  const LatticeBox frame;
  const CasteljauCurve curve = shaken(frame, 3, {1}, 11, .2);
  const CasteljauMap extend(curve, frame), keep(curve, frame, Outside::Keep);
  const Vec3 out(-.5, .3, -.2), at(0, .3, -.2);
  Mat3 j;
  extend.jacobians(*extend.bind({&at, 1}), {&j, 1});
  EXPECT_LT((extend.position(out) - (extend.position(at) - .5 * j.col(0))).norm(), 1e-14);
  EXPECT_EQ(keep.position(out), out);
  EXPECT_EQ(keep.position(Vec3(.5, .1, .1)), extend.position(Vec3(.5, .1, .1)));
  // Levels meet the map at the last one.
  const std::vector<Vec3> points{out, Vec3(.4, -1, 2), Vec3(1.7, .2, .2)};
  std::vector<Vec3> last(3);
  extend.level(*extend.bind(points), 3, 0, last);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_LT((last[i] - extend.position(points[i])).norm(), 1e-14);
}

std::vector<Vec3> arc(double angle, double length, int points) {
  std::vector<Vec3> out;
  for (int i = 0; i < points; ++i) {
    const double s = length * i / (points - 1), a = angle * i / (points - 1);
    out.push_back(angle == 0 ? Vec3(0, 0, s) : Vec3(length / angle * (1 - std::cos(a)), 0, length / angle * std::sin(a)));
  }
  return out;
}

TEST(Casteljau, LinesCarrySpaceAsASkeletonDoes) {
  const std::vector<Vec3> rest = arc(.8, 2, 9), points = test::cloud(3, 300);
  std::vector<Vec3> near;
  for (const Vec3& p : points) near.push_back(Vec3(.1, 0, 1) + p.cwiseProduct(Vec3(.4, .4, 1.5)));
  // Unedited: every bit.
  const CasteljauPair same = curvesAlong(rest, rest);
  EXPECT_EQ(applied(CasteljauMap(same.rest, same.posed), near), near);
  // Rigidly moved: rigidly, also beyond the ends.
  const Quat turn(Eigen::AngleAxisd(1.1, Vec3(1, 2, -.5).normalized()));
  std::vector<Vec3> moved;
  for (const Vec3& p : rest) moved.push_back(turn * p + Vec3(3, 1, -2));
  const CasteljauPair rigid = curvesAlong(rest, moved, std::vector<Quat>(rest.size(), turn));
  std::vector<Status> status;
  const std::vector<Vec3> out = applied(CasteljauMap(rigid.rest, rigid.posed), near, &status);
  EXPECT_EQ(countStatuses(status)[static_cast<std::size_t>(Status::Converged)], near.size());
  for (std::size_t i = 0; i < near.size(); ++i) EXPECT_LT((out[i] - (turn * near[i] + Vec3(3, 1, -2))).norm(), 2e-13);
  // Bent and straightened again: the maps are inverse to each other near the line.
  const std::vector<Vec3> straight = arc(0, 2, 9);
  const CasteljauPair bend = curvesAlong(straight, rest), back = curvesAlong(rest, straight);
  const CasteljauMap there(bend.rest, bend.posed), again(back.rest, back.posed);
  for (const Vec3& p : points) {
    const Vec3 x = Vec3(0, 0, 1) + p.cwiseProduct(Vec3(.4, .4, 1.2));
    EXPECT_LT((again.position(there.position(x)) - x).norm(), 1e-12);
  }
  // The ideal bend of a cross plane: within the square of a segment's angle, 0.1 / 8.
  const Vec3 x(.2, .1, 1), ideal(2 / .8 - (2 / .8 - .2) * std::cos(.4), .1, (2 / .8 - .2) * std::sin(.4));
  EXPECT_LT((there.position(x) - ideal).norm(), 1e-3);
  EXPECT_LT(jointGaps(bend.posed).handleSlope, 1e-12);
  EXPECT_LT(jointGaps(bend.posed).slope, 1e-12);
}

TEST(Casteljau, JacobiansOnACurvedRestAreTheDerivatives) {
  const CasteljauPair pair = curvesAlong(arc(.8, 2, 6), arc(-1.2, 2.5, 6));
  const CasteljauMap map(pair.rest, pair.posed);
  const double h = 1e-5;
  for (std::uint64_t k = 0; k < 30; ++k) {
    const Vec3 x = Vec3(.4, 0, 1) + .5 * randomPoint(12, k);
    Mat3 j;
    map.jacobians(*map.bind({&x, 1}), {&j, 1});
    for (int c = 0; c < 3; ++c) {
      const Vec3 e = h * Vec3::Unit(c);
      EXPECT_LT((j.col(c) - (map.position(x + e) - map.position(x - e)) / (2 * h)).norm(), 1e-7);  // second derivatives jump at joints
    }
  }
}

TEST(Casteljau, SaysWhichPointsItLeaves) {
  const LatticeBox frame;
  const CasteljauMap map(shaken(frame, 2, {1}, 1, .1), frame, Outside::Keep);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<Vec3> points{{.5, .5, .5}, {2, 0, 0}, {nan, 0, 0}};
  std::vector<Status> status;
  applied(map, points, &status);
  EXPECT_EQ(status, (std::vector{Status::Converged, Status::Fixed, Status::Invalid}));
  const CasteljauPair pair = curvesAlong(arc(3, 1, 5), arc(2, 1, 5));
  const std::vector<Vec3> more = test::cloud(5, 50);
  applied(CasteljauMap(pair.rest, pair.posed, Outside::Keep), more, &status);  // whatever it says, it ends
  EXPECT_THROW(CasteljauMap(pair.rest, straightCurve(frame, 3)), std::invalid_argument);
  EXPECT_THROW(curvesAlong(more, std::vector<Vec3>(3)), std::invalid_argument);
}

TEST(Casteljau, GivesTheSameBitsWithAllVectorInstructions) {
  const LatticeBox frame;
  for (const int degree : {1, 2, 3, 6}) {
    const CasteljauMap map(joinC1(shaken(frame, std::max(3, degree), {1, 2}, 8, .2)), frame), single(shaken(frame, degree, {1}, 9, .2), frame);
    std::vector<Vec3> points;
    for (std::uint64_t k = 0; k < 1003; ++k) points.push_back(randomPoint(3, k) + Vec3(.4, 0, 0));
    for (const CasteljauMap* m : {&map, &single})
      for (const auto level : {fielddeform::detail::SimdLevel::Baseline, fielddeform::detail::SimdLevel::Avx2, fielddeform::detail::SimdLevel::Avx512}) {
        if (level > fielddeform::detail::supportedSimdLevel()) break;
        const fielddeform::detail::SimdLimit limit(level);
        const std::vector<Vec3> out = applied(*m, points);
        for (std::size_t i = 0; i < points.size(); ++i) EXPECT_EQ(out[i], m->position(points[i]));
      }
  }
}

TEST(Casteljau, GivesTheSameBitsOnAnyNumberOfThreads) {
  const CasteljauPair pair = curvesAlong(arc(.8, 2, 6), arc(-1.2, 2.5, 6));
  const CasteljauMap map(pair.rest, pair.posed);
  const std::vector<Vec3> points = test::cloud(8, 5000);
  std::vector<std::vector<Vec3>> out;
  for (const int threads : {1, 5}) {
    const ThreadLimit limit(threads);
    out.push_back(applied(map, points));
  }
  EXPECT_EQ(out[0], out[1]);
}

TEST(Casteljau, FramesFollowTheLongestSide) {
  const std::vector<Vec3> points{{0, 0, 0}, {1, 4, 2}};
  const LatticeBox frame = fitFrame(points);
  EXPECT_EQ(frame.origin, Vec3(.5, 0, 1));
  EXPECT_EQ(frame.axes.col(0), Vec3(0, 4, 0));
  EXPECT_EQ(frame.axes.col(1), Vec3(0, 0, 1));
  EXPECT_EQ(frame.axes.col(2), Vec3(.5, 0, 0));
  EXPECT_GT(fitFrame(points, FrameAxis::Oriented).axes.determinant(), 0);
}

/// A number that counts what is done to it.
struct Counted {
  double value = 0;
  static inline int multiplications = 0, additions = 0, subtractions = 0;
  Counted(double v = 0) : value(v) {}
  friend Counted operator*(const Counted& a, const Counted& b) { return ++multiplications, Counted(a.value * b.value); }
  friend Counted operator+(const Counted& a, const Counted& b) { return ++additions, Counted(a.value + b.value); }
  friend Counted operator-(const Counted& a, const Counted& b) { return ++subtractions, Counted(a.value - b.value); }
};
struct Count {
  int multiplications = 0, additions = 0, subtractions = 0;
};
template <class F>
Count countOf(F&& call) {
  Counted::multiplications = Counted::additions = Counted::subtractions = 0;
  call();
  return {Counted::multiplications, Counted::additions, Counted::subtractions};
}

using CountedTriple = detail::Triple<Counted>;

Count recurrenceCount(std::size_t n) {
  std::vector<CountedTriple> x(n + 1), handles(n);
  return countOf([&] {
    for (std::size_t j = 1; j <= n; ++j) detail::nextLevel(x.data(), n + 2 - j, handles.data(), handles.data(), CountedTriple{});
  });
}
Count sweepCount(std::size_t n) {
  std::vector<CountedTriple> c(n + 1), handles(n);
  std::vector<Counted> b(n + 1);
  CountedTriple out;
  return countOf([&] { detail::sweep(n, c.data(), handles.data(), handles.data(), CountedTriple{}, b.data(), out); });
}
/// A tensor Bezier lattice of degrees (n, 1, 1) by repeated lerps (1 - u) a + u b, along u first; 1 - u etc. not counted.
Count latticeCount(std::size_t n) {
  const Counted a, b;
  const auto lerp = [&](CountedTriple& p, const CountedTriple& q) {
    for (std::size_t c = 0; c < 3; ++c) p[c] = a * p[c] + b * q[c];
  };
  const auto curve = [&](std::vector<CountedTriple> p) {
    for (std::size_t k = p.size() - 1; k > 0; --k)
      for (std::size_t i = 0; i < k; ++i) lerp(p[i], p[i + 1]);
    return p[0];
  };
  return countOf([&] {
    std::vector<CountedTriple> w;
    for (int k = 0; k < 2; ++k) {
      std::vector<CountedTriple> v;
      for (int j = 0; j < 2; ++j) v.push_back(curve(std::vector<CountedTriple>(n + 1)));
      w.push_back(curve(v));
    }
    curve(w);
  });
}

TEST(Casteljau, OperationsAreCountedBesideThePapersTable) {
  struct Row {
    std::size_t n;
    int latticeTimes, latticePlus, ours;
  };
  const Row paper[] = {{1, 42, 21, 9}, {2, 90, 45, 27}, {3, 144, 72, 54}};
  std::printf("operations a point (convention: an affine step p + u (q - p) + v s + w t is 9 multiplications and 9 additions, its 3\n"
              "subtractions q - p apart; a lattice of degrees (n, 1, 1) by lerps (1 - u) a + u b, along u first, 6 and 3 a lerp)\n");
  std::printf("%8s | %-31s | %-31s | %s\n", "degree", "paper: lattice, de Casteljau", "counted: lattice, de Casteljau", "closed form c + v S + w T");
  for (const Row& row : paper) {
    const Count l = latticeCount(row.n), d = recurrenceCount(row.n), s = sweepCount(row.n);
    std::printf("%8zu | %3d x %3d +, %3d x %3d +         | %3d x %3d +, %3d x %3d + %3d -  | %3d x %3d + %d -\n", row.n, row.latticeTimes, row.latticePlus, row.ours,
                row.ours, l.multiplications, l.additions, d.multiplications, d.additions, d.subtractions, s.multiplications, s.additions, s.subtractions);
    EXPECT_EQ(d.multiplications, row.ours);
    EXPECT_EQ(d.additions, row.ours);
    EXPECT_EQ(d.subtractions, row.ours / 3);  // not in the paper's table: a mismatch by its convention
    if (l.multiplications != row.latticeTimes || l.additions != row.latticePlus)
      std::printf("%8s mismatch: the paper's lattice of degree %zu has %d x and %d +, counted %d and %d\n", "", row.n, row.latticeTimes, row.latticePlus,
                  l.multiplications, l.additions);
    // The paper's cubic lattice is 24 lerps, those along u alone.
    EXPECT_EQ(l.multiplications, row.n == 3 ? 162 : row.latticeTimes);
    EXPECT_EQ(l.additions, row.n == 3 ? 81 : row.latticePlus);
  }
  std::printf("%8s mismatch: the paper's additions leave out the subtractions q - p of every step\n", "");
}

// The message of what reading a text throws; empty if it throws nothing.
std::string refusal(const std::string& text) {
  try {
    parseCasteljau(text, "c.json");
  } catch (const IoError& error) {
    return error.what();
  }
  return "";
}

TEST(CasteljauIo, KeepsEveryBit) {
  CasteljauFile file;
  file.curve = shaken(test::skewBox(), 4, {1, 1.0 / 3}, 2, .7);
  file.curve.pieces[1].s[1].clear();
  file.frame = test::skewBox();
  file.outside = Outside::Keep;
  const std::string text = formatCasteljau(file);
  EXPECT_EQ(parseCasteljau(text, "c.json"), file);
  file.frame = FrameAxis::Oriented;
  EXPECT_EQ(parseCasteljau(formatCasteljau(file), "c.json"), file);
  const auto path = std::filesystem::path(testing::TempDir()) / "casteljau_test.json";
  writeCasteljau(file, path);
  EXPECT_EQ(readCasteljau(path), file);
  std::filesystem::remove(path);
}

TEST(CasteljauIo, ReadsShortForms) {
  const CasteljauFile file = parseCasteljau(R"({"format": "fielddeform-casteljau", "version": 1, "joined": "c1", "pieces": [
    {"points": [[0,0,0],[1,0,0],[2,0,0],[3,0,0]], "s": [0,1,0], "t": [[0,0,1], [[0,0,0.5],[0,0,0]]]},
    {"points": [[3,0,0],[4,0,0],[5,1,0],[6,0,0]], "s": [0,2,0], "t": [[[0,0,1],[0,0,1],[0,0,1]]], "length": 2}]})", "c.json");
  EXPECT_EQ(file.curve.pieces[0].t[1][0], Vec3(0, 0, .5));
  EXPECT_LT(jointGaps(file.curve).handleSlope, 1e-14);
  EXPECT_LT(jointGaps(file.curve).slope, 1e-14);
  EXPECT_EQ(std::get<FrameAxis>(file.frame), FrameAxis::Auto);
}

TEST(CasteljauIo, NamesWhatIsWrongAndWhere) {
  const auto with = [](const std::string& piece, const std::string& more = "") {
    return refusal(R"({"format": "fielddeform-casteljau", "version": 1)" + more + R"(, "pieces": [)" + piece + "]}");
  };
  const std::string good = R"({"points": [[0,0,0],[1,0,0]], "s": [0,1,0], "t": [0,0,1]})";
  EXPECT_EQ(with(good), "");
  EXPECT_NE(with("").find("needs at least 1"), std::string::npos);
  EXPECT_NE(with(R"({"points": [[0,0,0]], "s": [], "t": []})").find("/pieces/0/points"), std::string::npos);
  EXPECT_NE(with(R"({"points": [[0,0,0],[1,0,0]], "s": [[],[]], "t": []})").find("at most 1"), std::string::npos);
  EXPECT_NE(with(R"({"points": [[0,0,0],[1,0,0]], "s": [[[0,0,0],[0,0,0]]], "t": []})").find("2 handles"), std::string::npos);
  EXPECT_NE(with(R"({"points": [[0,0,0],[1,0,0]], "s": [0,1], "t": []})").find("/pieces/0/s"), std::string::npos);
  EXPECT_NE(with(R"({"points": [[0,0,0],[1,0,0]], "t": []})").find("\"s\""), std::string::npos);
  EXPECT_NE(with(good, R"(, "frame": "w")").find("/frame"), std::string::npos);
  EXPECT_NE(with(good, R"(, "frame": {"origin": [0,0,0], "edges": [[1,0,0],[2,0,0],[0,0,1]]})").find("nearly in one plane"), std::string::npos);
  EXPECT_NE(with(good + "," + good, R"(, "joined": "c1")").find("degree 1"), std::string::npos);
  EXPECT_NE(with(R"({"points": [[0,0,0],[1,0,0]], "s": [], "t": [], "length": 0})").find("/length"), std::string::npos);
  EXPECT_NE(with(good + R"(,{"points": [[0,0,0],[1,0,0]], "s": [], "t": [], "length": 1e-13})").find("too short"), std::string::npos);
}

}  // namespace
}  // namespace fielddeform::map
