#include <fielddeform/core/parallel.h>
#include <fielddeform/core/random.h>
#include <fielddeform/core/rigid.h>
#include <fielddeform/mesh/normals.h>
#include <gtest/gtest.h>
#include <tests/support/shapes.h>

#include <limits>
#include <set>

namespace fielddeform::mesh {
namespace {

using namespace fielddeform::test;
const Rigid kMotion{Quat(0.5, 0.1, -0.7, 0.5).normalized(), {3, -2, 5}};

Vec3 value(const Attribute& a, std::size_t i) { return {a.get(i, 0), a.get(i, 1), a.get(i, 2)}; }

Attribute normals(Element on, const std::vector<Vec3>& values, std::vector<Index> indices = {},
                  ScalarType type = ScalarType::Float64) {
  Attribute a{"normal", on, 3, Interpolation::Direction, makeData(type, 3 * values.size()), std::move(indices), {}};
  for (std::size_t i = 0; i < values.size(); ++i)
    for (int k = 0; k < 3; ++k) a.set(i, k, values[i][k]);
  return a;
}

/// Six face normals, each used by the four corners of its face, as modellers write a cube.
Mesh cubeWithFaceNormals() {
  Mesh m = quadCube();
  std::vector<Index> indices;
  for (Index c = 0; c < 24; ++c) indices.push_back(c / 4);
  m.attributes().push_back(normals(Element::Corner, {{0, 0, -1}, {0, 0, 1}, {0, -1, 0}, {0, 1, 0}, {-1, 0, 0}, {1, 0, 0}}, indices));
  return m;
}

TEST(VertexNormals, AreRadialOnASphereAndDiagonalOnACube) {
  const Mesh s = sphere(24, 12);
  for (std::size_t v = 0; v < s.vertexCount(); ++v)
    EXPECT_NEAR((vertexNormals(s, s.positions())[v] - s.positions()[v]).norm(), 0, 1e-13);
  for (const Mesh& m : {cube(), quadCube()})
    EXPECT_NEAR((vertexNormals(m, m.positions())[7] - Vec3(1, 1, 1).normalized()).norm(), 0, 1e-15)
        << "whichever way the squares are divided";
}

TEST(Normals, FollowARigidMotionWhateverTheirRelationToTheSurface) {
  Mesh m = sphere(16, 8);
  std::vector<Vec3> odd;
  for (std::size_t v = 0; v < m.vertexCount(); ++v)
    odd.push_back(Vec3(uniform01(1, 3 * v) - 0.5, uniform01(1, 3 * v + 1) - 0.5, uniform01(1, 3 * v + 2)) * 7);
  m.attributes().push_back(normals(Element::Vertex, odd));
  const auto posed = moved(m, kMotion);
  const NormalReport r = updateNormals(m, m.positions(), posed);
  EXPECT_EQ(r.turned, m.vertexCount());
  for (std::size_t v = 0; v < odd.size(); ++v)
    EXPECT_NEAR((value(m.attributes()[0], v) - kMotion.rotation * odd[v]).norm(), 0, 1e-13);
}

TEST(Normals, GeometricOnesStayGeometricUnderStretchAndBend) {
  Mesh m = sphere(32, 16);
  m.attributes().push_back(normals(Element::Vertex, vertexNormals(m, m.positions())));
  const auto posed = moved(m, [](const Vec3& p) { return Vec3(2 * p.x(), p.y() + p.x() * p.x(), 0.5 * p.z()); });
  Mesh recomputed = m;
  updateNormals(m, m.positions(), posed);
  updateNormals(recomputed, m.positions(), posed, NormalUpdate::Recompute);
  const auto expected = vertexNormals(m, posed);
  for (std::size_t v = 0; v < expected.size(); ++v) {
    EXPECT_NEAR((value(m.attributes()[0], v) - expected[v]).norm(), 0, 1e-13);
    EXPECT_NEAR((value(recomputed.attributes()[0], v) - expected[v]).norm(), 0, 1e-13);
  }
}

TEST(Normals, KeepTheirLengthAndOppositeOnesStayOpposite) {
  Mesh m = grid(4);
  m.attributes().push_back(normals(Element::Vertex, std::vector<Vec3>(25, Vec3(0, 0, -3))));
  // Turned by exactly half a circle about y.
  updateNormals(m, m.positions(), moved(m, [](const Vec3& p) { return Vec3(-p.x(), p.y(), -p.z()); }));
  for (std::size_t v = 0; v < 25; ++v) EXPECT_NEAR((value(m.attributes()[0], v) - Vec3(0, 0, 3)).norm(), 0, 1e-14);
}

TEST(Normals, UnmovedSurroundingsKeepTheirBits) {
  for (const NormalUpdate update : {NormalUpdate::Turn, NormalUpdate::Recompute}) {
    Mesh m = grid(8);
    std::vector<Vec3> odd;
    for (std::size_t v = 0; v < m.vertexCount(); ++v) odd.emplace_back(0.1, uniform01(3, v), 0.3);
    m.attributes().push_back(normals(Element::Vertex, odd));
    const Mesh before = m;
    EXPECT_EQ(updateNormals(m, m.positions(), m.positions(), update).turned, 0u);
    EXPECT_EQ(m.attributes()[0].data, before.attributes()[0].data);
    auto posed = m.positions();
    posed[40].z() = 0.1;
    const NormalReport r = updateNormals(m, m.positions(), posed, update);
    EXPECT_EQ(r.turned, 7u) << "the vertex and the six around it";
    EXPECT_EQ(r.kept, 81u - 7u);
    EXPECT_EQ(value(m.attributes()[0], 0), odd[0]);
    EXPECT_NE(value(m.attributes()[0], 41), odd[41]);
  }
}

TEST(Normals, SharedCornerNormalsStaySharedUnderARigidMotion) {
  Mesh m = cubeWithFaceNormals();
  const auto posed = moved(m, kMotion);
  const Attribute before = m.attributes()[0];
  const NormalReport r = updateNormals(m, m.positions(), posed);
  EXPECT_EQ(r.added, 0u);
  EXPECT_EQ(m.attributes()[0].valueCount(), 6u);
  EXPECT_EQ(m.attributes()[0].indices, before.indices);
  for (std::size_t i = 0; i < 6; ++i)
    EXPECT_NEAR((value(m.attributes()[0], i) - kMotion.rotation * value(before, i)).norm(), 0, 1e-14);
}

TEST(Normals, SharedCornerNormalsAreSplitWhereTheyTurnDifferently) {
  Mesh m = grid(4);  // one normal for the whole plane
  m.attributes().push_back(normals(Element::Corner, {{0, 0, 1}}, std::vector<Index>(m.cornerCount(), 0)));
  const auto posed = moved(m, [](const Vec3& p) {  // flat for x <= .25, then a quarter circle
    const double a = std::max(0.0, p.x() - 0.25) * 2;
    return p.x() <= 0.25 ? p : Vec3(0.25 + std::sin(a) / 2, p.y(), (1 - std::cos(a)) / 2);
  });
  const NormalReport r = updateNormals(m, m.positions(), posed);
  const Attribute& a = m.attributes()[0];
  EXPECT_EQ(a.valueCount(), 1 + r.added);
  EXPECT_EQ(value(a, 0), Vec3(0, 0, 1)) << "the unmoved column keeps the value and its bits";
  const auto expected = vertexNormals(m, posed);
  std::set<Index> used(a.indices.begin(), a.indices.end());
  EXPECT_EQ(used.size(), a.valueCount()) << "no value without a corner";
  for (std::size_t c = 0; c < m.cornerCount(); ++c)
    EXPECT_NEAR((value(a, a.indices[c]) - expected[m.corners()[c]]).norm(), 0, 1e-6);
  EXPECT_LT(a.valueCount(), 25u) << "equal directions stay shared";
}

TEST(Normals, CornersWithoutIndicesTurnWithTheFacesThatShareTheirValue) {
  // A roof: two quads, flat normals. Opening the roof turns each side with its own face.
  Mesh m({{0, 0, 0}, {0, 1, 0}, {-1, 1, 0}, {-1, 0, 0}, {1, 0, 0}, {1, 1, 0}}, {0, 1, 2, 3, 0, 4, 5, 1}, {0, 4, 8});
  m.attributes().push_back(normals(Element::Corner, std::vector<Vec3>(8, Vec3(0, 0, 1)), {}, ScalarType::Float32));
  for (Index c = 4; c < 8; ++c) m.attributes()[0].set(c, 0, 1e-3);  // another smoothing group
  auto posed = m.positions();
  posed[2].z() = posed[3].z() = -1;
  updateNormals(m, m.positions(), posed);
  const Attribute& a = m.attributes()[0];
  for (std::size_t c = 0; c < 4; ++c) EXPECT_NEAR((value(a, c) - Vec3(-1, 0, 1).normalized()).norm(), 0, 1e-7);
  for (std::size_t c = 4; c < 8; ++c) EXPECT_EQ(value(a, c).x(), static_cast<double>(1e-3f));
}

TEST(Normals, OfFacesTurnWithTheFace) {
  Mesh m = cube();
  std::vector<Vec3> values;
  for (std::size_t f = 0; f < 12; ++f) {
    const auto t = m.face(f);
    const auto& p = m.positions();
    values.push_back((p[t[1]] - p[t[0]]).cross(p[t[2]] - p[t[0]]));
  }
  m.attributes().push_back(normals(Element::Face, values));
  updateNormals(m, m.positions(), moved(m, kMotion));
  for (std::size_t f = 0; f < 12; ++f)
    EXPECT_NEAR((value(m.attributes()[0], f) - kMotion.rotation * values[f]).norm(), 0, 1e-14);
}

TEST(Normals, ZeroNonFiniteAndDegenerateSurroundingsAreKept) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Mesh m({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 1, 0}, {5, 5, 5}}, {0, 1, 2, 0, 1, 3});
  m.attributes().push_back(normals(Element::Vertex, {{0, 0, 0}, {nan, 0, 1}, {0, 0, 1}, {0, 0, 1}, {1, 0, 0}}));
  auto posed = moved(m, kMotion);
  posed[3].x() = nan;
  EXPECT_EQ(updateNormals(m, m.positions(), posed).turned, 0u);
  EXPECT_EQ(value(m.attributes()[0], 4), Vec3(1, 0, 0));
  EXPECT_THROW(updateNormals(m, m.positions(), {}), std::invalid_argument);
}

TEST(Normals, HaveTheSameBitsOnAnyThreadCountAndScale) {
  const auto run = [](int threads, double scale) {
    ThreadLimit limit(threads);
    Mesh m = sphere(80, 40);
    m.attributes().push_back(normals(Element::Vertex, vertexNormals(m, m.positions())));
    std::vector<Index> indices(m.corners());
    m.attributes().push_back(normals(Element::Corner, vertexNormals(m, m.positions()), indices));
    for (Vec3& p : m.mutablePositions()) p *= scale;
    auto posed = m.positions();
    for (std::size_t i = 0; i < posed.size(); ++i) posed[i] += scale * 0.01 * Vec3(uniform01(5, i), uniform01(6, i), 0);
    updateNormals(m, m.positions(), posed);
    return std::pair(m.attributes()[0].data, m.attributes()[1].data);
  };
  EXPECT_EQ(run(1, 1), run(2, 1));
  EXPECT_EQ(run(1, 1), run(7, 1024));
}

}  // namespace
}  // namespace fielddeform::mesh
