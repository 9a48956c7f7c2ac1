#include <fielddeform/mesh/measures.h>
#include <fielddeform/mesh/topology.h>
#include <fielddeform/solid/size.h>
#include <fielddeform/solid/tessellate.h>
#include <gtest/gtest.h>
#include <tests/solid/solids.h>

#include <map>

namespace fielddeform::solid {
namespace {

/// Every directed edge once, its opposite too.
void expectClosed(const mesh::Mesh& m) {
  std::map<std::pair<Index, Index>, int> edges;
  for (std::size_t f = 0; f < m.faceCount(); ++f) {
    const auto c = m.face(f);
    for (std::size_t k = 0; k < c.size(); ++k) ++edges[{c[k], c[(k + 1) % c.size()]}];
  }
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1);
    EXPECT_EQ(edges.count({edge.second, edge.first}), 1u);
  }
}

double volumeOf(const mesh::Mesh& m) { return *mesh::volume(m, m.positions()).value; }

TEST(Tessellate, IsClosedAcrossSharedFacesAndConvergesToTheSize) {
  Object object = test::row();
  for (std::size_t i = 0; i < object.points.size(); ++i) object.points[i] += .12 * test::randomPoint(1, i);
  const Sizes sizes(object);
  double exact = 0;
  for (std::size_t s = 0; s < 3; ++s) exact += sizes.value(s, object.points);
  double before = 0;
  for (const int n : {4, 8, 16}) {
    const mesh::Mesh m = tessellate(object, n);
    expectClosed(m);
    EXPECT_EQ(m.faceCount(), static_cast<std::size_t>(14 * n * n));
    EXPECT_EQ(m.vertexCount(), static_cast<std::size_t>(14 * n * n + 2));  // a sphere
    const double off = std::abs(volumeOf(m) - exact);
    if (before > 0) {
      EXPECT_LT(off, before / 3);  // second order: a fourth
    }
    before = off;
  }
}

TEST(Tessellate, TurnsLeftHandedSolidsOutAndJoinsCollapsedEdges) {
  Object mirrored = test::boxObject({2, 2, 2});
  for (Vec3& p : mirrored.points) p.x() = -p.x();
  EXPECT_NEAR(volumeOf(tessellate(mirrored, 3)), 1, 1e-14);
  Object wedge = test::boxObject({1, 1, 1});
  wedge.points[5] = wedge.points[4], wedge.points[7] = wedge.points[6];
  const mesh::Mesh m = tessellate(wedge, 4);
  expectClosed(m);
  EXPECT_NEAR(volumeOf(m), .5, 1e-14);
}

TEST(Tessellate, ClosesARing) {
  // Four solids round an axis, all joined: a torus.
  std::vector<LooseSolid> solids;
  for (int s = 0; s < 4; ++s) {
    LooseSolid l = test::boxSolid(std::to_string(s), {2, 1, 1});
    for (Vec3& p : l.points) {
      const double a = (s + p.x()) * std::acos(-1.0) / 2, r = (2 + p.y()) * (p.x() == .5 ? std::sqrt(2.0) : 1);
      p = Vec3(r * std::sin(a), r * std::cos(a), p.z());
      for (int c = 0; c < 2; ++c)
        if (std::abs(p[c]) < 1e-12) p[c] = 0;
    }
    solids.push_back(l);
  }
  std::vector<Joint> joints;
  for (std::size_t s = 0; s < 4; ++s) joints.push_back({{s, Side::U1}, {(s + 1) % 4, Side::U0}, 0, 1});
  const mesh::Mesh m = tessellate(makeObject(solids, joints), 3);
  expectClosed(m);
  EXPECT_EQ(m.vertexCount(), m.faceCount());
}

TEST(Tessellate, SamplesAreWhereTheySay) {
  const Object object = test::boxObject({2, 3, 2}, .2);
  const mesh::Mesh m = sampleInside(object, 3);
  ASSERT_EQ(m.vertexCount(), 64u);
  const auto* u = m.find(mesh::Element::Vertex, "u");
  const auto* v = m.find(mesh::Element::Vertex, "v");
  const auto* w = m.find(mesh::Element::Vertex, "w");
  for (std::size_t i = 0; i < 64; ++i) EXPECT_LT((m.positions()[i] - evaluate(object, 0, Vec3(u->get(i), v->get(i), w->get(i)))).norm(), 1e-15);
  EXPECT_THROW(tessellate(object, 0), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::solid
