#include <fielddeform/core/error.h>
#include <fielddeform/map/lattice_io.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <tests/map/lattices.h>

#include <cmath>
#include <stdexcept>

namespace fielddeform::map {
namespace {

std::vector<Lattice> someLattices() {
  std::vector<Lattice> all;
  Lattice l;
  all.push_back(l);  // nothing moved, the unit box
  l.box = test::skewBox();
  l.axis = {AxisBasis::bspline(5, 3, Border::Coincident), AxisBasis::withKnots(2, {0, 0, 0.1, 1, 2.5, 3, 3}), AxisBasis::bernstein(3)};
  l.outside = Outside::Keep;
  all.push_back(test::shaken(l, 1, 0.3));
  l.axis[2] = AxisBasis::bspline(6, 2, Border::Free);
  l.displacements.assign(l.nodeCount(), Vec3::Zero());
  l.displacements[7] = Vec3(0.1, -0.3, 1e-7);
  all.push_back(l);
  return all;
}

void expectSame(const Lattice& a, const Lattice& b) {
  EXPECT_TRUE(a.box == b.box);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_TRUE(a.axis[k] == b.axis[k]);
  EXPECT_EQ(a.outside, b.outside);
}

std::vector<Vec3> displacements(const Lattice& l) {
  return l.displacements.empty() ? std::vector<Vec3>(l.nodeCount(), Vec3::Zero()) : l.displacements;
}

// The message of what reading a text throws; empty if it throws nothing.
std::string refusal(const std::string& text) {
  try {
    parseLattice(text, "l.json");
  } catch (const IoError& error) {
    return error.what();
  }
  return "";
}

TEST(LatticeIo, JsonKeepsEveryBit) {
  for (const Lattice& l : someLattices()) {
    const std::string text = formatLattice(l, LatticeFormat::Json);
    const Lattice back = parseLattice(text, "l.json");
    expectSame(l, back);
    EXPECT_EQ(displacements(l), displacements(back));
    EXPECT_EQ(formatLattice(back, LatticeFormat::Json), text);
  }
}

TEST(LatticeIo, JsonIsShortWhereFewNodesAreMoved) {
  const std::string text = formatLattice(someLattices()[2], LatticeFormat::Json);
  EXPECT_NE(text.find("\"moves\""), std::string::npos);
  EXPECT_LT(text.size(), 700u);
}

TEST(LatticeIo, ObjKeepsWhereNodesStandAndTheZeroOfThoseAtRest) {
  for (const Lattice& l : someLattices()) {
    const std::string text = formatLattice(l, LatticeFormat::Obj);
    const Lattice back = parseLattice(text, "l.obj");
    expectSame(l, back);
    const std::vector<Vec3> rest = l.restNodes(), before = displacements(l);
    for (std::size_t i = 0; i < rest.size(); ++i) {
      EXPECT_LT((back.displacements[i] - before[i]).norm(), 1e-15);
      if (before[i] == Vec3::Zero()) {
        EXPECT_EQ(back.displacements[i], Vec3(Vec3::Zero()));
      }
    }
    EXPECT_EQ(formatLattice(back, LatticeFormat::Obj), text);
  }
}

TEST(LatticeIo, ObjGridsHaveALineAlongEveryRowOfNodes) {
  Lattice l;
  l.axis = {AxisBasis::bernstein(2), AxisBasis::bernstein(3), AxisBasis::bernstein(4)};
  const std::string text = formatLattice(l, LatticeFormat::Obj);
  std::size_t lines = 0;
  for (std::size_t i = text.find("\nl "); i != std::string::npos; i = text.find("\nl ", i + 1)) ++lines;
  EXPECT_EQ(lines, 2u * 3 + 3u * 4 + 4u * 2);
  EXPECT_NE(text.find("\nl 1 2\n"), std::string::npos);
  EXPECT_NE(text.find("\nl 2 4 6\n"), std::string::npos);
  EXPECT_NE(text.find("\nl 6 12 18 24\n"), std::string::npos);
}

TEST(LatticeIo, AModellersRoundingMovesNoNode) {
  Lattice l = someLattices()[1];
  l.displacements.clear();
  // As Blender writes: floats with six decimals, without comments.
  std::string text = "# Blender v3.4.1 OBJ File: ''\no lattice\n";
  const std::vector<Vec3> rest = l.restNodes();
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const Vec3 at = i == 5 ? Vec3(rest[i] + Vec3(0.25, 0, 0)) : rest[i];
    text += fmt::format("v {:.6f} {:.6f} {:.6f}\n", static_cast<float>(at[0]), static_cast<float>(at[1]), static_cast<float>(at[2]));
  }
  text += "vn 0 0 1\nl 1 2\nf 1 2 3\n";
  const Lattice moved = parseMovedNodes(l, text, "moved.obj");
  for (std::size_t i = 0; i < rest.size(); ++i) {
    if (i != 5) {
      EXPECT_EQ(moved.displacements[i], Vec3(Vec3::Zero())) << i;
      continue;
    }
    EXPECT_NEAR(moved.displacements[i].x(), 0.25, 1e-6);
    EXPECT_EQ(moved.displacements[i].y(), 0);
  }
  // Round numbers that were typed are no rounding.
  Lattice unit;
  unit.axis[0] = AxisBasis::bernstein(3);
  std::string typed;
  for (const Vec3& p : unit.restNodes()) typed += fmt::format("v {} {} {}\n", p.x() == 0.5 ? 0.52 : p.x(), p.y(), p.z());
  EXPECT_NEAR(parseMovedNodes(unit, typed, "t.obj").displacements[1].x(), 0.02, 1e-15);
}

TEST(LatticeIo, RefitCarriesBoxCoordinatesOver) {
  Lattice l = someLattices()[1];
  l.outside = Outside::Extend;
  LatticeBox box;
  box.origin = Vec3(100, 3, -7);
  box.axes << 1, 5, 0.3, -2, 0.4, 0.1, 0, 2, 9;
  const Lattice other = refit(l, box);
  const LatticeMap a(l), b(other);
  for (std::uint64_t i = 0; i < 50; ++i) {
    const Vec3 u = 1.5 * test::randomPoint(2, i);
    const Vec3 pa = a.position(l.box.origin + l.box.axes * u), pb = b.position(box.origin + box.axes * u);
    EXPECT_LT((l.box.axes.inverse() * (pa - l.box.origin) - box.axes.inverse() * (pb - box.origin)).norm(), 1e-12);
  }
  EXPECT_EQ(refit(l, l.box).displacements, l.displacements);
  box.axes.col(0).setZero();
  EXPECT_THROW(refit(l, box), std::invalid_argument);
}

TEST(LatticeIo, WhatIsWrongIsNamedWithItsPlace) {
  const std::string good = R"({"format": "fielddeform-lattice", "version": 1, "axes": [
    {"basis": "bernstein", "nodes": 2}, {"basis": "bernstein", "nodes": 2}, {"basis": "bspline", "nodes": 4}]AND})";
  const auto with = [&](const std::string& more) { return refusal(std::string(good).replace(good.find("AND"), 3, more)); };
  EXPECT_EQ(with(""), "");
  EXPECT_NE(with(", \"outsid\": \"keep\"").find("did you mean \"outside\""), std::string::npos);
  EXPECT_NE(with(", \"outside\": \"kept\"").find("/outside"), std::string::npos);
  EXPECT_NE(with(", \"displacements\": [[0,0,0]]").find("16, one a node"), std::string::npos);
  EXPECT_NE(with(", \"moves\": [{\"node\": [0,0,4], \"by\": [1,0,0]}]").find("/moves/0/node/2"), std::string::npos);
  EXPECT_NE(with(", \"displacements\": [], \"moves\": []").find("one of them"), std::string::npos);
  EXPECT_NE(with(R"(, "box": {"origin": [0,0,0], "edges": [[1,0,0],[0,1,0],[1,1,0]]})").find("nearly in one plane"), std::string::npos);
  EXPECT_NE(refusal("{\"format\": \"fielddeform-skeleton\", \"version\": 1}").find("fielddeform-lattice"), std::string::npos);
  EXPECT_NE(refusal("").find("empty"), std::string::npos);
  EXPECT_NE(refusal("v 0 0 0\n").find("fielddeform lattice 1"), std::string::npos);
  const auto axis = [&](const std::string& text) {
    return refusal(R"({"format": "fielddeform-lattice", "version": 1, "axes": [)" + text + ", " + text + ", " + text + "]}");
  };
  EXPECT_NE(axis(R"({"basis": "bernstein", "nodes": 1})").find("/axes/0/nodes"), std::string::npos);
  EXPECT_NE(axis(R"({"basis": "bernstein", "nodes": 4, "degree": 2})").find("only a bspline"), std::string::npos);
  EXPECT_NE(axis(R"({"basis": "bspline", "nodes": 4, "knots": [0]})").find("one of them"), std::string::npos);
  EXPECT_NE(axis(R"({"basis": "bspline", "knots": [0, 1]})").find("/axes/0/knots"), std::string::npos);
  EXPECT_NE(axis(R"({"basis": "bspline", "nodes": 2000000000})").find("nodes"), std::string::npos);  // no memory taken
  EXPECT_NE(axis(R"({"basis": "bspline", "nodes": 1000})").find("displacements"), std::string::npos);
}

TEST(LatticeIo, ObjMistakesAreNamedWithTheirLine) {
  const std::string good = formatLattice(Lattice{}, LatticeFormat::Obj);
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    return refusal(text.replace(text.find(from), from.size(), to));
  };
  EXPECT_EQ(with("o lattice", "o other"), "");
  EXPECT_NE(with("# axis bernstein 2", "# axis bernstein 3").find("8 vertices, expected 12"), std::string::npos);
  EXPECT_NE(with("# axis bernstein 2", "# axis bezier 3").find("l.json:6"), std::string::npos);
  EXPECT_NE(with("# axis bernstein 2", "#").find("incomplete"), std::string::npos);
  EXPECT_NE(with("v 1", "v one").find("a finite number"), std::string::npos);
  EXPECT_NE(with("o lattice", "curv 3").find("statement"), std::string::npos);
  EXPECT_NE(with("# edge 1", "# edge 0").find("edge 0"), std::string::npos);
}

TEST(LatticeIo, FilesComeBackAndTheExtensionTellsTheFormat) {
  const std::filesystem::path json = testing::TempDir() + "lattice_io_test.json", obj = testing::TempDir() + "lattice_io_test.OBJ";
  const Lattice l = someLattices()[1];
  writeLattice(l, json);
  writeLattice(l, obj);
  expectSame(readLattice(json), l);
  EXPECT_EQ(readLattice(json).displacements, l.displacements);
  expectSame(readLattice(obj), l);
  EXPECT_LT((readMovedNodes(readLattice(json), obj).displacements[3] - l.displacements[3]).norm(), 1e-6);
  std::filesystem::remove(json);
  std::filesystem::remove(obj);
}

}  // namespace
}  // namespace fielddeform::map
