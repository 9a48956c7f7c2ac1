#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/map/sculpt.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "../support/shapes.h"
#include "lattices.h"

namespace fielddeform::map {
namespace {

Lattice boxed(Points points, int nodes, double padding = 0.1) {
  Lattice l;
  l.box = fitBox(points, padding);
  l.axis.fill(AxisBasis::bspline(nodes, 3, Border::Coincident));
  return l;
}

std::vector<Vec3> images(const Lattice& lattice, Points rest) {
  const LatticeMap map(lattice);
  std::vector<Vec3> out;
  for (const Vec3& p : rest) out.push_back(map.position(p));
  return out;
}

Sculpted apply(const Lattice& lattice, Points rest, std::vector<Move> moves, const SculptOptions& options = {}) {
  Progress progress;
  return sculpt(lattice, rest, moves, options, progress);
}

Mat3 turnAbout(double angle, const Vec3& axis) { return Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix(); }

mesh::Mesh ball(const Vec3& centre, double radius, int around = 32, int down = 16) {
  mesh::Mesh m = test::sphere(around, down);
  for (Vec3& p : m.mutablePositions()) p = centre + radius * p;
  return m;
}

TEST(PressTool, PlanesAndBallsMeasureDepth) {
  const PressTool plane = PressTool::plane(Vec3(0, 0, 1), Vec3(0, 0, 3));
  EXPECT_EQ(plane.contact(Vec3(5, 6, 1.5)).depth, 0);
  EXPECT_EQ(plane.contact(Vec3(5, 6, 1)).depth, 0);
  const auto c = plane.contact(Vec3(5, 6, 0.25));
  EXPECT_EQ(c.depth, 0.75);
  EXPECT_EQ(c.surface, Vec3(5, 6, 1));
  EXPECT_EQ(c.out, Vec3(0, 0, 1));
  mesh::Mesh round = ball(Vec3(1, 0, 0), 2, 64, 32);
  for (const bool inverted : {false, true}) {
    if (inverted) {
      std::vector<Index> corners = round.triangles();
      for (std::size_t i = 0; i < corners.size(); i += 3) std::swap(corners[i], corners[i + 1]);
      round = mesh::Mesh(round.positions(), corners);
    }
    const PressTool tool = PressTool::solid(round);
    EXPECT_EQ(tool.contact(Vec3(1, 2.1, 0)).depth, 0);
    EXPECT_EQ(tool.contact(Vec3(9, 0, 0)).depth, 0);
    const auto in = tool.contact(Vec3(1, 1.5, 0));
    EXPECT_NEAR(in.depth, 0.5, 0.01);  // chords of the ball
    EXPECT_LT((in.surface - Vec3(1, 1.5, 0) - in.depth * in.out).norm(), 1e-14);
  }
  EXPECT_THROW(PressTool::plane(Vec3::Zero(), Vec3::Zero()), std::invalid_argument);
  EXPECT_THROW(PressTool::solid(mesh::Mesh()), std::invalid_argument);
  EXPECT_THROW(PressTool::solid(test::grid(3)), std::invalid_argument);  // open
}

TEST(Sculpt, TargetsAreMetAndTheRestOfTheLatticeKept) {
  const auto points = test::cloud(1, 300);
  const Lattice lattice = boxed(points, 8);
  Targets t;
  for (std::size_t i = 0; i < 4; ++i) t.points.push_back({points[i], points[i] + Vec3(0, 0.2, 0.1), 1});
  const Sculpted s = apply(lattice, points, {t});
  ASSERT_EQ(s.moves.size(), 1u);
  EXPECT_EQ(s.moves[0].solve.met, 4u);
  EXPECT_EQ(s.moves[0].refinements, 0);
  const auto after = images(s.lattice, points);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_LT((after[i] - t.points[i].image).norm(), 1e-14);
  for (std::size_t v = 0; v < points.size(); ++v)
    if (s.affected[v] == 0) {
      EXPECT_EQ(after[v], points[v]);
    }
}

// More waves than the lattice has nodes for: the paper's own example of a set that cannot be met.
Targets waves(const std::vector<Vec3>& line) {
  Targets t;
  for (std::size_t i = 0; i < line.size(); ++i) t.points.push_back({line[i], line[i] + Vec3(0, 0, i % 2 ? 0.1 : -0.1), 1});
  return t;
}

TEST(Sculpt, WavesTooShortForTheLatticeRefineIt) {
  std::vector<Vec3> line;
  for (int i = 0; i < 24; ++i) line.push_back(Vec3(-0.95 + 1.9 * i / 23, 0.1, 0.05));
  for (const BasisKind kind : {BasisKind::BSpline, BasisKind::Bernstein}) {
    Lattice lattice = boxed(test::cloud(2, 500), 5);
    if (kind == BasisKind::Bernstein) lattice.axis.fill(AxisBasis::bernstein(5));
    lattice = test::shaken(lattice, 3, 0.02);
    Targets t = waves(line);
    // Without refinement: unmet, and the advice names nodes that do.
    const Sculpted coarse = apply(lattice, line, {t});
    EXPECT_GT(coarse.moves[0].solve.unmet, 0u);
    EXPECT_EQ(coarse.lattice.nodeCount(), 125u);
    EXPECT_NE(coarse.moves[0].advice.find("would meet all"), std::string::npos) << coarse.moves[0].advice;
    SculptOptions options;
    options.maxNodes = 4000;
    const Sculpted fine = apply(lattice, line, {t}, options);
    EXPECT_EQ(fine.moves[0].solve.met, 24u);
    EXPECT_GT(fine.moves[0].refinements, 0);
    EXPECT_TRUE(fine.moves[0].advice.empty());
    EXPECT_LE(fine.lattice.nodeCount(), 4000u);
    EXPECT_EQ(fine.lattice.nodes(), fine.moves[0].nodes);
    const auto after = images(fine.lattice, line);
    for (std::size_t i = 0; i < line.size(); ++i) EXPECT_LT((after[i] - t.points[i].image).norm(), 1e-8);
    // The bound is kept, and said.
    options.maxNodes = 150;
    const Sculpted bounded = apply(lattice, line, {t}, options);
    EXPECT_LE(bounded.lattice.nodeCount(), 150u);
    EXPECT_NE(bounded.moves[0].advice.find("of 150 allowed"), std::string::npos) << bounded.moves[0].advice;
  }
}

TEST(Sculpt, RefinementKeepsWhatWasDeformedBefore) {
  const auto points = test::cloud(4, 400);
  const Lattice lattice = test::shaken(boxed(points, 6), 5, 0.05);
  std::vector<Vec3> line;
  for (int i = 0; i < 12; ++i) line.push_back(Vec3(-0.9, 0.9, -0.9 + 0.02 * i));
  Targets t = waves(line);
  SculptOptions options;
  options.maxNodes = 20000;
  // What is far from the targets has the image that it had.
  const Sculpted s = apply(lattice, points, {t}, options);
  EXPECT_EQ(s.moves[0].solve.met, 12u);
  const auto before = images(lattice, points), after = images(s.lattice, points);
  int kept = 0;
  for (std::size_t v = 0; v < points.size(); ++v)
    if (s.affected[v] == 0) {
      EXPECT_LT((after[v] - before[v]).norm(), 1e-13);
      ++kept;
    }
  EXPECT_GT(kept, 100);
}

TEST(Sculpt, ContradictionsAreSaidAndNotRefinedFor) {
  const auto points = test::cloud(6, 50);
  Targets t;
  t.points = {{points[0], points[0] + Vec3(0.1, 0, 0), 1}, {points[0], points[0] - Vec3(0.1, 0, 0), 1}};
  SculptOptions options;
  options.maxNodes = 100000;
  const Sculpted s = apply(boxed(points, 5), points, {t}, options);
  EXPECT_EQ(s.moves[0].refinements, 0);
  EXPECT_NE(s.moves[0].advice.find("two places at once"), std::string::npos);
}

TEST(Sculpt, AMagnetPullsMostAtItsCentreAndNothingFarAway) {
  const mesh::Mesh m = test::sphere(48, 24);
  const Lattice lattice = boxed(m.positions(), 16);
  const Sculpted s = apply(lattice, m.positions(), {Magnet{.centre = Vec3(0, 0, 1), .radius = 0.7, .by = Vec3(0, 0, 0.4)}});
  const auto after = images(s.lattice, m.positions());
  EXPECT_NEAR(after[0].z(), 1.4, 0.05);
  for (std::size_t v = 0; v < after.size(); ++v) {
    const double r = (m.positions()[v] - Vec3(0, 0, 1)).norm() / 0.7;
    if (r < 1) {
      EXPECT_NEAR(after[v].z() - m.positions()[v].z(), 0.4 * (1 - r * r) * (1 - r * r), 0.05);
    }
    if (m.positions()[v].z() < 0) {
      EXPECT_EQ(after[v], m.positions()[v]);
    }
  }
  // Towards a point, half the way, all alike.
  const Sculpted toward = apply(lattice, m.positions(),
                                {Magnet{.centre = Vec3(0, 0, 1), .radius = 0.3, .towards = Vec3(0, 0, 2), .strength = 0.5, .profile = Profile::Flat}});
  EXPECT_NEAR(images(toward.lattice, m.positions())[0].z(), 1.5, 0.02);
}

TEST(Sculpt, ASuctionCupMovesItsDiscAsOnePiece) {
  const mesh::Mesh m = test::sphere(64, 32);
  const Lattice lattice = boxed(m.positions(), 14, 0.3);
  SculptOptions options;
  options.maxNodes = 40000;
  options.toolTolerance = 1e-3;
  const SuctionCup cup{.centre = Vec3(0, 0, 1), .axis = Vec3(0, 0, 1), .radius = 0.35, .by = Vec3(0.1, 0, 0.3), .turn = 0.3};
  const Sculpted s = apply(lattice, m.positions(), {cup}, options);
  const auto after = images(s.lattice, m.positions());
  const Mat3 turn = turnAbout(0.3, Vec3(0, 0, 1));
  std::size_t held = 0;
  for (std::size_t v = 0; v < after.size(); ++v) {
    const Vec3 p = m.positions()[v];
    if (std::hypot(p.x(), p.y()) > 0.35 || p.z() < 0) continue;
    ++held;
    EXPECT_LT((after[v] - (Vec3(0, 0, 1) + turn * (p - Vec3(0, 0, 1)) + Vec3(0.1, 0, 0.3))).norm(), 1e-3 * 0.5);
  }
  EXPECT_EQ(s.moves[0].vertices, held);
  EXPECT_TRUE(s.moves[0].advice.empty()) << s.moves[0].advice;
}

TEST(Sculpt, APressedBallIsFlatWhereItMetThePlaneAndNothingIsBehindIt) {
  const mesh::Mesh m = test::sphere(48, 24);
  const Lattice lattice = boxed(m.positions(), 10);
  const Sculpted s = apply(lattice, m.positions(), {Press{PressTool::plane(Vec3(0, 0, 0.7), Vec3(0, 0, -1))}});
  const MoveReport& r = s.moves[0];
  EXPECT_NEAR(r.deepestBefore, 0.3, 1e-12);
  EXPECT_EQ(r.penetrating, 0u) << r.advice;
  const auto after = images(s.lattice, m.positions());
  double highest = -1;
  for (const Vec3& p : after) highest = std::max(highest, p.z());
  EXPECT_LE(highest, 0.7 + 1e-6 * 4.2);
  EXPECT_EQ(r.deepestAfter, std::max(0.0, highest - 0.7));
  RecordProperty("rounds", r.rounds);
  RecordProperty("highest", std::to_string(highest));
}

TEST(Sculpt, PressedAgainstABallTheBlockTakesItsShape) {
  // The top of a block, finely sampled, and a ball that dips into it.
  const mesh::Mesh top = test::grid(40);
  const Lattice lattice = boxed(top.positions(), 10);
  Lattice thick = lattice;
  thick.box.origin = Vec3(-0.1, -0.1, -0.6);
  thick.box.axes = Vec3(1.2, 1.2, 1).asDiagonal();
  const mesh::Mesh tool = ball(Vec3(0.5, 0.5, 0.2), 0.35, 48, 24);
  const Sculpted s = apply(thick, top.positions(), {Press{PressTool::solid(tool)}});
  const MoveReport& r = s.moves[0];
  EXPECT_GT(r.deepestBefore, 0.13);
  EXPECT_EQ(r.penetrating, 0u) << r.advice << " rounds " << r.rounds;
  const auto after = images(s.lattice, top.positions());
  const PressTool check = PressTool::solid(tool);
  double deepest = 0, nearest = 1;
  for (const Vec3& p : after) {
    deepest = std::max(deepest, check.contact(p).depth);
    nearest = std::min(nearest, (p - Vec3(0.5, 0.5, 0.2)).norm() - 0.35);
  }
  EXPECT_LE(deepest, 1e-6 * 2);
  EXPECT_LT(nearest, 1e-2);  // they touch
  RecordProperty("rounds", r.rounds);
}

TEST(Sculpt, AFaceBetweenItsCornersGivesWay) {
  // Four cells a side, and a ball that dips into the middle of one of them: no vertex is inside.
  const mesh::Mesh top = test::grid(4);
  Lattice lattice = boxed(top.positions(), 8);
  lattice.box.origin = Vec3(-0.1, -0.1, -0.6);
  lattice.box.axes = Vec3(1.2, 1.2, 1).asDiagonal();
  const mesh::Mesh tool = ball(Vec3(0.64, 0.36, 0.09), 0.13, 12, 8);
  const PressTool press = PressTool::solid(tool);
  for (const Vec3& p : top.positions()) ASSERT_EQ(press.contact(p).depth, 0);

  const Sculpted alone = apply(lattice, top.positions(), {Press{press}});
  EXPECT_EQ(alone.moves[0].rounds, 0);  // points alone see nothing

  std::vector<std::array<Index, 3>> triangles;
  for (std::size_t f = 0; f < top.faceCount(); ++f)
    top.forEachTriangle(f, [&](Index a, Index b, Index c) { triangles.push_back({a, b, c}); });
  SculptOptions options;
  options.triangles = triangles;
  const Sculpted s = apply(lattice, top.positions(), {Press{press}}, options);
  EXPECT_GT(s.moves[0].deepestBefore, 0.02);
  EXPECT_EQ(s.moves[0].penetrating, 0u);
  EXPECT_EQ(s.moves[0].penetratingFaces, 0u) << s.moves[0].advice;
  // Independently: a dense sampling of the flat faces.
  const auto after = images(s.lattice, top.positions());
  double deepest = 0;
  for (const auto& [a, b, c] : triangles)
    for (int i = 0; i <= 50; ++i)
      for (int j = 0; i + j <= 50; ++j) {
        const double u = i / 50.0, v = j / 50.0;
        deepest = std::max(deepest, press.contact((1 - u - v) * after[a] + u * after[b] + v * after[c]).depth);
      }
  EXPECT_LE(deepest, 1e-4 * s.lattice.box.axes.colwise().norm().norm());
}

TEST(PressTool, ClearanceIsASignedDistance) {
  const mesh::Mesh round = ball(Vec3(1, 2, 3), 0.5, 24, 12);
  const PressTool tool = PressTool::solid(round);
  EXPECT_NEAR(tool.clearance(Vec3(1, 2, 4), 10), 0.5, 1e-12);  // a pole
  EXPECT_LT(tool.clearance(Vec3(1, 2, 3), 10), -0.45);
  EXPECT_EQ(-tool.clearance(Vec3(1.1, 2, 3.2), 10), tool.contact(Vec3(1.1, 2, 3.2)).depth);
  EXPECT_GT(tool.clearance(Vec3(9, 9, 9), 1), 1);
  EXPECT_DOUBLE_EQ(PressTool::plane(Vec3(0, 0, 1), Vec3(0, 0, 2)).clearance(Vec3(5, 5, -1), 0), -2);
}

TEST(Sculpt, WhatCannotGiveWayStaysInsideAndIsReported) {
  const mesh::Mesh m = test::sphere(24, 12);
  const Lattice lattice = boxed(m.positions(), 4);
  SculptOptions options;
  options.pinnedPoints = {Vec3(0, 0, 1)};
  options.pressRounds = 20;
  const Sculpted s = apply(lattice, m.positions(), {Press{PressTool::plane(Vec3(0, 0, 0.7), Vec3(0, 0, -1))}}, options);
  EXPECT_GT(s.moves[0].penetrating, 0u);
  EXPECT_NEAR(s.moves[0].deepestAfter, 0.3, 1e-9);  // the pole
  EXPECT_NE(s.moves[0].advice.find("still inside"), std::string::npos);
  EXPECT_EQ(s.moves[0].rounds, 20);
}

TEST(Sculpt, PinsSurviveRefinement) {
  std::vector<Vec3> line;
  for (int i = 0; i < 24; ++i) line.push_back(Vec3(-0.95 + 1.9 * i / 23, 0.1, 0.05));
  Lattice lattice = boxed(test::cloud(7, 300), 7);
  SculptOptions options;
  options.maxNodes = 20000;
  for (int j = 0; j < 7; ++j)
    for (int i = 0; i < 7; ++i)
      for (int k : {0, 1}) options.pinnedNodes.push_back(lattice.index(i, j, k));
  const Sculpted s = apply(lattice, line, {waves(line)}, options);
  EXPECT_EQ(s.moves[0].solve.met, 24u);
  EXPECT_GT(s.moves[0].refinements, 0);
  // The first layer's nodes are still where they were: the face w = 0 of the box has not moved.
  const LatticeMap map(s.lattice);
  for (std::uint64_t i = 0; i < 50; ++i) {
    const Vec3 p = s.lattice.box.origin + s.lattice.box.axes * Vec3(uniform01(8, 2 * i), uniform01(8, 2 * i + 1), 0);
    EXPECT_EQ(map.position(p), p);
  }
}

TEST(Sculpt, MovesBuildOnOneAnotherAndNeedNoParticularThreads) {
  const mesh::Mesh m = test::sphere(32, 16);
  const Lattice lattice = boxed(m.positions(), 9);
  const std::vector<Move> moves{Magnet{.centre = Vec3(0, 0, 1), .radius = 0.8, .by = Vec3(0, 0, 0.5)},
                                Press{PressTool::plane(Vec3(0, 0, 1.2), Vec3(0, 0, -1))},
                                SuctionCup{.centre = Vec3(1, 0, 0), .axis = Vec3(1, 0, 0), .radius = 0.4, .by = Vec3(0.2, 0, 0)}};
  std::vector<Sculpted> results;
  for (const int threads : {1, 7}) {
    const ThreadLimit limit(threads);
    results.push_back(apply(lattice, m.positions(), moves));
  }
  EXPECT_EQ(results[0].lattice.displacements, results[1].lattice.displacements);
  EXPECT_EQ(results[0].affected, results[1].affected);
  // The press found what the magnet had pulled out.
  EXPECT_GT(results[0].moves[1].deepestBefore, 0.2);
}

TEST(Sculpt, ATouchOfNothingSaysSo) {
  const auto points = test::cloud(9, 20);
  const Lattice lattice = boxed(points, 4);
  const Sculpted s = apply(lattice, points, {Magnet{.centre = Vec3(9, 9, 9), .radius = 1, .by = Vec3(1, 0, 0)}});
  EXPECT_EQ(s.moves[0].vertices, 0u);
  EXPECT_NE(s.moves[0].advice.find("no vertex"), std::string::npos);
  EXPECT_EQ(images(s.lattice, points), points);
}

TEST(Sculpt, ManyVerticesAreThinnedOutToTheMemoryAllowed) {
  const mesh::Mesh m = test::sphere(64, 32);
  const Lattice lattice = boxed(m.positions(), 8);
  SculptOptions options;
  options.maxEntries = 64 * 100;
  const Sculpted s = apply(lattice, m.positions(), {Magnet{.centre = Vec3(0, 0, 1), .radius = 1, .by = Vec3(0, 0, 0.2)}}, options);
  EXPECT_GT(s.moves[0].vertices, 300u);
  EXPECT_EQ(s.moves[0].solve.points.size(), 100u);
}

TEST(Sculpt, BadInputIsRefused) {
  const auto points = test::cloud(10, 20);
  const Lattice lattice = boxed(points, 4);
  const double bad = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(apply(lattice, points, {Magnet{.radius = 0}}), std::invalid_argument);
  EXPECT_THROW(apply(lattice, points, {Magnet{.by = Vec3(bad, 0, 0)}}), std::invalid_argument);
  EXPECT_THROW(apply(lattice, points, {SuctionCup{.axis = Vec3::Zero()}}), std::invalid_argument);
  EXPECT_THROW(apply(lattice, points, {SuctionCup{.depth = -1}}), std::invalid_argument);
  SculptOptions options;
  options.pinnedNodes = {64};
  EXPECT_THROW(apply(lattice, points, {}, options), std::invalid_argument);
  options.pinnedNodes.clear();
  options.solve.nodeCost.assign(64, 1);
  options.maxNodes = 100;
  EXPECT_THROW(apply(lattice, points, {}, options), std::invalid_argument);
  options = {};
  options.pressRounds = 0;
  EXPECT_THROW(apply(lattice, points, {}, options), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::map
