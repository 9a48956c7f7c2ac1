// Edits of the field itself: radius, weight, potential; primitives replaced, added and removed; falloff, guard, strict.
#include <fielddeform/mesh/quality.h>
#include <gtest/gtest.h>
#include <tests/gffd/gffd_testing.h>

#include <cmath>

namespace fielddeform::gffd::tests {
namespace {

using fielddeform::tests::verticalLine;

skeleton::Primitive point(const char* name, const Vec3& at, double radius) {
  skeleton::Primitive p;
  p.name = name;
  p.type = skeleton::PrimitiveType::Points;
  p.points = {at};
  p.radius = radius;
  return p;
}

mesh::Mesh sphere(double radius) {
  // A capsule without a cylinder is a sphere.
  return fielddeform::tests::makeCapsule({.length = 0, .radius = radius, .around = 48, .along = 40, .bump = 0});
}

std::size_t count(const Deformed& d, Status s) { return countStatuses(d.status)[static_cast<std::size_t>(s)]; }

TEST(FieldEdits, ALargerRadiusScalesTheDistance) {
  // f = d / r is kept, so d grows with r. [Qin et al. 2003: "the skeleton or the scalar field is deformed"]
  const mesh::Mesh mesh = sphere(.4);
  const skeleton::Skeleton rest{{point("p", Vec3::Zero(), 1)}, {}}, posed{{point("p", Vec3::Zero(), 1.25)}, {}};
  const Deformed d = track(mesh, rest, posed, {.guard = false});
  for (std::size_t i = 0; i < mesh.vertexCount(); ++i)
    ASSERT_LT((d.position[i] - 1.25 * mesh.positions()[i]).norm(), 2e-4);
  EXPECT_EQ(count(d, Status::Converged), mesh.vertexCount());
}

TEST(FieldEdits, RadiiPerPointTaperTheObjectExactly) {
  const mesh::Mesh mesh = smallCapsule(0);
  skeleton::Skeleton rest = lineSkeleton(verticalLine(33, 2.6), .6), posed = rest;
  for (const Vec3& p : rest.primitives[0].points) posed.primitives[0].pointRadius.push_back(.6 * (1 - .25 * (p.z() + 1.3)));
  for (const Predictor predictor : {Predictor::Auto, Predictor::Mls, Predictor::Axial}) {
    const Deformed d = track(mesh, rest, posed, {.predictor = predictor});
    EXPECT_EQ(count(d, Status::Limited), 0u);
    for (std::size_t i = 0; i < mesh.vertexCount(); ++i) {
      const Vec3& p = mesh.positions()[i];
      if (std::abs(p.z()) > 1) continue;  // the caps have their feet beyond the line's sharp ends
      const double scale = 1 - .25 * (p.z() + 1.3);
      // The closest frame is exact; moving least squares scales about the mean of a neighbourhood.
      ASSERT_LT((d.position[i] - Vec3(scale * p.x(), scale * p.y(), p.z())).norm(), predictor == Predictor::Mls ? .03 : 1e-4);
    }
  }
}

TEST(FieldEdits, PredictorsAloneFollowATaper) {
  // Without the corrector: what it would have to make up for, up to .14 here, is what the guard would stop.
  const mesh::Mesh mesh = smallCapsule(0);
  skeleton::Skeleton rest = lineSkeleton(verticalLine(33, 2.6), .6), posed = rest;
  for (const Vec3& p : rest.primitives[0].points) posed.primitives[0].pointRadius.push_back(.6 * (1 - .25 * (p.z() + 1.3)));
  for (const Predictor predictor : {Predictor::Mls, Predictor::Axial}) {
    const Deformed d = track(mesh, rest, posed, {.predictor = predictor, .corrector = false});
    for (std::size_t i = 0; i < mesh.vertexCount(); ++i) {
      const Vec3& p = mesh.positions()[i];
      if (std::abs(p.z()) > 1) continue;
      const double scale = 1 - .25 * (p.z() + 1.3);
      ASSERT_LT((d.position[i] - Vec3(scale * p.x(), scale * p.y(), p.z())).norm(), .03) << toString(predictor);
    }
  }
}

TEST(FieldEdits, ALargerWeightPushesOutwardsByItsLogarithm) {
  // S = w (e^-x - e^-k): the value is kept where e^-x' = (e^-x - e^-k) / w + e^-k.
  const mesh::Mesh mesh = sphere(.4);
  skeleton::Skeleton rest{{point("p", Vec3::Zero(), 1)}, {}}, posed = rest;
  posed.primitives[0].weight = 1.5;
  const Deformed d = track(mesh, rest, posed);
  const double c = std::exp(-4.0), x = -std::log((std::exp(-4 * .4) - c) / 1.5 + c) / 4;
  for (const Vec3& p : d.position) ASSERT_NEAR(p.norm(), x, 2e-4);
}

TEST(FieldEdits, AnotherPotentialIsTrackedToTheSameValue) {
  const mesh::Mesh mesh = sphere(.4);
  skeleton::Skeleton rest{{point("p", Vec3::Zero(), 1)}, {}}, posed = rest;
  posed.primitives[0].potential = skeleton::Potential::SoftObject;
  const Deformed d = track(mesh, rest, posed, {.guard = false});
  const field::Field before(rest, {}), after(posed, {});
  EXPECT_EQ(count(d, Status::Converged), mesh.vertexCount());
  for (std::size_t i = 0; i < mesh.vertexCount(); ++i)
    ASSERT_NEAR(after.evaluate(d.position[i]).pseudoDistance, before.evaluate(mesh.positions()[i]).pseudoDistance, 1e-4);
  EXPECT_GT(greatestDistance(d.position, mesh.positions()), .01);
}

TEST(FieldEdits, AnAddedPointRaisesABump) {
  const mesh::Mesh mesh = sphere(.4);
  const Vec3 at(0, 0, .25);
  const skeleton::Skeleton rest{{point("p", Vec3::Zero(), 1)}, {}};
  skeleton::Skeleton posed = rest;
  posed.primitives.push_back(point("bump", at, .4));
  const Deformed d = track(mesh, rest, posed);
  double top = 0;
  for (std::size_t i = 0; i < mesh.vertexCount(); ++i) {
    top = std::max(top, d.position[i].z());
    // Beyond the bump's influence nothing moves by more than the tolerance.
    if ((mesh.positions()[i] - at).norm() > .4) {
      ASSERT_LT((d.position[i] - mesh.positions()[i]).norm(), 1e-4);
    }
  }
  // On the axis both potentials are known: the value is kept where they add up to what the sphere's point had.
  const auto sum = [](double z) { return std::exp(-4 * z) + std::exp(-4 * (z - .25) / .4) - std::exp(-4.0); };
  double low = .4, high = .64;
  for (int i = 0; i < 60; ++i) (sum(.5 * (low + high)) > std::exp(-1.6) ? low : high) = .5 * (low + high);
  EXPECT_NEAR(top, low, 2e-4);
  EXPECT_EQ(d.folds, 0u);
}

TEST(FieldEdits, RemovingTheBumpBringsTheSphereBack) {
  const mesh::Mesh mesh = sphere(.4);
  const skeleton::Skeleton without{{point("p", Vec3::Zero(), 1)}, {}};
  skeleton::Skeleton with = without;
  with.primitives.push_back(point("bump", Vec3(0, 0, .25), .4));
  const Deformed up = track(mesh, without, with, {.guard = false});
  mesh::Mesh raised = mesh;
  raised.setPositions(up.position);
  const Deformed down = track(raised, with, without, {.guard = false});
  EXPECT_EQ(count(down, Status::Stalled), 0u);
  for (const Vec3& p : down.position) ASSERT_NEAR(p.norm(), .4, 3e-4);  // the value fixes the radius, two tolerances deep
}

TEST(FieldEdits, WhatOnlyARemovedPrimitiveReachedStaysWhereItIs) {
  const mesh::Mesh mesh = smallCapsule();
  skeleton::Skeleton rest{{point("low", Vec3(0, 0, -1), .5), point("high", Vec3(0, 0, 1), .5)}, {}}, posed = rest;
  posed.primitives.erase(posed.primitives.begin() + 1);
  posed.primitives[0].points[0].x() += .1;
  const Deformed d = track(mesh, rest, posed);
  for (std::size_t i = 0; i < mesh.vertexCount(); ++i) {
    if (mesh.positions()[i].z() <= 0) continue;
    ASSERT_EQ(d.position[i], mesh.positions()[i]);
  }
  EXPECT_GT(count(d, Status::Fixed), 0u);
  EXPECT_GT(count(d, Status::Converged), 0u);
}

TEST(FieldEdits, AReplacedLineCarriesTheObjectWithoutCorrespondence) {
  // The same arc, described by another number of points: no vertex correspondence, the same result.
  const mesh::Mesh mesh = smallCapsule();
  const skeleton::Skeleton rest = lineSkeleton(verticalLine(17, 2), .6);
  const auto arc = [&](int n) { return lineSkeleton(fielddeform::tests::bendMap(verticalLine(n, 2), 1.2), .6); };
  const auto pair = skeleton::pairSkeletons(rest, arc(33));
  ASSERT_EQ(pair.pairs[0].kind, skeleton::PairKind::Replaced);
  const Deformed matched = track(mesh, rest, arc(17), {.predictor = Predictor::Mls}), replaced = track(mesh, rest, arc(33));
  EXPECT_EQ(replaced.folds, 0u);
  EXPECT_EQ(count(replaced, Status::Stalled), 0u);
  EXPECT_LT(meanDistance(matched.position, replaced.position), .01);
}

TEST(FieldEdits, AReplacedSphereFollowsItsShape) {
  // Moments alone relate a point skeleton's sphere mesh and a larger, shifted one.
  const auto ball = [](double radius, const Vec3& at) {
    const mesh::Mesh m = fielddeform::tests::makeCapsule({.length = 0, .radius = radius, .around = radius < .3 ? 12 : 16, .along = 11, .bump = 0});
    skeleton::Primitive p;
    p.name = "ball";
    p.type = skeleton::PrimitiveType::Mesh;
    p.closed = true;
    p.radius = .5;
    for (const Vec3& x : m.positions()) p.points.push_back(x + at);
    for (std::size_t f = 0; f < m.faceCount(); ++f) p.faces.emplace_back(m.face(f).begin(), m.face(f).end());
    return skeleton::Skeleton{{p}, {}};
  };
  const mesh::Mesh mesh = sphere(.4);
  const Deformed d = track(mesh, ball(.2, Vec3::Zero()), ball(.35, Vec3(.3, 0, 0)));
  EXPECT_EQ(d.folds, 0u);
  // Distance to the ball is kept: a sphere .2 outside the new one, up to the two balls' facets.
  for (const Vec3& p : d.position) ASSERT_NEAR((p - Vec3(.3, 0, 0)).norm(), .55, .02);
}

TEST(Falloff, TakesTheDisplacementToZeroAtTheRim) {
  const mesh::Mesh mesh = fielddeform::tests::makeCapsule({.around = 48, .along = 100});
  const auto rest = lineSkeleton(verticalLine(17, 1), .5);
  std::vector<Vec3> moved = verticalLine(17, 1);
  for (Vec3& p : moved) p.x() += .1;
  const auto posed = lineSkeleton(moved, .5);
  const Deformed on = track(mesh, rest, posed), off = track(mesh, rest, posed, {.guard = false, .falloff = Falloff::Off});
  EXPECT_EQ(on.map.resolved().options.falloff, Falloff::On);  // the object leaves the influence region
  const mesh::EdgeTable edges(mesh);
  const double with = mesh::edgeStretch(edges, mesh.positions(), on.position).max, without = mesh::edgeStretch(edges, mesh.positions(), off.position).max;
  EXPECT_LT(with, 2);
  EXPECT_GT(without, 3);
}

TEST(Falloff, IsOffWhereNoEdgeLeavesTheInfluence) {
  const auto c = fielddeform::tests::makeCase("bend90");
  EXPECT_EQ(resolve({}, c.mesh, skeleton::pairSkeletons(c.rest, c.posed)).options.falloff, Falloff::Off);
}

TEST(Falloff, IsNotTurnedOnByVerticesThatAreNotFinite) {
  auto c = fielddeform::tests::makeCase("bend90");
  c.mesh.mutablePositions()[100].x() = std::nan("");
  EXPECT_EQ(resolve({}, c.mesh, skeleton::pairSkeletons(c.rest, c.posed)).options.falloff, Falloff::Off);
}

TEST(StrictValue, EveryMovableVertexKeepsItsValue) {
  const mesh::Mesh mesh = smallCapsule();
  const auto rest = lineSkeleton(verticalLine(17, 1), .5), posed = lineSkeleton(fielddeform::tests::bendMap(verticalLine(17, 1), 1, 1), .5);
  const Deformed d = track(mesh, rest, posed, {.strictValue = true});
  EXPECT_EQ(count(d, Status::Limited), 0u);
  const field::Field before(rest, {}), after(posed, {});
  for (std::size_t i = 0; i < mesh.vertexCount(); ++i) {
    if (d.status[i] != Status::Converged) continue;
    ASSERT_NEAR(after.evaluate(d.position[i]).pseudoDistance, before.evaluate(mesh.positions()[i]).pseudoDistance, 1e-4 * .5);
  }
}

TEST(Guard, HoldsBackACorrectionThatFolds) {
  // A flat strip; one vertex is corrected far across its neighbour.
  std::vector<Vec3> points;
  std::vector<Index> corners;
  for (Index i = 0; i < 12; ++i) {
    points.emplace_back(.1 * i, 0, 0);
    points.emplace_back(.1 * i, .1, 0);
    if (i) corners.insert(corners.end(), {2 * i - 2, 2 * i, 2 * i + 1, 2 * i - 2, 2 * i + 1, 2 * i - 1});
  }
  const mesh::Mesh mesh(points, corners);
  std::vector<Vec3> position = points;
  position[10].x() += .35;
  std::vector<Status> status(points.size(), Status::Converged);
  const GuardReport report = guard(mesh, points, position, status);
  EXPECT_EQ(report.remaining, 0u);
  EXPECT_GT(report.rounds, 0);
  EXPECT_FALSE(report.limited.empty());
  EXPECT_EQ(mesh::countFolds(mesh, points, position), 0u);
  for (const Index v : report.limited) EXPECT_EQ(status[v], Status::Limited);
  EXPECT_EQ(status[0], Status::Converged);  // far away nothing happens
  EXPECT_EQ(position[0], points[0]);
}

TEST(Guard, LeavesAGoodCorrectionAlone) {
  const mesh::Mesh mesh = smallCapsule();
  std::vector<Vec3> position = mesh.positions();
  for (Vec3& p : position) p *= 1.01;
  const std::vector<Vec3> before = position;
  std::vector<Status> status(position.size(), Status::Converged);
  EXPECT_TRUE(guard(mesh, mesh.positions(), position, status).limited.empty());
  EXPECT_EQ(position, before);
}

TEST(Guard, RefusesSpansOfTheWrongSize) {
  const mesh::Mesh mesh = smallCapsule();
  std::vector<Vec3> position(3);
  std::vector<Status> status(3);
  EXPECT_THROW(guard(mesh, mesh.positions(), position, status), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::gffd::tests
