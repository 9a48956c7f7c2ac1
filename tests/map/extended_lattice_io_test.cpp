#include <fielddeform/core/error.h>
#include <fielddeform/map/extended_lattice_io.h>
#include <gtest/gtest.h>

#include <fstream>
#include <stdexcept>

#include "classic.h"

namespace fielddeform::map {
namespace {

using namespace test;

ExtendedLattice parse(const std::string& members) {
  return parseExtendedLattice(R"({"format": "fielddeform-extended-lattice", "version": 1, )" + members + "}", "in.json");
}

const std::string kBox = R"("box": {"origin": [0, 0, 0], "edges": [[2, 0, 0], [0, 1, 0], [0, 0, 1]]}, "cells": [2, 1, 1])";
const std::string kTube = R"("cylinder": {"origin": [0, 0, 0], "axis": [0, 0, 2], "inner": 0.5, "outer": 1}, "cells": [1, 6, 1])";

void expectRefused(const std::string& members, const std::string& words) {
  try {
    parse(members);
    ADD_FAILURE() << "read: " << members;
  } catch (const IoError& problem) {
    EXPECT_NE(std::string(problem.what()).find(words), std::string::npos) << problem.what();
  }
}

bool same(const ExtendedLattice& a, const ExtendedLattice& b) {
  return a.nodes == b.nodes && a.cells == b.cells && a.displacements == b.displacements;
}

TEST(ExtendedLatticeFile, RulesMakeTheLatticesOfTheLibrary) {
  EXPECT_TRUE(same(parse(kBox), boxLattice({Vec3::Zero(), Vec3(2, 1, 1).asDiagonal()}, {2, 1, 1})));
  EXPECT_TRUE(same(parse(kTube), cylinderLattice({.axis = Vec3(0, 0, 2), .inner = 0.5, .outer = 1, .cells = {1, 6, 1}})));
}

TEST(ExtendedLatticeFile, EveryBitComesBack) {
  ExtendedLattice lattice = cylinderLattice({.origin = Vec3(0.1, 1 / 3.0, 0), .cells = {1, 4, 1}});
  for (const bool dense : {false, true}) {
    lattice.displacements.assign(lattice.nodes.size(), Vec3::Zero());
    for (std::size_t n = 0; n < lattice.nodes.size(); n += dense ? 1 : 9) lattice.displacements[n] = randomPoint(4, n);
    const std::string text = formatExtendedLattice(lattice);
    EXPECT_EQ(text.find("\"moves\"") != std::string::npos, !dense);
    EXPECT_TRUE(same(parseExtendedLattice(text, "out.json"), lattice));
  }
}

TEST(ExtendedLatticeFile, MovesNameANodeARowOrALayer) {
  const ExtendedLattice l = parse(kBox + R"(, "moves": [{"node": [3, null, null], "by": [0, 0, 1]}, {"node": [3, 1, 0], "by": [0, 1, 0]}, {"node": 0, "by": [5, 0, 0]}])");
  const auto at = [&](int i, int j, int k) { return l.displacements[static_cast<std::size_t>(i + 7 * (j + 4 * k))]; };
  for (int k = 0; k < 4; ++k)
    for (int j = 0; j < 4; ++j) EXPECT_EQ(at(3, j, k), Vec3(0, j == 1 && k == 0 ? 1 : 0, 1));
  EXPECT_EQ(at(0, 0, 0), Vec3(5, 0, 0));
  EXPECT_EQ(at(2, 0, 0), Vec3(0, 0, 0));
}

TEST(ExtendedLatticeFile, PartsThatMeetShareTheirNodes) {
  const std::string parts = R"("parts": [{"name": "a", "box": {"origin": [0, 0, 0], "edges": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}, "cells": [1, 1, 1]},
    {"name": "b", "box": {"origin": [1, 0, 0], "edges": [[2, 0, 0], [0, 1, 0], [0, 0, 1]]}, "cells": [1, 1, 1]}])";
  EXPECT_EQ(parse(parts).nodes.size(), 64u + 48u);
  const ExtendedLattice moved = parse(parts + R"(, "joined": "c1", "moves": [{"part": "b", "node": [0, null, null], "by": [0, 0, 0.3]}])");
  // The moved face keeps its displacement, and across it the map is C1 though the cells differ in length.
  const ExtendedLatticeMap map(moved);
  EXPECT_LT((image(map, Vec3(1, 0.4, 0.6)) - Vec3(1, 0.4, 0.9)).norm(), 1e-12);
  std::vector<Mat3> j(2);
  const std::vector<Vec3> sides{Vec3(1 - 1e-9, 0.4, 0.6), Vec3(1 + 1e-9, 0.4, 0.6)};
  map.jacobians(*map.bind(sides), j);
  EXPECT_LT((j[0] - j[1]).norm(), 1e-7);
  // As given there is a kink: the neighbours stay.
  const ExtendedLatticeMap kinked(parse(parts + R"(, "moves": [{"part": 1, "node": [0, null, null], "by": [0, 0, 0.3]}])"));
  kinked.jacobians(*kinked.bind(sides), j);
  EXPECT_GT((j[0] - j[1]).norm(), 0.5);
}

TEST(ExtendedLatticeFile, MovesThatNoSmoothLatticeHasAreMetAsNearlyAsMayBe) {
  // A face moved between two layers that are held: the kink is shared among the three, (1, -2, 1) / 6 of it each.
  const ExtendedLattice l = parse(kBox + R"(, "joined": "c1-nearest", "moves": [{"node": [3, null, null], "by": [0, 0, 3]}])");
  for (int n = 0; n < 16; ++n) {
    const auto at = [&](int i) { return l.displacements[static_cast<std::size_t>(i + 7 * n)]; };
    EXPECT_LT((at(2) - Vec3(0, 0, 1)).norm() + (at(3) - Vec3(0, 0, 1)).norm() + (at(4) - Vec3(0, 0, 1)).norm(), 1e-12);
    EXPECT_EQ(at(1), Vec3::Zero());
  }
}

TEST(ExtendedLatticeFile, PartsTakeAnyShape) {
  const ExtendedLattice l = parse(kBox + R"(, "shape": [{"node": [6, null, null], "by": [1, 0, 0.5]}])");
  EXPECT_EQ(l.nodes[6], Vec3(3, 0, 0.5));
  EXPECT_TRUE(l.displacements.empty());
}

TEST(ExtendedLatticeFile, MistakesAreNamed) {
  expectRefused(R"("cells": [1, 1, 1])", "none of \"nodes\", \"box\" and \"cylinder\"");
  expectRefused(kBox + R"(, "nodes": [[0, 0, 0]])", "two shapes");
  expectRefused(kBox + R"(, "cell": 3)", "did you mean \"cells\"");
  expectRefused(R"("nodes": [[0, 0, 0]], "cells": [[0, 1]])", "/cells/0");
  expectRefused(R"("box": {"origin": [0, 0, 0], "edges": [[1, 0, 0], [0, 1, 0], [1, 1, 0]]}, "cells": [1, 1, 1])", "three edges that span a volume");
  expectRefused(R"("box": {"origin": [0, 0, 0], "edges": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}, "cells": [64, 64, 64])", "at most 4096");
  expectRefused(R"("cylinder": {"origin": [0, 0, 0], "axis": [0, 0, 1], "inner": 2, "outer": 1}, "cells": [1, 6, 1])", "/cylinder");
  expectRefused(R"("cylinder": {"origin": [0, 0, 0], "axis": [0, 0, 1], "inner": 0.5, "outer": 1}, "cells": [1, 2, 1])", "at least 3");
  expectRefused(kBox + R"(, "shape": [{"node": [3, null, null], "by": [3, 0, 0]}])", "turned inside out");
  expectRefused(kBox + R"(, "moves": [{"node": [7, 0, 0], "by": [0, 0, 1]}])", "/moves/0/node/0");
  expectRefused(kBox + R"(, "moves": [{"node": 112, "by": [0, 0, 1]}])", "/moves/0/node");
  expectRefused(kBox + R"(, "displacements": [[0, 0, 0]])", "one a node");
  expectRefused(kBox + R"(, "joined": "c1", "moves": [{"node": [3, null, null], "by": [0, 0, 1]}, {"node": [2, null, null], "by": [0, 0, 0]}, {"node": [4, null, null], "by": [0, 0, 0]}])", "kink of");
  const std::string two = R"("parts": [{"name": "a", )" + kBox + R"(}, {"name": "b", )" + kTube + "}]";
  expectRefused(two + R"(, "moves": [{"node": 0, "by": [0, 0, 1]}])", "the name of one of 2 parts");
  expectRefused(two + R"(, "moves": [{"part": "c", "node": 0, "by": [0, 0, 1]}])", "\"a\", \"b\"");
  expectRefused(two + ", " + kBox, "besides \"parts\"");
  expectRefused(kBox + R"(, "sculpt": {})", "do not follow points");
}

TEST(ExtendedLatticeFile, EitherKindIsToldByItsFormat) {
  const std::filesystem::path path = std::filesystem::path(::testing::TempDir()) / "either-kind.json";
  const auto write = [&](const std::string& text) { std::ofstream(path) << text; };
  write(formatExtendedLattice(parse(kBox)));
  EXPECT_TRUE(std::holds_alternative<ExtendedLattice>(readAnyLattice(path)));
  write(R"({"format": "fielddeform-lattice", "version": 1, "axes": [{"basis": "bernstein", "nodes": 2}, {"basis": "bernstein", "nodes": 2}, {"basis": "bernstein", "nodes": 2}]})");
  EXPECT_TRUE(std::holds_alternative<Lattice>(readAnyLattice(path)));
  std::filesystem::remove(path);
}

TEST(ExtendedLattice, WeldedTubeAndItsHalvesAreTheSame) {
  // Two half lengths of a tube, put together, are the tube of two cells along.
  const auto tube = [](double z, double length, int along) {
    return cylinderLattice({.origin = Vec3(0, 0, z), .axis = Vec3(0, 0, length), .inner = 0.4, .outer = 1, .cells = {1, 5, along}});
  };
  std::vector<std::vector<Index>> nodeOf;
  const std::vector<ExtendedLattice> halves{tube(0, 1, 1), tube(1, 1, 1)};
  const ExtendedLattice whole = weld(halves, 1e-9, &nodeOf);
  const ExtendedLattice expected = tube(0, 2, 2);
  ASSERT_EQ(whole.nodes.size(), expected.nodes.size());
  EXPECT_EQ(whole.cells.size(), expected.cells.size());
  EXPECT_EQ(jointsOf(whole).size(), jointsOf(expected).size());
  for (std::size_t p = 0; p < 2; ++p)
    for (std::size_t n = 0; n < nodeOf[p].size(); ++n) EXPECT_LT((whole.nodes[nodeOf[p][n]] - halves[p].nodes[n]).norm(), 1e-9);
}

TEST(ExtendedLattice, CarriedOverToAnotherBoxItDeformsInProportion) {
  ExtendedLattice lattice = boxLattice({Vec3::Zero(), Vec3(2, 1, 1).asDiagonal()}, {2, 1, 1});
  for (std::size_t n = 0; n < lattice.nodes.size(); ++n) lattice.displacements.push_back(randomPoint(8, n, 0.1));
  const LatticeBox to{Vec3(5, 6, 7), Vec3(4, 3, 0.5).asDiagonal()};
  const ExtendedLatticeMap small(lattice), large(refit(lattice, to));
  for (const Vec3& p : cloud(2, 40)) {
    const Vec3 x(1 + 0.9 * p.x(), 0.5 + 0.4 * p.y(), 0.5 + 0.4 * p.z());
    const auto carried = [&](const Vec3& y) { return Vec3(to.origin + Vec3(2 * y.x(), 3 * y.y(), 0.5 * y.z())); };
    EXPECT_LT((image(large, carried(x)) - carried(image(small, x))).norm(), 1e-12 * 10);  // size 10, rounding of Newton steps
  }
}

TEST(ExtendedLattice, FoldedCellsAreFound) {
  ExtendedLattice lattice = boxLattice({Vec3::Zero(), Vec3(2, 1, 1).asDiagonal()}, {2, 1, 1});
  EXPECT_EQ(foldedCell(lattice), kNoIndex);
  for (Vec3& p : lattice.nodes) p.x() = -p.x();  // left-handed, every cell alike
  EXPECT_EQ(foldedCell(lattice), kNoIndex);
  lattice.nodes[lattice.cells[1][3]].x() += 40;  // a corner pulled through its cell
  EXPECT_EQ(foldedCell(lattice), 1u);
}

TEST(ExtendedLattice, CollapsedEdgesGiveNumbers) {
  // A wedge: the face at u = 0 is an edge.
  ExtendedLattice lattice = boxLattice({Vec3::Zero(), Mat3::Identity()}, {1, 1, 1});
  for (std::size_t n = 0; n < 64; ++n) lattice.nodes[n].y() *= lattice.nodes[n].x();
  lattice.displacements.assign(64, Vec3(0, 0, 0.5));
  EXPECT_EQ(foldedCell(lattice), kNoIndex);
  const ExtendedLatticeMap map(lattice);
  std::vector<Mat3> j(1);
  map.jacobians(*map.bind(std::vector<Vec3>{Vec3(0, 0, 0.5)}), j);
  EXPECT_TRUE(j[0].allFinite());
}

}  // namespace
}  // namespace fielddeform::map
