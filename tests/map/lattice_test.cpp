#include <fielddeform/core/detail/simd.h>
#include <fielddeform/core/parallel.h>
#include <gtest/gtest.h>
#include <tests/map/lattices.h>

#include <cmath>
#include <limits>
#include <stdexcept>

namespace fielddeform::map {
namespace {

using test::cloud;
using test::randomPoint;
using test::shaken;
using test::skewBox;

Lattice lattice(const AxisBasis& a, const AxisBasis& b, const AxisBasis& c, LatticeBox box = skewBox()) {
  Lattice l;
  l.box = box;
  l.axis = {a, b, c};
  return l;
}

// Every sort of axis, each beside two others.
std::vector<Lattice> everyLattice() {
  const std::vector<AxisBasis> axes = test::everyAxis();
  std::vector<Lattice> all;
  for (std::size_t i = 0; i < axes.size(); i += 2)
    all.push_back(shaken(lattice(axes[i], axes[(7 * i + 3) % axes.size()], axes[(5 * i + 11) % axes.size()]), i, 0.3));
  return all;
}

std::vector<Vec3> applied(const LinearMap& map, Points points, std::vector<Status>* status = nullptr) {
  std::vector<Vec3> position(points.size()), safe(points.size());
  std::vector<Status> statuses(points.size());
  std::vector<float> residual(points.size(), -1.0f);
  Progress progress;
  map.apply(*map.bind(points), {position, safe, statuses, residual}, progress);
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(residual[i], 0);
    EXPECT_TRUE(safe[i] == position[i] || !safe[i].allFinite());
  }
  if (status) *status = statuses;
  return position;
}

TEST(LatticeMap, IsThePlainSumOverAllNodes) {
  for (const Lattice& l : everyLattice()) {
    const LatticeMap map(l);
    for (std::uint64_t i = 0; i < 8; ++i) {
      const Vec3 x = randomPoint(1, i);
      EXPECT_LT((map.position(x) - x - test::slowDisplacement(l, x)).norm(), 1e-13);
    }
  }
}

TEST(LatticeMap, MeetsTheMovedCornersOfBernsteinAndCoincidentLattices) {
  for (const AxisBasis& axis : {AxisBasis::bernstein(4), AxisBasis::bspline(6, 3, Border::Coincident)}) {
    const Lattice l = shaken(lattice(axis, axis, axis), 2, 0.5);
    const LatticeMap map(l);
    const int last = axis.nodes() - 1;
    for (int corner = 0; corner < 8; ++corner) {
      const Index i = l.index(corner & 1 ? last : 0, corner & 2 ? last : 0, corner & 4 ? last : 0);
      EXPECT_LT((map.position(map.restNodes()[i]) - map.restNodes()[i] - l.displacements[i]).norm(), 1e-14);
    }
  }
}

TEST(LatticeMap, AffineMotionsOfTheNodesAreAffineMapsInsideAndOutside) {
  Mat3 m;
  m << 2, 0.1, 0, 0.3, 0.5, -0.2, 0, 0.4, 1.1;
  for (Lattice l : everyLattice()) {
    const std::vector<Vec3> rest = l.restNodes();
    for (std::size_t i = 0; i < rest.size(); ++i) l.displacements[i] = m * rest[i] + Vec3(1, 2, 3) - rest[i];
    const LatticeMap map(l);
    for (std::uint64_t i = 0; i < 20; ++i) {
      const Vec3 x = 4 * randomPoint(3, i);
      EXPECT_LT((map.position(x) - (m * x + Vec3(1, 2, 3))).norm(), 1e-11);  // slopes of short segments, times 4
      EXPECT_LT((map.jacobian(x) - m).norm(), 1e-11);
    }
  }
}

TEST(LatticeMap, JacobianIsTheCentralDifference) {
  const double h = 1e-5;
  for (const Lattice& l : everyLattice()) {
    if (l.axis[0].degree() * l.axis[1].degree() * l.axis[2].degree() == 0) continue;
    const LatticeMap map(l);
    const auto piece = [&](const Vec3& x) {
      const Vec3 u = l.box.axes.inverse() * (x - l.box.origin);
      std::array<int, 3> first{};
      for (int a = 0; a < 3; ++a) first[a] = u[a] < 0 ? -1 : u[a] > 1 ? -2 : l.axis[a].evaluate(u[a]).first;
      return first;
    };
    for (std::uint64_t i = 0; i < 20; ++i) {
      const Vec3 x = 3 * randomPoint(4, i);
      for (int k = 0; k < 3; ++k) {
        const Vec3 a = x - h * Vec3::Unit(k), b = x + h * Vec3::Unit(k);
        if (piece(a) != piece(b)) continue;  // a kink of a degree of one may lie between
        const Vec3 d = (map.position(b) - map.position(a)) / (2 * h);
        EXPECT_LT((map.jacobian(x).col(k) - d).norm(), 1e-6);  // h^2 times third derivatives of up to 1e4
      }
    }
  }
}

TEST(LatticeMap, IsContinuouslyDifferentiableAcrossTheBoxAndBetweenItsOutsides) {
  const AxisBasis axis = AxisBasis::bspline(5, 3, Border::Coincident);
  for (const Lattice& l : {shaken(lattice(axis, AxisBasis::bernstein(4), AxisBasis::bspline(4, 2, Border::Free)), 5, 0.4),
                           shaken(lattice(AxisBasis::bernstein(3), axis, axis), 6, 0.4)}) {
    const LatticeMap map(l);
    const auto at = [&](const Vec3& u) { return Vec3(l.box.origin + l.box.axes * u); };
    for (std::uint64_t i = 0; i < 200; ++i) {
      Vec3 u = 1.5 * randomPoint(7, i) + Vec3::Constant(0.5);  // beyond none, one, two or three faces
      const int k = static_cast<int>(i % 3);
      u[k] = i % 2 ? 1 : 0;
      const double e = 1e-9;
      const Vec3 a = at(u - e * Vec3::Unit(k)), b = at(u + e * Vec3::Unit(k));
      EXPECT_LT((map.position(a) - map.position(b)).norm(), 1e-6);  // 2e times a stretch of up to 100
      EXPECT_LT((map.jacobian(a) - map.jacobian(b)).norm(), 1e-7);  // e times second derivatives
    }
  }
}

TEST(LatticeMap, OutsideIsTheTangentOrLeftAlone) {
  const AxisBasis axis = AxisBasis::bernstein(4);
  Lattice l = shaken(lattice(axis, axis, axis, LatticeBox{}), 8, 0.4);
  const LatticeMap extended(l);
  l.outside = Outside::Keep;
  const LatticeMap kept(l);
  for (std::uint64_t i = 0; i < 50; ++i) {
    const Vec3 inside = 0.5 * (randomPoint(9, i) + Vec3::Ones());
    EXPECT_EQ(kept.position(inside), extended.position(inside));
    for (int k = 0; k < 3; ++k) {
      Vec3 face = inside, beyond = inside;
      face[k] = 1;
      beyond[k] = 1.7;
      const Vec3 tangent = extended.position(face) + 0.7 * extended.jacobian(face).col(k);
      EXPECT_LT((extended.position(beyond) - tangent).norm(), 1e-14);
      EXPECT_EQ(kept.position(beyond), beyond);
      EXPECT_EQ(kept.jacobian(beyond), Mat3::Identity());
    }
  }
  std::vector<Status> status;
  applied(kept, std::vector<Vec3>{Vec3(0.5, 0.5, 0.5), Vec3(0.5, 0.5, 1.5)}, &status);
  EXPECT_EQ(status[0], Status::Converged);
  EXPECT_EQ(status[1], Status::Fixed);
}

TEST(LatticeMap, UnmovedNodesKeepEveryBit) {
  const AxisBasis axis = AxisBasis::bspline(9, 3, Border::Free);
  Lattice l = lattice(axis, axis, axis);
  std::vector<Vec3> points = cloud(10, 2000);
  points[3] = Vec3(-0.0, 0.7, -0.0);
  std::vector<Status> status;
  const std::vector<Vec3> same = applied(LatticeMap(l), points, &status);
  EXPECT_EQ(same, points);
  EXPECT_TRUE(std::signbit(same[3].x()));
  EXPECT_EQ(countStatuses(status)[0], points.size());
  // One moved node reaches its support alone: the points of other cells keep their bits.
  l.displacements.assign(l.nodeCount(), Vec3::Zero());
  l.displacements[l.index(2, 2, 2)] = Vec3(0.1, 0, 0.2);
  const std::vector<Vec3> some = applied(LatticeMap(l), points, &status);
  std::size_t moved = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3 u = l.box.axes.inverse() * (points[i] - l.box.origin);
    const bool reached = u.maxCoeff() < 3.0 / 6;  // segments 0 to 2 of 6 see node 2
    EXPECT_EQ(status[i], reached ? Status::Converged : Status::Fixed);
    if (!reached) {
      EXPECT_EQ(some[i], points[i]);
    } else {
      EXPECT_EQ(some[i].y(), points[i].y());
    }
    moved += reached;
  }
  EXPECT_GT(moved, 50u);
}

TEST(LatticeMap, InvertsInsideAndOutsideWithACertificate) {
  for (const Lattice& wild : everyLattice()) {
    Lattice l = wild;
    for (Vec3& d : l.displacements) d *= 0.2 / std::max(l.axis[0].nodes(), std::max(l.axis[1].nodes(), l.axis[2].nodes()));
    const LatticeMap map(l);
    for (std::uint64_t i = 0; i < 5; ++i) {
      const Vec3 x = 1.5 * randomPoint(11, i);
      const LatticeMap::Inverse inverse = map.inverse(map.position(x), map.position(x), 1e-13);
      EXPECT_TRUE(inverse.found);
      EXPECT_LT(inverse.error, 1e-13);
      EXPECT_LT((inverse.rest - x).norm(), 1e-12);
    }
  }
}

TEST(LatticeMap, InverseNeverCertifiesAFoldOrAPointThatIsNotReached) {
  // Everything is pressed onto the plane x = 1/2 and mirrored.
  const AxisBasis axis = AxisBasis::bernstein(2);
  Lattice l = lattice(axis, axis, axis, LatticeBox{});
  for (const Vec3& p : l.restNodes()) l.displacements.push_back(Vec3(1 - 2 * p.x(), 0, 0));
  const LatticeMap mirror(l);
  const LatticeMap::Inverse folded = mirror.inverse(Vec3(0.2, 0.5, 0.5), Vec3(0.8, 0.5, 0.5), 1e-12);
  EXPECT_LT(folded.error, 1e-12);
  EXPECT_FALSE(folded.found);
  for (Vec3& d : l.displacements) d *= 0.5;
  const LatticeMap flat(l);
  const LatticeMap::Inverse missed = flat.inverse(Vec3(0.7, 0.5, 0.5), Vec3(0.8, 0.5, 0.5), 1e-12);
  EXPECT_NEAR(missed.error, 0.2, 1e-12);
  EXPECT_FALSE(missed.found);
  EXPECT_FALSE(flat.inverse(Vec3(std::nan(""), 0, 0), Vec3(0, 0, 0), 1).found);
}

TEST(LatticeMap, BasisCombineGatherAndApplyAreOneLinearMap) {
  for (const Lattice& l : everyLattice()) {
    const LatticeMap map(l);
    std::vector<Vec3> points = cloud(12, 50);
    for (std::size_t i = 0; i < 10; ++i) points[i] *= 3;  // some outside
    points[20].z() = std::nan("");
    const auto binding = map.bind(points);
    const SparseRows rows = map.basis(*binding);
    ASSERT_EQ(rows.rows(), points.size());
    ASSERT_EQ(rows.columns, map.nodeCount());
    std::vector<Vec3> combined(points.size()), gathered(map.nodeCount()), transposed(map.nodeCount(), Vec3::Zero());
    map.combine(*binding, map.displacements(), combined);
    const std::vector<Vec3> pull = cloud(13, points.size()), position = applied(map, points);
    map.gather(*binding, pull, gathered);
    for (std::size_t p = 0; p < points.size(); ++p) {
      Vec3 sum = Vec3::Zero();
      for (std::size_t e = rows.start[p]; e < rows.start[p + 1]; ++e) {
        EXPECT_NE(rows.value[e], 0);
        if (e > rows.start[p]) {
          EXPECT_LT(rows.column[e - 1], rows.column[e]);
        }
        sum += rows.value[e] * l.displacements[rows.column[e]];
        transposed[rows.column[e]] += rows.value[e] * pull[p];
      }
      if (p == 20) {
        EXPECT_EQ(combined[p], Vec3(Vec3::Zero()));
        EXPECT_EQ(position[p].x(), points[p].x());
        continue;
      }
      EXPECT_LT((combined[p] - sum).norm(), 1e-13 * (1 + sum.norm()));
      EXPECT_EQ(position[p], Vec3(points[p] + combined[p]));
      EXPECT_EQ(position[p], map.position(points[p]));
    }
    for (std::size_t i = 0; i < map.nodeCount(); ++i)
      EXPECT_LT((gathered[i] - transposed[i]).norm(), 1e-12 * (1 + transposed[i].norm()));
  }
}

TEST(LatticeMap, IsTheSameOnAnyNumberOfThreads) {
  const AxisBasis axis = AxisBasis::bspline(12, 3, Border::Coincident);
  const Lattice l = shaken(lattice(axis, AxisBasis::bernstein(5), axis), 14, 0.2);
  const LatticeMap map(l);
  const std::vector<Vec3> points = cloud(15, 20001), pull = cloud(16, points.size());
  std::vector<Vec3> first, firstGather;
  for (const int threads : {1, 2, 5}) {
    const ThreadLimit limit(threads);
    std::vector<Vec3> gathered(map.nodeCount());
    map.gather(*map.bind(points), pull, gathered);
    const std::vector<Vec3> position = applied(map, points);
    if (first.empty()) first = position, firstGather = gathered;
    EXPECT_EQ(position, first);
    EXPECT_EQ(gathered, firstGather);
  }
}

TEST(LatticeMap, IsTheSameInEveryKindOfVectorInstructions) {
  using fielddeform::detail::SimdLevel;
  std::vector<Lattice> lattices = everyLattice();
  const AxisBasis wide = AxisBasis::bspline(70, 3, Border::Coincident);
  lattices.push_back(shaken(lattice(wide, wide, wide), 30, 0.01));
  std::vector<Vec3> points = cloud(31, 500), pull = cloud(32, 500);
  for (std::size_t i = 0; i < 100; ++i) points[5 * i] *= 3;  // some outside
  for (const Lattice& l : lattices) {
    const LatticeMap map(l);
    std::vector<Vec3> first, firstGather;
    for (const SimdLevel level : {SimdLevel::Baseline, SimdLevel::Avx2, SimdLevel::Avx512}) {
      const fielddeform::detail::SimdLimit limit(level);
      std::vector<Vec3> gathered(map.nodeCount());
      map.gather(*map.bind(points), pull, gathered);
      const std::vector<Vec3> position = applied(map, points);
      if (first.empty()) first = position, firstGather = gathered;
      EXPECT_EQ(position, first) << toString(level);
      EXPECT_EQ(gathered, firstGather) << toString(level);
    }
  }
}

TEST(LatticeMap, ALargeLatticeGathersTheSameOnAnyNumberOfThreads) {
  const AxisBasis axis = AxisBasis::bspline(60, 3, Border::Coincident);
  const LatticeMap map(lattice(axis, axis, axis));
  const std::vector<Vec3> points = cloud(17, 5000), pull = cloud(18, points.size());
  std::vector<Vec3> gathered(map.nodeCount()), first;
  const auto binding = map.bind(points);
  double total = 0;
  for (const int threads : {1, 3}) {
    const ThreadLimit limit(threads);
    map.gather(*binding, pull, gathered);
    if (first.empty()) first = gathered;
    EXPECT_EQ(gathered, first);
  }
  Vec3 sum = Vec3::Zero(), expected = Vec3::Zero();
  for (const Vec3& g : gathered) sum += g;
  for (const Vec3& v : pull) expected += v;
  for (const Vec3& g : gathered) total += g.norm();
  EXPECT_LT((sum - expected).norm(), 1e-9);  // the functions add up to 1
  EXPECT_GT(total, 1000);
}

TEST(LatticeMap, TwoMillionNodesAreFine) {
  const AxisBasis axis = AxisBasis::bspline(128, 3, Border::Coincident);
  Lattice l = lattice(axis, axis, axis);
  l.displacements.assign(l.nodeCount(), Vec3(0.25, 0, 0));
  const LatticeMap map(std::move(l));
  const std::vector<Vec3> points = cloud(19, 300), moved = applied(map, points);
  for (std::size_t i = 0; i < points.size(); ++i) EXPECT_LT((moved[i] - points[i] - Vec3(0.25, 0, 0)).norm(), 1e-15);
  EXPECT_LE(map.basis(*map.bind(points)).value.size(), 64u * points.size());
}

TEST(LatticeMap, MorePiecesThanAShortNumberCountsAreFine) {
  std::vector<double> knots{0};
  for (int i = 0; i < 70000; ++i) knots.push_back(knots.back() + (i % 3 == 0 ? 0.5 : 1.0));
  const AxisBasis many = AxisBasis::withKnots(1, knots), two = AxisBasis::bernstein(2);
  const Lattice l = shaken(lattice(many, two, two), 33, 1e-6);
  const LatticeMap map(l);
  const std::vector<Vec3> points = cloud(34, 200), moved = applied(map, points);
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(moved[i], map.position(points[i]));
    const Vec3 u = l.box.axes.inverse() * (points[i] - l.box.origin);
    const AxisBasis::Values a = many.evaluate(u[0]);
    Vec3 d = Vec3::Zero();
    for (int k = 0; k < 2; ++k)
      for (int j = 0; j < 2; ++j)
        for (int q = 0; q < 2; ++q)
          d += a.weight[q] * (j ? u[1] : 1 - u[1]) * (k ? u[2] : 1 - u[2]) * l.displacements[l.index(a.first + q, j, k)];
    EXPECT_LT((moved[i] - points[i] - d).norm(), 1e-15);  // rounding of the points; of u, times 1e5 segments, times 1e-6
  }
}

TEST(LatticeMap, PowersOfTwoScaleEveryBit) {
  for (const Lattice& l : everyLattice())
    for (const double s : {1024.0, 0x1p-300, 0x1p500}) {
      Lattice scaled = l;
      scaled.box.origin *= s;
      scaled.box.axes *= s;
      for (Vec3& d : scaled.displacements) d *= s;
      const LatticeMap a(l), b(scaled);
      for (std::uint64_t i = 0; i < 20; ++i) {
        const Vec3 x = 2 * randomPoint(20, i);
        EXPECT_EQ(Vec3(s * a.position(x)), b.position(s * x));
        EXPECT_EQ(a.jacobian(x), b.jacobian(s * x));
      }
    }
}

TEST(LatticeMap, OtherScalesAndFarPlacesChangeItByRoundingOnly) {
  for (const Lattice& l : everyLattice()) {
    Lattice scaled = l, far = l;
    scaled.box.origin *= 1e3;
    scaled.box.axes *= 1e3;
    for (Vec3& d : scaled.displacements) d *= 1e3;
    const Vec3 shift(1e6, -2e6, 3e6);
    far.box.origin += shift;
    const LatticeMap a(l), b(scaled), c(far);
    for (std::uint64_t i = 0; i < 10; ++i) {
      const Vec3 x = randomPoint(21, i);
      EXPECT_LT((1e3 * a.position(x) - b.position(1e3 * x)).norm(), 1e-9);
      EXPECT_LT((a.position(x) + shift - c.position(x + shift)).norm(), 1e-7);  // 1e-16 of 4e6, times a derivative of ~10
    }
  }
}

TEST(LatticeMap, WhatIsNotFiniteComesBackAsItIs) {
  const AxisBasis axis = AxisBasis::bernstein(4);
  const LatticeMap map(shaken(lattice(axis, axis, axis), 22, 0.3));
  const double inf = std::numeric_limits<double>::infinity();
  const std::vector<Vec3> points{Vec3(0, inf, 0), Vec3(0, 0, 0), Vec3(1e300, 1e300, -1e300), Vec3(1, std::nan(""), 2)};
  std::vector<Status> status;
  const std::vector<Vec3> moved = applied(map, points, &status);
  EXPECT_EQ(moved[0], points[0]);
  EXPECT_EQ(moved[2], points[2]);  // its image would be beyond double
  EXPECT_EQ(moved[3].x(), 1);
  EXPECT_EQ(status, (std::vector<Status>{Status::Invalid, Status::Converged, Status::Invalid, Status::Invalid}));
  std::vector<Mat3> jacobian(4);
  map.jacobians(*map.bind(points), jacobian);
  EXPECT_EQ(jacobian[0], Mat3::Identity());
  EXPECT_EQ(jacobian[1], map.jacobian(points[1]));
}

TEST(LatticeMap, AnImageBeyondDoubleLeavesThePointAndItsNeighboursAreFine) {
  const AxisBasis axis = AxisBasis::bernstein(2);
  LatticeBox box;
  box.axes *= 1e308;
  Lattice l = lattice(axis, axis, axis, box);
  l.displacements.assign(8, Vec3(1e308, 0, 0));
  const std::vector<Vec3> points{Vec3(9e307, 0, 0), Vec3(1e307, 0, 0)};
  std::vector<Status> status;
  const std::vector<Vec3> moved = applied(LatticeMap(l), points, &status);
  EXPECT_EQ(moved[0], points[0]);
  EXPECT_EQ(moved[1], Vec3(1.1e308, 0, 0));
  EXPECT_EQ(status, (std::vector<Status>{Status::Invalid, Status::Converged}));
}

TEST(LatticeMap, BindingsServeOtherDisplacements) {
  const AxisBasis axis = AxisBasis::bspline(5, 2, Border::Free);
  const Lattice l = shaken(lattice(axis, axis, axis), 23, 0.3), m = shaken(l, 24, 0.3);
  const LatticeMap a(l), b(m);
  const auto other = a.withDisplacements(m.displacements);
  const std::vector<Vec3> points = cloud(25, 100);
  std::vector<Vec3> position(100);
  Progress progress;
  other->apply(*a.bind(points), {position, {}, {}, {}}, progress);
  EXPECT_EQ(position, applied(b, points));
  EXPECT_THROW(b.apply(*a.bind(points), {position, {}, {}, {}}, progress), std::invalid_argument);
}

TEST(Lattice, BoxesHoldTheirPoints) {
  const auto holds = [](const LatticeBox& box, Points points) {
    box.validate();
    const double size = box.axes.cwiseAbs().maxCoeff();
    const Mat3 inverse = Mat3(box.axes / size).inverse();
    for (const Vec3& p : points)
      if (p.allFinite()) {
        const Vec3 u = inverse * ((p - box.origin) / size);
        EXPECT_GE(u.minCoeff(), -1e-12);
        EXPECT_LE(u.maxCoeff(), 1 + 1e-12);
      }
  };
  std::vector<Vec3> points = cloud(26, 100), flat = points, line = points;
  const Quat turn(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()));
  for (Vec3& p : points) p = turn * p.cwiseProduct(Vec3(5, 1, 2));
  for (Vec3& p : flat) p.z() = 0.5;
  for (Vec3& p : line) p = Vec3(p.x(), 0, 7);
  points[4].x() = std::nan("");
  const std::vector<Vec3> one{Vec3(1, 2, 3)}, far{Vec3(1e20, 0, 0), Vec3(1e20, 1, 0)}, huge{Vec3(1e200, 0, 0), Vec3(0, 1e200, 1e180)};
  for (const auto& set : {points, flat, line, one, far, huge, std::vector<Vec3>{}})
    for (const double padding : {0.0, 0.25}) {
      holds(fitBox(set, padding), set);
      holds(fitOrientedBox(set, padding), set);
    }
  EXPECT_NEAR(fitBox(flat).axes(2, 2), 1e-3 * fitBox(flat).axes.diagonal().maxCoeff(), 1e-15);
  EXPECT_EQ(fitBox(one).axes, Mat3::Identity());
  EXPECT_EQ(fitBox(one).origin, Vec3(0.5, 1.5, 2.5));
  const LatticeBox oriented = fitOrientedBox(points);
  EXPECT_GT(oriented.axes.determinant(), 0);
  EXPECT_GT(oriented.axes.col(0).normalized().dot(turn * Vec3::UnitX()), 0.99);
  EXPECT_LT(oriented.axes.determinant(), 90);  // 80 by construction, tilted a little; the straight box is larger
  EXPECT_GT(fitBox(points).axes.determinant(), 200);
}

TEST(Lattice, BadInputIsRefused) {
  const AxisBasis axis = AxisBasis::bernstein(3);
  const auto refused = [](Lattice l) { EXPECT_THROW(LatticeMap{l}, std::invalid_argument); };
  Lattice l = lattice(axis, axis, axis);
  l.displacements.assign(26, Vec3::Zero());
  refused(l);
  l.displacements.assign(27, Vec3::Zero());
  LatticeMap{l};
  l.displacements[5].y() = std::nan("");
  refused(l);
  l.displacements.clear();
  l.box.axes.col(2) = l.box.axes.col(0) + l.box.axes.col(1);
  refused(l);
  l.box.axes.setZero();
  refused(l);
  l.box.axes.setConstant(std::numeric_limits<double>::infinity());
  refused(l);
  EXPECT_THROW(fitBox({}, -1), std::invalid_argument);
  EXPECT_THROW(fitBox({}, std::nan("")), std::invalid_argument);
  const LatticeMap map(lattice(axis, axis, axis));
  EXPECT_THROW(map.withDisplacements(cloud(1, 26)), std::invalid_argument);
  std::vector<Vec3> few(2), points = cloud(1, 3);
  const auto binding = map.bind(points);
  EXPECT_THROW(map.combine(*binding, map.displacements(), few), std::invalid_argument);
  EXPECT_THROW(map.gather(*binding, points, few), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::map
