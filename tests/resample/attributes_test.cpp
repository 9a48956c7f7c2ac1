#include <fielddeform/resample/refine.h>
#include <gtest/gtest.h>
#include <tests/support/maps.h>
#include <tests/support/shapes.h>

#include <algorithm>
#include <map>
#include <set>

namespace fielddeform::resample {
namespace {

using namespace fielddeform::test;
using mesh::Attribute;
using mesh::Element;
using mesh::Interpolation;
using mesh::ScalarType;

Refined run(const Mesh& m, const map::SpaceMap& map = stretchMap(2, 2)) {
  Progress progress;
  return refine(m, map, {.by = Criterion::Stretch}, progress);
}

Attribute make(const char* name, Element on, int width, Interpolation rule, ScalarType type, std::size_t count) {
  return {name, on, width, rule, mesh::makeData(type, count * static_cast<std::size_t>(width)), {}, {}};
}

TEST(RefinedAttributes, OfVerticesFollowTheirRule) {
  Mesh m({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2});
  Attribute color = make("color", Element::Vertex, 1, Interpolation::Linear, ScalarType::UInt8, 3);
  Attribute label = make("label", Element::Vertex, 1, Interpolation::Nearest, ScalarType::Int32, 3);
  Attribute normal = make("normal", Element::Vertex, 3, Interpolation::Direction, ScalarType::Float64, 3);
  for (std::size_t v = 0; v < 3; ++v) {
    color.set(v, 0, v == 0 ? 10 : 251);
    label.set(v, 0, 100 + static_cast<double>(v));
    normal.set(v, static_cast<int>(v), 2);
  }
  m.attributes() = {color, label, normal};
  const Refined r = run(m);
  ASSERT_EQ(r.rest.vertexCount(), 6u);
  const auto& a = r.rest.attributes();
  for (std::size_t v = 3; v < 6; ++v) {
    const auto [p, q] = r.parents[v - 3];
    EXPECT_EQ(a[0].get(v), p == 0 ? 130 : 251) << "130.5 rounds to even";
    EXPECT_EQ(a[1].get(v), 100 + p) << "ties take the lower vertex";
    double length = 0;
    for (int k = 0; k < 3; ++k) length += a[2].get(v, k) * a[2].get(v, k);
    EXPECT_NEAR(std::sqrt(length), 2, 1e-15) << "a direction keeps its length";
  }
}

TEST(RefinedAttributes, LinearOnesAreLinearInPositionThroughAllRounds) {
  Mesh m = grid(3, 4);
  Attribute height = make("height", Element::Vertex, 1, Interpolation::Linear, ScalarType::Float64, m.vertexCount());
  Attribute uv = make("uv", Element::Corner, 2, Interpolation::Linear, ScalarType::Float64, m.cornerCount());
  Attribute shared = make("shared", Element::Corner, 2, Interpolation::Linear, ScalarType::Float64, m.vertexCount());
  const auto f = [](const Vec3& p) { return 1 + 2 * p.x() - 3 * p.y(); };
  for (std::size_t v = 0; v < m.vertexCount(); ++v) {
    height.set(v, 0, f(m.positions()[v]));
    shared.set(v, 0, m.positions()[v].x()), shared.set(v, 1, m.positions()[v].y());
  }
  for (std::size_t c = 0; c < m.cornerCount(); ++c)
    for (int k = 0; k < 2; ++k) uv.set(c, k, m.positions()[m.corners()[c]][k]);
  shared.indices = m.corners();
  m.attributes() = {height, uv, shared};
  const Refined r = run(m, stretchMap(7, 3));
  EXPECT_GE(r.report.rounds, 2);
  for (std::size_t v = 0; v < r.rest.vertexCount(); ++v)
    EXPECT_NEAR(r.rest.attributes()[0].get(v), f(r.rest.positions()[v]), 1e-14);
  const auto& s = r.rest.attributes()[2];
  EXPECT_EQ(s.valueCount(), r.rest.vertexCount()) << "no seam: one value a vertex";
  for (std::size_t c = 0; c < r.rest.cornerCount(); ++c)
    for (int k = 0; k < 2; ++k) {
      const double x = r.rest.positions()[r.rest.corners()[c]][k];
      EXPECT_NEAR(r.rest.attributes()[1].get(c, k), x, 1e-14);
      EXPECT_NEAR(s.get(s.indices[c], k), x, 1e-14);
    }
}

TEST(RefinedAttributes, ASeamStaysASeamAndOnlyIt) {
  // Two triangles; the texture of the right one is shifted by 10. Their common edge 0-2 is a seam.
  Mesh m({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {0, 1, 2, 0, 2, 3});
  Attribute uv = make("uv", Element::Corner, 1, Interpolation::Linear, ScalarType::Float32, 6);
  for (std::size_t c = 0; c < 6; ++c) uv.set(c, 0, m.positions()[m.corners()[c]].x() + (c >= 3 ? 10 : 0));
  uv.indices = {0, 1, 2, 3, 4, 5};
  m.attributes() = {uv};
  const Refined r = run(m, stretchMap(4, 4));
  const Attribute& a = r.rest.attributes()[0];
  std::map<Index, std::set<Index>> valuesOfVertex;
  for (std::size_t f = 0; f < r.rest.faceCount(); ++f)
    for (Index c = r.rest.faceBegin(f); c < r.rest.faceBegin(f + 1); ++c) {
      const Index v = r.rest.corners()[c];
      EXPECT_NEAR(a.get(a.indices[c]), r.rest.positions()[v].x() + (r.faceParent[f] == 1 ? 10 : 0), 1e-6);
      valuesOfVertex[v].insert(a.indices[c]);
    }
  for (const auto& [v, values] : valuesOfVertex) {
    const Vec3& p = r.rest.positions()[v];
    EXPECT_EQ(values.size(), p.x() == p.y() ? 2u : 1u) << v;
  }
}

TEST(RefinedAttributes, CornersWithoutAValueAndEqualEndsAddNone) {
  Mesh m({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2});
  Attribute uv = make("uv", Element::Corner, 1, Interpolation::Linear, ScalarType::Float32, 1);
  uv.indices = {0, 0, kNoIndex};
  m.attributes() = {uv};
  const Refined r = run(m);
  const Attribute& a = r.rest.attributes()[0];
  EXPECT_EQ(a.valueCount(), 1u);
  ASSERT_EQ(a.indices.size(), r.rest.cornerCount());
  for (std::size_t c = 0; c < a.indices.size(); ++c)
    EXPECT_EQ(a.indices[c], r.rest.positions()[r.rest.corners()[c]].y() == 0 ? 0 : kNoIndex);
}

TEST(RefinedAttributes, FacesInheritAndListsAreCopied) {
  Mesh m = grid(2);
  Attribute id = make("id", Element::Face, 1, Interpolation::Linear, ScalarType::Int32, m.faceCount());
  for (std::size_t f = 0; f < m.faceCount(); ++f) id.set(f, 0, static_cast<double>(7 * f));
  Attribute list = make("list", Element::Face, 1, Interpolation::Nearest, ScalarType::UInt8, 0);
  list.listOffsets = {0};
  std::vector<std::uint8_t> values;
  for (std::size_t f = 0; f < m.faceCount(); ++f) {
    for (std::size_t k = 0; k < f % 3; ++k) values.push_back(static_cast<std::uint8_t>(f));
    list.listOffsets.push_back(static_cast<Index>(values.size()));
  }
  list.data = values;
  Attribute onVertices = make("rings", Element::Vertex, 1, Interpolation::Nearest, ScalarType::Int8, m.vertexCount());
  for (Index v = 0; v <= m.vertexCount(); ++v) onVertices.listOffsets.push_back(v);
  m.attributes() = {id, list, onVertices};
  const Refined r = run(m);
  const auto& a = r.rest.attributes();
  ASSERT_EQ(a[1].listOffsets.size(), r.rest.faceCount() + 1);
  for (std::size_t f = 0; f < r.rest.faceCount(); ++f) {
    EXPECT_EQ(a[0].get(f), 7 * r.faceParent[f]);
    ASSERT_EQ(a[1].listOffsets[f + 1] - a[1].listOffsets[f], r.faceParent[f] % 3);
    for (Index i = a[1].listOffsets[f]; i < a[1].listOffsets[f + 1]; ++i) EXPECT_EQ(a[1].get(i), r.faceParent[f]);
  }
  EXPECT_EQ(a[2].listOffsets.size(), r.rest.vertexCount() + 1);
  EXPECT_EQ(a[2].valueCount(), r.rest.vertexCount());
}

/// Remembers what it was told.
struct Recorder final : mesh::FileLayout {
  std::vector<Index> parents;
  std::size_t vertices = 0;
  std::shared_ptr<const FileLayout> refined(std::span<const Index> faceParent, std::size_t vertexCount) const override {
    auto out = std::make_shared<Recorder>();
    out->parents.assign(faceParent.begin(), faceParent.end());
    out->vertices = vertexCount;
    return out;
  }
};

TEST(RefinedAttributes, TheLayoutHearsOfTheInputsFacesOnce) {
  Mesh m = grid(2);
  m.setLayout(std::make_shared<Recorder>());
  m.setPositionType(ScalarType::Float32);
  const Refined r = run(m, stretchMap(6, 6));
  EXPECT_GE(r.report.rounds, 2);
  const auto& layout = dynamic_cast<const Recorder&>(*r.rest.layout());
  EXPECT_EQ(layout.parents, r.faceParent);
  EXPECT_EQ(layout.vertices, r.rest.vertexCount());
  EXPECT_EQ(r.rest.positionType(), ScalarType::Float32);
  EXPECT_EQ(run(m, stretchMap(1)).rest.layout(), m.layout()) << "nothing inserted: the layout itself";
}

TEST(RefinedAttributes, LinesAlongDividedEdgesPassThroughTheNewVertices) {
  Mesh m({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {5, 5, 5}}, {0, 1, 2});
  m.lines() = {{{1, 0, 3}}, {{}}};
  m.loosePoints() = {3};
  const Refined r = run(m);
  ASSERT_EQ(r.rest.lines()[0].vertices.size(), 4u);
  EXPECT_EQ(r.rest.positions()[r.rest.lines()[0].vertices[1]], Vec3(0.5, 0, 0));
  EXPECT_EQ(r.rest.lines().size(), 2u);
  EXPECT_EQ(r.rest.loosePoints(), m.loosePoints());
}

}  // namespace
}  // namespace fielddeform::resample
