#include <gtest/gtest.h>
#include <tests/support/cases.h>

#include <map>
#include <numbers>

namespace fielddeform::tests {
namespace {

double volume(Points positions, const std::vector<Index>& corners) {
  double sum = 0;
  for (std::size_t i = 0; i < corners.size(); i += 3) {
    sum += positions[corners[i]].dot(positions[corners[i + 1]].cross(positions[corners[i + 2]]));
  }
  return sum / 6;
}

class Cases : public testing::TestWithParam<std::string> {};

TEST_P(Cases, AreClosedAndOrientedOutwards) {
  const Case c = makeCase(GetParam());
  EXPECT_EQ(c.mesh.vertexCount(), c.name == "branch" ? 7374u : 9602u);
  EXPECT_EQ(c.mesh.faceCount(), 2 * c.mesh.vertexCount() - 4);  // Euler: a topological sphere
  std::map<std::pair<Index, Index>, int> directed;
  for (std::size_t f = 0; f < c.mesh.faceCount(); ++f) {
    const auto t = c.mesh.face(f);
    for (int k = 0; k < 3; ++k) ++directed[{t[k], t[(k + 1) % 3]}];
  }
  for (const auto& [edge, count] : directed) {
    ASSERT_EQ(count, 1);
    ASSERT_EQ(directed.count({edge.second, edge.first}), 1u);
  }
  EXPECT_GT(volume(c.mesh.positions(), c.mesh.corners()), 0);
}

TEST_P(Cases, SkeletonsMatchAndAreValid) {
  const Case c = makeCase(GetParam());
  ASSERT_EQ(c.rest.primitives.size(), c.posed.primitives.size());
  for (std::size_t i = 0; i < c.rest.primitives.size(); ++i) {
    EXPECT_EQ(c.rest.primitives[i].name, c.posed.primitives[i].name);
    EXPECT_EQ(c.rest.primitives[i].points.size(), c.posed.primitives[i].points.size());
    EXPECT_GT(c.rest.primitives[i].radius.value(), 0);
  }
}

TEST_P(Cases, StartAtRest) {
  const Case c = makeCase(GetParam(), 0);
  // Bending by 1e-9 radians stands for not bending: it moves by up to 1e-9 of the length, squared over the radius.
  for (std::size_t i = 0; i < c.ideal.size(); ++i) ASSERT_LT((c.ideal[i] - c.mesh.positions()[i]).norm(), 1e-6);
  for (std::size_t i = 0; i < c.rest.primitives.size(); ++i) {
    for (std::size_t j = 0; j < c.rest.primitives[i].points.size(); ++j) {
      ASSERT_LT((c.rest.primitives[i].points[j] - c.posed.primitives[i].points[j]).norm(), 1e-6);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, Cases, testing::ValuesIn(caseNames()), [](const auto& p) { return p.param; });

TEST(CaseMaps, BendAndTwistKeepVolume) {
  // Both maps have determinant 1 - x / R (mean 1 over a body symmetric in x; here bumps leave 0.1 %) and 1.
  for (const char* name : {"bend90", "bend180", "twist4_180", "lodtwist180", "rottrans"}) {
    const Case c = makeCase(name);
    const double before = volume(c.mesh.positions(), c.mesh.corners());
    EXPECT_NEAR(volume(c.ideal, c.mesh.corners()) / before, 1, 3e-3) << name;
  }
}

TEST(CaseMaps, BendKeepsTheSpinesLengthAndTurnsItsEnds) {
  const std::vector<Vec3> line = verticalLine(1001, 2);
  const std::vector<Vec3> arc = bendMap(line, std::numbers::pi / 2);
  double length = 0;
  for (std::size_t i = 1; i < arc.size(); ++i) length += (arc[i] - arc[i - 1]).norm();
  EXPECT_NEAR(length, 2, 1e-6);  // a chord of 1/1000 of a quarter circle is 1e-7 shorter than its arc
  const Vec3 first = (arc[1] - arc[0]).normalized(), last = (arc[1000] - arc[999]).normalized();
  EXPECT_NEAR(first.dot(last), 0, 2e-3);
}

TEST(CaseMaps, UnknownNameIsRefused) { EXPECT_THROW(makeCase("bend91"), std::invalid_argument); }

}  // namespace
}  // namespace fielddeform::tests
