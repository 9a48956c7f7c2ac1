#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/core/rigid.h>
#include <fielddeform/mesh/measures.h>
#include <fielddeform/mesh/quality.h>
#include <fielddeform/resample/refine.h>
#include <gtest/gtest.h>
#include <tests/support/maps.h>
#include <tests/support/shapes.h>

#include <algorithm>
#include <limits>
#include <map>

namespace fielddeform::resample {
namespace {

using namespace fielddeform::test;
using mesh::EdgeCounts;
using mesh::EdgeTable;
constexpr double kPi = std::numbers::pi;

Refined run(const Mesh& m, const map::SpaceMap& map, const Options& options = {}) {
  Progress progress;
  return refine(m, map, options, progress);
}

/// What holds for every result.
void expectSound(const Mesh& before, const Refined& r) {
  const std::size_t n = r.rest.vertexCount();
  ASSERT_EQ(r.posed.size(), n);
  ASSERT_EQ(r.status.size(), n);
  ASSERT_EQ(r.residual.size(), n);
  ASSERT_EQ(r.faceParent.size(), r.rest.faceCount());
  EXPECT_TRUE(std::is_sorted(r.faceParent.begin(), r.faceParent.end()));
  EXPECT_EQ(r.report.insertedVertices, n - before.vertexCount());
  EXPECT_EQ(r.parents.size(), n - before.vertexCount());
  for (std::size_t v = 0; v < before.vertexCount(); ++v) ASSERT_EQ(r.rest.positions()[v], before.positions()[v]);
  for (std::size_t i = 0; i < r.parents.size(); ++i) {
    const auto [a, b] = r.parents[i];
    ASSERT_EQ(r.rest.positions()[before.vertexCount() + i], 0.5 * (r.rest.positions()[a] + r.rest.positions()[b]));
  }
  // No T-junction: the parts of every edge are used as often, and as often in each direction, as the edge was.
  const EdgeCounts old = countEdges(EdgeTable(before)), now = countEdges(EdgeTable(r.rest));
  EXPECT_EQ(old.closed(), now.closed());
  EXPECT_EQ(old.oriented(), now.oriented());
  EXPECT_EQ(boundaryLoops(EdgeTable(before)).size(), boundaryLoops(EdgeTable(r.rest)).size());
  EXPECT_EQ(components(EdgeTable(before), before.faceCount()).count(), components(EdgeTable(r.rest), r.rest.faceCount()).count());
  EXPECT_NEAR(mesh::area(r.rest, r.rest.positions()), mesh::area(before, before.positions()),
              1e-12 * mesh::area(before, before.positions()))
      << "the rest surface is the same";
}

/// Largest distance of the posed surface from the ideally bent bar or box: its points, bent back, lie on the surface of
/// [low, high]. Bending back magnifies lengths by at most radius / (radius - high.x).
double largestDeviation(const Refined& r, double angle, double length, const Vec3& low, const Vec3& high) {
  const double radius = length / angle;
  double largest = 0;
  for (std::size_t f = 0; f < r.rest.faceCount(); ++f)
    r.rest.forEachTriangle(f, [&](Index a, Index b, Index c) {
      for (int i = 0; i <= 6; ++i)
        for (int j = 0; i + j <= 6; ++j) {
          const auto& p = r.posed;
          const Vec3 x = p[a] + (p[b] - p[a]) * (i / 6.0) + (p[c] - p[a]) * (j / 6.0);
          const double from = std::hypot(radius - x.x(), x.z()), turn = std::atan2(x.z(), radius - x.x());
          const Vec3 back(radius - from, x.y(), radius * turn);
          const Vec3 out = (low - back).cwiseMax(back - high);  // positive outside
          const Vec3 outside = out.cwiseMax(Vec3::Zero());
          largest = std::max(largest, outside.isZero(0) ? -out.maxCoeff() : outside.norm());
        }
    });
  return largest;
}

TEST(Refine, LeavesAMeshThatIsNotMovedBitForBit) {
  const Mesh m = sphere(16, 8);
  const Refined r = run(m, stretchMap(1));
  EXPECT_EQ(r.report.insertedVertices, 0u);
  EXPECT_EQ(r.report.reason, StopReason::Done);
  EXPECT_EQ(r.rest.corners(), m.corners());
  EXPECT_EQ(r.rest.offsets(), m.offsets());
  EXPECT_EQ(r.posed, m.positions());
}

TEST(Refine, RigidMotionInsertsNothingEvenWithTheStrictestStretch) {
  const Rigid motion{Quat(0.5, 0.1, -0.7, 0.5).normalized(), {3, -2, 5}};
  const FunctionMap rigid([&](const Vec3& p) { return motion(p); });
  EXPECT_EQ(run(sphere(16, 8), rigid).report.insertedVertices, 0u);
}

TEST(Refine, UniformStretchEndsWithEveryEdgeBelowTheBound) {
  for (const double factor : {1.79, 1.8, 2.0, 4.0, 8.0}) {
    for (const int corners : {3, 4}) {
      const Mesh m = grid(4, corners);
      const Refined r = run(m, stretchMap(factor, factor), {.by = Criterion::Stretch});
      expectSound(m, r);
      EXPECT_EQ(r.report.reason, StopReason::Done);
      EXPECT_LT(r.report.stretchMax, 1.8);
      EXPECT_EQ(r.report.rounds > 0, factor >= 1.8);
    }
  }
}

TEST(Refine, StretchAlongOneAxisEndsWithoutSlivers) {
  for (const double factor : {2.0, 4.0, 8.0, 16.0}) {
    for (const int corners : {3, 4}) {
      const Mesh m = grid(4, corners);
      const Refined r = run(m, stretchMap(factor), {.by = Criterion::Stretch});
      expectSound(m, r);
      EXPECT_EQ(r.report.reason, StopReason::Done);
      EXPECT_LT(r.report.stretchMax, 1.8);
      // Halves of stretched diagonals are as flat as the diagonals, and one template cuts a right triangle at its
      // longer cathetus; nothing may get flatter than that, however many rounds.
      EXPECT_GT(r.report.minNewAnglePosed, 0.999 * std::atan(1 / (factor + 1))) << factor << ' ' << corners;
    }
  }
}

TEST(Refine, BarsOfFewSegmentsFollowAHalfCircle) {
  // Edge lengths see nothing of it: stretch alone inserts nothing into the bar of one segment.
  const FunctionMap bend = bendMap(kPi, 10);
  EXPECT_EQ(run(bar(1, 10, 1), bend, {.by = Criterion::Stretch}).report.insertedVertices, 0u);
  for (const int segments : {1, 2, 4})
    for (const int corners : {3, 4}) {
      const Mesh m = bar(segments, 10, 1, corners);
      const Refined r = run(m, bend);
      expectSound(m, r);
      EXPECT_EQ(r.report.reason, StopReason::Done) << segments << ' ' << corners;
      const double tolerance = 1e-3 * mesh::objectSize(m.positions());
      EXPECT_LE(r.report.deviationMax, tolerance);
      // Where the sides of a triangle are within the tolerance of a smooth map, its inside is within 4/3 of it; bending
      // back magnifies by 1.2.
      EXPECT_LE(largestDeviation(r, kPi, 10, {-0.5, -0.5, 0}, {0.5, 0.5, 10}), 1.6 * tolerance) << segments << ' ' << corners;
      EXPECT_LT(r.rest.vertexCount(), 2000u);
    }
}

TEST(Refine, BoxOfTwelveTrianglesFollowsAQuarterCircle) {
  for (const double deviation : {1e-2, 1e-3}) {
    const FunctionMap bend = bendMap(kPi / 2, 1);
    const Mesh box(moved(cube(), [](const Vec3& p) { return Vec3(p.x() - 1, p.y(), p.z()); }), cube().corners());
    const Refined r = run(box, bend, {.maxDeviation = deviation});
    expectSound(box, r);
    EXPECT_EQ(r.report.reason, StopReason::Done);
    const double tolerance = deviation * std::sqrt(3.0);
    EXPECT_LE(r.report.deviationMax, tolerance);
    // The box is the half x <= 0 of [-1, 1]: bending back never magnifies there.
    EXPECT_LE(largestDeviation(r, kPi / 2, 1, {-1, 0, 0}, {0, 1, 1}), 1.4 * tolerance);
    EXPECT_TRUE(mesh::volume(r.rest, r.posed).value.has_value()) << "still closed";
    EXPECT_LT(r.rest.vertexCount(), deviation < 5e-3 ? 3000u : 500u);
  }
}

TEST(Refine, AQuadWithStraightEdgesIsDividedWhereItsDiagonalLeavesTheSurface) {
  const FunctionMap saddle([](const Vec3& p) { return Vec3(p.x(), p.y(), p.x() * p.y()); });
  const Mesh m = grid(1, 4);
  const Refined r = run(m, saddle, {.maxDeviation = 1e-2});
  expectSound(m, r);
  EXPECT_EQ(r.report.reason, StopReason::Done);
  double worst = 0;  // height of the middle of each triangle and side over z = x y
  for (std::size_t f = 0; f < r.rest.faceCount(); ++f)
    r.rest.forEachTriangle(f, [&](Index a, Index b, Index c) {
      const auto& p = r.posed;
      for (const Vec3& x : {Vec3((p[a] + p[b] + p[c]) / 3), Vec3((p[a] + p[b]) / 2), Vec3((p[b] + p[c]) / 2), Vec3((p[a] + p[c]) / 2)})
        worst = std::max(worst, std::abs(x.z() - x.x() * x.y()));
    });
  // The size is sqrt(2), and heights over the surface are at most sqrt(3) of distances: the gradient of z - x y.
  EXPECT_LE(worst, 1e-2 * std::sqrt(2.0) * std::sqrt(3.0));
  EXPECT_GT(r.rest.faceCount(), 2u);
}

TEST(Refine, StraightEdgesAreDividedToo_WhereTheirFacesWouldBecomeSlivers) {
  // The edges across the bend stay straight, so nothing else would ever divide them.
  const Mesh box(moved(cube(), [](const Vec3& p) { return Vec3(p.x() - 1, p.y(), p.z()); }), cube().corners());
  const Refined without = run(box, bendMap(kPi / 2, 1), {.minAngle = 0}), with = run(box, bendMap(kPi / 2, 1));
  expectSound(box, with);
  EXPECT_LT(without.report.minNewAnglePosed, 0.01);
  EXPECT_GT(with.report.minNewAnglePosed, 0.1) << "half of the 0.2 asked for, as each division may halve an angle";
  EXPECT_LT(with.report.insertedVertices, 2 * without.report.insertedVertices);
}

TEST(Refine, TouchesOnlyEdgesWithAMovedVertex) {
  const FunctionMap half([](const Vec3& p) { return p.x() <= 0.5 ? p : Vec3(0.5 + 3 * (p.x() - 0.5), p.y(), p.z()); });
  const Mesh m = grid(8);
  const Refined r = run(m, half);
  expectSound(m, r);
  EXPECT_GT(r.report.insertedVertices, 0u);
  for (std::size_t v = m.vertexCount(); v < r.rest.vertexCount(); ++v) EXPECT_GT(r.rest.positions()[v].x(), 0.5);
  // Faces that lie in the fixed half are copied.
  for (std::size_t f = 0; f < r.rest.faceCount(); ++f) {
    const auto parent = m.face(r.faceParent[f]);
    if (std::all_of(parent.begin(), parent.end(), [&](Index v) { return m.positions()[v].x() <= 0.5; })) {
      EXPECT_TRUE(std::ranges::equal(r.rest.face(f), parent));
    }
  }
}

TEST(Refine, PolygonsWithoutAMarkedEdgeStayPolygonsAndQuadsStayQuads) {
  const Mesh m = grid(6, 4);
  const FunctionMap half([](const Vec3& p) { return p.x() <= 0.5 ? p : Vec3(0.5 + 3 * (p.x() - 0.5), p.y(), p.z()); });
  const Refined r = run(m, half, {.by = Criterion::Stretch});
  expectSound(m, r);
  for (std::size_t f = 0; f < r.rest.faceCount(); ++f) EXPECT_EQ(r.rest.face(f).size(), 4u);
}

TEST(Refine, PolygonsOfAnyShapeKeepTheirAreaAndRim) {
  // A concave L of six corners, a hexagon, a dart, a two-sided "face" and one with a repeated vertex.
  Mesh l({{0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {1, 1, 0}, {1, 2, 0}, {0, 2, 0}, {4, 0, 0}, {3, -1, 0}, {5, 5, 0}},
         {0, 1, 2, 3, 4, 5, 1, 6, 2, 7, 1, 8, 2, 6, 6, 8, 6}, {0, 6, 10, 12, 15, 17});
  const Refined r = run(l, stretchMap(5, 3), {.by = Criterion::Stretch});
  ASSERT_EQ(r.report.reason, StopReason::Done);
  EXPECT_EQ(boundaryLoops(EdgeTable(r.rest)).size(), boundaryLoops(EdgeTable(l)).size());
  double before = 0, after = 0;  // signed: a fan of a concave face may overlap itself
  const auto signedArea = [](const Mesh& m, double& sum) {
    for (std::size_t f = 0; f < m.faceCount(); ++f)
      m.forEachTriangle(f, [&](Index a, Index b, Index c) {
        const auto& p = m.positions();
        sum += 0.5 * (p[b] - p[a]).cross(p[c] - p[a]).z();
      });
  };
  signedArea(l, before), signedArea(r.rest, after);
  EXPECT_NEAR(after, before, 1e-12);
  EXPECT_LT(r.report.stretchMax, 1.8);
}

TEST(Refine, NonManifoldEdgesAreDividedInAllTheirFaces) {
  for (const int pages : {3, 4, 5}) {
    const Mesh m = book(pages);
    const Refined r = run(m, stretchMap(4, 4, 4), {.by = Criterion::Stretch});
    expectSound(m, r);
    const EdgeCounts n = countEdges(EdgeTable(r.rest));
    EXPECT_EQ(n.nonManifold, 4u) << "the spine in four parts, each on every page";
    EXPECT_EQ(n.boundary, static_cast<std::size_t>(pages) * 2 * 4);
  }
}

TEST(Refine, DegenerateAndDuplicateFacesComeThrough) {
  const Mesh m({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {2, 0, 0}}, {0, 1, 2, 0, 1, 2, 0, 1, 3, 0, 0, 1, 2, 2, 2});
  const Refined r = run(m, stretchMap(4, 4, 4), {.by = Criterion::Stretch});
  EXPECT_EQ(r.report.reason, StopReason::Done);
  EXPECT_LT(r.report.stretchMax, 1.8);
  EXPECT_EQ(r.faceParent.back(), 4u);
}

TEST(Refine, InvalidVerticesStayAndTheirEdgesAreNotDivided) {
  Mesh m = grid(4);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  m.mutablePositions()[12] = {nan, 0, 0};
  const Refined r = run(m, stretchMap(4, 4), {.by = Criterion::Stretch});
  ASSERT_TRUE(std::isnan(r.posed[12].x()));
  EXPECT_EQ(r.status[12], Status::Invalid);
  for (std::size_t v = 0; v < r.posed.size(); ++v)
    ASSERT_EQ(r.posed[v].allFinite() && r.rest.positions()[v].allFinite(), v != 12) << v;
  EXPECT_GT(r.report.insertedVertices, 0u);
}

TEST(Refine, AMapThatGivesNoNumberIsNotFollowed) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const FunctionMap hole([&](const Vec3& p) { return p.x() > 0.4 && p.x() < 0.6 ? Vec3(nan, nan, nan) : Vec3(4 * p); });
  const Mesh m = grid(4);
  const Refined r = run(m, hole);
  EXPECT_GT(r.report.refused, 0u);
  EXPECT_NE(r.report.message.find("no finite image"), std::string::npos);
  for (const Vec3& p : r.posed) ASSERT_TRUE(p.allFinite());
  EXPECT_EQ(r.status[2], Status::Stalled);
  EXPECT_EQ(r.posed[2], m.positions()[2]);
}

TEST(Refine, EndsOnAMapWithoutAnyContinuity) {
  const Refined byVertices = run(cube(), noiseMap(100), {.maxVertices = 500});
  EXPECT_EQ(byVertices.report.reason, StopReason::MaxVertices);
  EXPECT_EQ(byVertices.rest.vertexCount(), 500u);
  EXPECT_GT(byVertices.report.remaining, 0u);
  EXPECT_EQ(byVertices.report.message.rfind("resampling stopped at the limit of 500 vertices", 0), 0u);
  expectSound(cube(), byVertices);
  const Refined byRounds = run(cube(), noiseMap(100), {.maxRounds = 3});
  EXPECT_EQ(byRounds.report.reason, StopReason::MaxRounds);
  EXPECT_EQ(byRounds.report.rounds, 3);
  expectSound(cube(), byRounds);
}

TEST(Refine, ALimitBelowTheInputInsertsNothing) {
  const Refined r = run(cube(), stretchMap(9), {.maxVertices = 3});
  EXPECT_EQ(r.report.insertedVertices, 0u);
  EXPECT_EQ(r.report.reason, StopReason::MaxVertices);
}

TEST(Refine, SpendsALimitOnTheWorstEdges) {
  const FunctionMap uneven([](const Vec3& p) { return Vec3(p.x() < 0.5 ? 2 * p.x() : 1 + 6 * (p.x() - 0.5), p.y(), p.z()); });
  const Refined r = run(grid(8), uneven, {.by = Criterion::Stretch, .maxVertices = 81 + 36});
  ASSERT_EQ(r.report.insertedVertices, 36u);
  for (std::size_t v = 81; v < r.rest.vertexCount(); ++v) EXPECT_GT(r.rest.positions()[v].x(), 0.5);
}

/// A mesh with its faces in another order and their corners turned.
Mesh shuffled(const Mesh& m) {
  std::vector<Index> order(m.faceCount()), corners;
  for (std::size_t f = 0; f < order.size(); ++f) order[f] = static_cast<Index>(f);
  std::sort(order.begin(), order.end(), [](Index a, Index b) { return splitmix64(1, a) < splitmix64(1, b); });
  for (const Index f : order)
    for (std::size_t k = 0; k < 3; ++k) corners.push_back(m.face(f)[(k + f) % 3]);
  return Mesh(m.positions(), corners);
}

TEST(Refine, DoesNotDependOnTheOrderOfFacesOrCorners) {
  const Mesh m(sphere(14, 9).positions(), sphere(14, 9).triangles());
  const FunctionMap wavy([](const Vec3& p) { return Vec3(p + Vec3(std::sin(5 * p.y()), 2 * p.x() * p.z(), 3 * p.z())); });
  const Refined a = run(m, wavy, {.maxDeviation = 1e-2}), b = run(shuffled(m), wavy, {.maxDeviation = 1e-2});
  EXPECT_GT(a.report.rounds, 1);
  EXPECT_EQ(a.rest.positions(), b.rest.positions());
  EXPECT_EQ(a.posed, b.posed);
  const auto faces = [](const Mesh& r) {
    std::vector<std::array<Index, 3>> out;
    for (std::size_t f = 0; f < r.faceCount(); ++f) {
      std::array<Index, 3> t{r.face(f)[0], r.face(f)[1], r.face(f)[2]};
      std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
      out.push_back(t);
    }
    std::sort(out.begin(), out.end());
    return out;
  };
  EXPECT_EQ(faces(a.rest), faces(b.rest));
}

TEST(Refine, HasTheSameBitsOnAnyThreadCountAndScale) {
  const auto make = [](int threads, double scale) {
    ThreadLimit limit(threads);
    Mesh m = sphere(40, 20);
    for (Vec3& p : m.mutablePositions()) p *= scale;
    const FunctionMap twist([=](const Vec3& x) {
      const Vec3 p = x / scale;
      const double c = std::cos(2 * p.z()), s = std::sin(2 * p.z());
      return Vec3(Vec3(c * p.x() - s * p.y(), s * p.x() + c * p.y(), 2 * p.z()) * scale);
    });
    Refined r = run(m, twist);
    for (Vec3& p : r.posed) p /= scale;
    return std::pair(std::move(r.posed), r.rest.corners());
  };
  const auto one = make(1, 1);
  EXPECT_GT(one.first.size(), 800u);
  EXPECT_EQ(one, make(2, 1));
  EXPECT_EQ(one, make(7, 1024));
}

TEST(Refine, BindsMidpointsInBoundedBatchesAndJudgesEachEdgeOnce) {
  const FunctionMap bend = bendMap(kPi / 2, 1);
  const Mesh m = grid(200);  // in the plane z = 0: not moved
  const Refined none = run(m, bend);
  EXPECT_EQ(bend.bound, m.vertexCount()) << "no edge is touched";
  std::vector<Vec3> p = m.positions();
  for (Vec3& q : p) std::swap(q.y(), q.z());
  const Mesh upright(p, m.corners());
  const Refined r = run(upright, bend);
  EXPECT_EQ(r.report.insertedVertices, 0u) << "fine enough already";
  EXPECT_LE(bend.largestBatch, std::max<std::size_t>(m.vertexCount(), 1 << 16));
  EXPECT_LE(bend.bound, 2 * m.vertexCount() + EdgeTable(m).size());
}

TEST(Refine, KnownEdgesGiveTheSameAndTheResultsEdgesComeBack) {
  const Mesh m = bar(2, 10, 1);
  const FunctionMap bend = bendMap(kPi, 10);
  Progress progress;
  const Refined anew = run(m, bend), known = refine(m, bend, {.edges = EdgeTable(m)}, {}, progress);
  ASSERT_GT(anew.report.insertedVertices, 10u);
  EXPECT_EQ(known.posed, anew.posed);
  EXPECT_EQ(known.rest.corners(), anew.rest.corners());
  ASSERT_TRUE(anew.input) << "as it was given";
  EXPECT_EQ(anew.input->positions(), m.positions());
  EXPECT_EQ(anew.input->corners(), m.corners());
  EXPECT_FALSE(run(m, bendMap(0.01, 10)).input) << "nothing was inserted";
  const EdgeTable edges(anew.rest);
  ASSERT_EQ(anew.edges.size(), edges.size());
  for (std::size_t e = 0; e < edges.size(); ++e) ASSERT_EQ(anew.edges.vertices(e), edges.vertices(e));
  EXPECT_THROW(refine(m, bend, {.edges = EdgeTable(bar(3, 10, 1))}, {}, progress), std::invalid_argument);
}

TEST(Refine, StartFromKnownImagesGivesTheSame) {
  const Mesh m = bar(2, 10, 1);
  const FunctionMap bend = bendMap(kPi, 10);
  Start start;
  const std::size_t n = m.vertexCount();
  start.position.resize(n), start.safe.resize(n), start.status.resize(n), start.residual.resize(n);
  Progress progress;
  bend.apply(*bend.bind(m.positions()), {start.position, start.safe, start.status, start.residual}, progress);
  const Refined a = run(m, bend), b = refine(m, bend, start, {}, progress);
  EXPECT_EQ(a.posed, b.posed);
  EXPECT_EQ(a.rest.corners(), b.rest.corners());
  start.safe.pop_back();
  EXPECT_THROW(refine(m, bend, start, {}, progress), std::invalid_argument);
}

TEST(Refine, TheMeshStepSeesEveryRoundAndItsChangesAreKept) {
  std::vector<std::size_t> seen;
  Options options{.by = Criterion::Stretch};
  options.meshStep = [&](const Mesh& rest, const map::MapOutput& state) {
    seen.push_back(rest.vertexCount());
    ASSERT_EQ(state.position.size(), rest.vertexCount());
    for (std::size_t v = 0; v < state.position.size(); ++v)
      if (state.position[v].z() != 0.25) state.position[v].z() = 0.25, state.status[v] = Status::Limited;
  };
  const Mesh m = grid(4);
  const Refined r = run(m, stretchMap(4, 4), options);
  EXPECT_EQ(seen, (std::vector<std::size_t>{25, 81, 225}));
  for (const Vec3& p : r.posed) EXPECT_EQ(p.z(), 0.25);
  EXPECT_EQ(countStatuses(r.status)[static_cast<std::size_t>(Status::Limited)], 225u);
}

/// A map whose bound points carry a number that midpoints inherit as the mean, as the paper's field values do.
class InheritingMap final : public map::SpaceMap {
 public:
  struct Bound final : map::Binding {
    std::vector<Vec3> rest;
    std::vector<double> level;
    std::size_t size() const override { return rest.size(); }
  };
  std::shared_ptr<const map::Binding> bind(Points rest) const override {
    auto out = std::make_shared<Bound>();
    out->rest.assign(rest.begin(), rest.end());
    for (const Vec3& p : rest) out->level.push_back(p.x() * p.x());
    return out;
  }
  std::shared_ptr<const map::Binding> bindMidpoints(const map::Binding& binding, Points rest,
                                                    std::span<const std::array<Index, 2>> ends) const override {
    const auto& b = dynamic_cast<const Bound&>(binding);
    EXPECT_EQ(b.size(), rest.size());
    auto out = std::make_shared<Bound>();
    for (const auto& [i, j] : ends) {
      out->rest.push_back(0.5 * (rest[i] + rest[j]));
      out->level.push_back(0.5 * (b.level[i] + b.level[j]));
    }
    return out;
  }
  bool midpointsInherit() const override { return true; }
  void apply(const map::Binding& binding, map::MapOutput out, Progress&) const override {
    const auto& b = dynamic_cast<const Bound&>(binding);
    for (std::size_t i = 0; i < b.size(); ++i) {
      out.position[i] = out.safe[i] = {4 * b.rest[i].x(), b.rest[i].y(), b.level[i]};
      out.status[i] = Status::Converged, out.residual[i] = 0;
    }
  }
  void jacobians(const map::Binding&, std::span<Mat3>) const override {}
};

TEST(Refine, MidpointsInheritTheMeanOfTheirEndsValuesThroughAllRounds) {
  const Mesh m({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2});
  const Refined r = run(m, InheritingMap(), {.by = Criterion::Stretch});
  EXPECT_GE(r.report.rounds, 2);
  // From the ends' 0 and 1 means of means give level = x, where the point's own level is x^2.
  for (std::size_t v = 0; v < r.posed.size(); ++v) EXPECT_NEAR(r.posed[v].z(), r.rest.positions()[v].x(), 1e-15);
}

TEST(Refine, RefusesOptionsOutOfRangeAndStopsWhenCancelled) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(run(cube(), stretchMap(2), {.maxStretch = 0.5}), std::invalid_argument);
  EXPECT_THROW(run(cube(), stretchMap(2), {.maxStretch = nan}), std::invalid_argument);
  EXPECT_THROW(run(cube(), stretchMap(2), {.maxDeviation = 0}), std::invalid_argument);
  EXPECT_THROW(run(cube(), stretchMap(2), {.maxDeviation = nan}), std::invalid_argument);
  EXPECT_THROW(run(cube(), stretchMap(2), {.maxRounds = -1}), std::invalid_argument);
  Progress progress;
  progress.cancel();
  EXPECT_THROW(refine(cube(), stretchMap(4), {}, progress), Cancelled);
}

TEST(Refine, NothingAndFlatThingsComeThrough) {
  EXPECT_EQ(run(Mesh{}, stretchMap(3)).rest.vertexCount(), 0u);
  const Mesh cloud({{0, 0, 0}, {1, 1, 1}}, std::vector<Index>{});
  EXPECT_EQ(run(cloud, stretchMap(3)).posed[1], Vec3(3, 1, 1));
  const Mesh point(std::vector<Vec3>(3, Vec3(1, 1, 1)), {0, 1, 2});
  EXPECT_EQ(run(point, noiseMap(1)).report.reason, StopReason::Done) << "an object without size has no tolerance";
}

}  // namespace
}  // namespace fielddeform::resample
