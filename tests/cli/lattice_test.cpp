// The command lattice, end to end.
#include <fielddeform/map/lattice_io.h>
#include <gtest/gtest.h>

#include <sstream>

#include "program.h"

namespace fielddeform::cli_test {
namespace {

class LatticeCommand : public ::testing::Test {
 protected:
  void SetUp() override { writeFile(folder / "bar.ply", barPly(16)); }
  Result call(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), {"lattice", "bar.ply"});
    return run(folder.path(), arguments);
  }
  void done(const std::vector<std::string>& arguments) const {
    const Result result = call(arguments);
    ASSERT_EQ(result.code, 0) << result.err;
  }
  void refused(const std::vector<std::string>& arguments, int code, const std::string& words) const {
    const Result result = call(arguments);
    EXPECT_EQ(result.code, code) << result.err;
    EXPECT_NE(result.err.find(words), std::string::npos) << result.err;
    EXPECT_FALSE(std::filesystem::exists(folder / "out.ply"));
  }
  std::string read(const std::string& name) const { return readFile(folder / name); }

  Scratch folder;
};

// The two ends of the bar along z, one layer of nodes each, moved by as much: every vertex moves by it, exactly.
const std::vector<std::string> kShift = {"--move", "0,0,0=2,0,0", "--move", "1,0,0=2,0,0", "--move", "0,1,0=2,0,0", "--move", "1,1,0=2,0,0",
                                         "--move", "0,0,1=2,0,0", "--move", "1,0,1=2,0,0", "--move", "0,1,1=2,0,0", "--move", "1,1,1=2,0,0"};

std::vector<std::string> operator+(std::vector<std::string> a, const std::vector<std::string>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

TEST_F(LatticeCommand, UnmovedNodesGiveTheInputByteForByte) {
  done({"--nodes", "4,4,4", "-o", "out.ply"});
  EXPECT_EQ(read("out.ply"), read("bar.ply"));
  done({"--nodes", "3,4,9", "--basis", "bspline", "--degree", "2", "--border", "free", "--box", "oriented", "--padding", "0.1", "-o", "b.ply"});
  EXPECT_EQ(read("b.ply"), read("bar.ply"));
}

TEST_F(LatticeCommand, NodesMoveTheMesh) {
  done(std::vector<std::string>{"--nodes", "2,2,2", "-o", "out.ply"} + kShift);
  const std::string out = read("out.ply");
  EXPECT_NE(out.find("\n2 0 0 200 0 30\n"), std::string::npos) << out.substr(0, 600);
  EXPECT_NE(out.find("\n2.25 0.25 4 200 20 30\n"), std::string::npos) << out.substr(0, 600);
}

TEST_F(LatticeCommand, OutsideAGivenBoxIsCarriedOrKept) {
  // The lower half alone; its top corners are moved.
  const std::vector<std::string> box = {"--nodes", "2,2,2", "--box", "0,0,0,1,1,2", "--move", "0,0,1=1,0,0", "--move", "1,0,1=1,0,0",
                                        "--move", "0,1,1=1,0,0", "--move", "1,1,1=1,0,0"};
  done(box + std::vector<std::string>{"-o", "a.ply"});
  done(box + std::vector<std::string>{"--outside", "keep", "-o", "b.ply"});
  EXPECT_NE(read("a.ply").find("\n2 0 4 "), std::string::npos);  // sheared on
  EXPECT_NE(read("b.ply").find("\n0 0 4 "), std::string::npos);
  EXPECT_NE(read("b.ply").find("\n1 0 2 "), std::string::npos);
}

TEST_F(LatticeCommand, SavedLatticesAndScenesReplay) {
  const std::vector<std::string> bulge = {"--nodes", "3,3,5", "--basis", "bspline", "--move", "1,1,2=0.5,0.25,0", "--precision", "double"};
  done(bulge + std::vector<std::string>{"-o", "a.ply", "--save-lattice", "l.json", "--save-scene", "s.json"});
  const std::string first = read("a.ply");
  EXPECT_NE(first, read("bar.ply"));
  done({"--lattice", "l.json", "--precision", "double", "-o", "b.ply"});
  EXPECT_EQ(read("b.ply"), first);
  std::filesystem::remove(folder / "a.ply");
  ASSERT_EQ(run(folder.path(), {"run", "s.json"}).code, 0);
  EXPECT_EQ(read("a.ply"), first);
}

const std::string kExtended = R"({"format": "fielddeform-extended-lattice", "version": 1, "joined": "c1",
  "parts": [{"name": "low", "box": {"origin": [-1, -1, -1], "edges": [[3, 0, 0], [0, 3, 0], [0, 0, 3]]}, "cells": [1, 1, 1]},
            {"name": "high", "box": {"origin": [-1, -1, 2], "edges": [[3, 0, 0], [0, 3, 0], [0, 0, 3]]}, "cells": [1, 1, 1]}],
  "moves": [{"part": "low", "node": [null, null, 3], "by": [0.5, 0, 0]}]})";

TEST_F(LatticeCommand, ExtendedLatticesAreReadSavedFittedAndReplayed) {
  writeFile(folder / "e.json", kExtended);
  done({"--lattice", "e.json", "--precision", "double", "-o", "a.ply", "--save-lattice", "l.json", "--save-scene", "s.json"});
  const std::string first = read("a.ply");
  EXPECT_NE(first.find("\n0.75 0 2 "), std::string::npos) << first;  // on the common face, which moved as it was told
  done({"--lattice", "l.json", "--precision", "double", "-o", "b.ply"});
  EXPECT_EQ(read("b.ply"), first);
  std::filesystem::remove(folder / "a.ply");
  ASSERT_EQ(run(folder.path(), {"run", "s.json"}).code, 0);
  EXPECT_EQ(read("a.ply"), first);
  done({"--lattice", "e.json", "--fit", "-o", "c.ply"});
  EXPECT_NE(read("c.ply"), first);
  done({"--lattice", "e.json", "--lattice", "e.json", "-o", "twice.ply", "--attributes", "affected"});
  const Result info = run(folder.path(), {"info", "e.json"});
  EXPECT_EQ(info.code, 0) << info.err;
  EXPECT_NE(info.out.find("2, tricubic"), std::string::npos) << info.out;
  EXPECT_NE(info.out.find("C1"), std::string::npos) << info.out;
  EXPECT_NE(run(folder.path(), {"info", "e.json", "--json"}).out.find("\"largest_kink\""), std::string::npos);
}

TEST_F(LatticeCommand, ExtendedLatticesSayWhatTheyLeaveOutAndWhatTheyCannot) {
  writeFile(folder / "half.json", R"({"format": "fielddeform-extended-lattice", "version": 1, "cells": [1, 1, 1],
    "box": {"origin": [-1, -1, -1], "edges": [[3, 0, 0], [0, 3, 0], [0, 0, 3]]}, "moves": [{"node": 0, "by": [0.1, 0, 0]}]})");
  const Result half = call({"--lattice", "half.json", "-o", "half.ply"});
  EXPECT_EQ(half.code, 0) << half.err;
  EXPECT_NE(half.err.find("vertices lie in no cell"), std::string::npos) << half.err;
  writeFile(folder / "e.json", kExtended);
  refused({"--lattice", "e.json", "--press", "plane=0,0,1,0,0,1", "-o", "out.ply"}, 1, "do not follow points");
  refused({"--lattice", "e.json", "--moved", "e.obj", "-o", "out.ply"}, 1, "is an extended lattice");
  writeFile(folder / "bad.json", R"({"format": "fielddeform-extended-lattice", "version": 1, "parts": []})");
  refused({"--lattice", "bad.json", "-o", "out.ply"}, 1, "at least one");
}

TEST_F(LatticeCommand, AModellersGridMovesTheMesh) {
  done({"--nodes", "2,2,2", "--save-lattice", "grid.obj", "-o", "same.ply"});
  // As a modeller would: every vertex moved by 2, comments gone.
  std::string moved, line;
  std::istringstream grid(read("grid.obj"));
  while (std::getline(grid, line)) {
    if (line.starts_with("#")) continue;
    double x = 0;
    if (line.starts_with("v ")) {
      x = std::stod(line.substr(2)) + 2;
      line = "v " + std::to_string(x) + line.substr(line.find(' ', 2));
    }
    moved += line + "\n";
  }
  writeFile(folder / "moved.obj", moved);
  done({"--lattice", "grid.obj", "--moved", "moved.obj", "-o", "out.ply"});
  EXPECT_NE(read("out.ply").find("\n2.25 0.25 4 200 20 30\n"), std::string::npos);
}

TEST_F(LatticeCommand, LatticesStackAndFitOtherMeshes) {
  map::Lattice shares;  // of whatever box: the upper end goes a quarter of its width to the side
  shares.displacements.assign(8, Vec3::Zero());
  for (const Index i : {4u, 5u, 6u, 7u}) shares.displacements[i].x() = 0.25;
  map::writeLattice(shares, folder / "shares.json");
  done({"--lattice", "shares.json", "--fit", "--lattice", "shares.json", "-o", "out.ply"});
  // 0.25 wide: 1/16, then the sheared bar is 5/16 wide: 5/64 more.
  EXPECT_NE(read("out.ply").find("\n0.140625 0 4 "), std::string::npos) << read("out.ply");
}

TEST_F(LatticeCommand, ServesWhatEveryMethodHas) {
  const std::vector<std::string> bulge = {"--nodes", "3,3,5", "--move", "1,1,2=2,0,0"};
  done(bulge + std::vector<std::string>{"-o", "out.ply", "--resample", "--report", "r.json", "--attributes", "displacement", "--frames", "3", "--check"});
  EXPECT_NE(read("r.json").find("\"method\": \"lattice\""), std::string::npos);
  EXPECT_TRUE(std::filesystem::exists(folder / "out_0002.ply") || std::filesystem::exists(folder / "out_2.ply"));
}

TEST_F(LatticeCommand, WrongUseIsRefused) {
  const std::vector<std::string> out = {"-o", "out.ply"};
  refused(out, 2, "either --nodes or --lattice");
  refused(out + std::vector<std::string>{"--nodes", "1,2,2"}, 2, "from 2 to");
  refused(out + std::vector<std::string>{"--nodes", "2,2"}, 2, "3 numbers");
  refused(out + std::vector<std::string>{"--nodes", "2,2,2", "--move", "0,0,0"}, 2, "I,J,K=DX,DY,DZ");
  refused(out + std::vector<std::string>{"--nodes", "2,2,2", "--move", "0,0.5,0=1,0,0"}, 2, "whole number");
  refused(out + std::vector<std::string>{"--nodes", "2,2,2", "--move", "0,0,2=1,0,0"}, 1, "0,0,2");
  refused(out + std::vector<std::string>{"--nodes", "2,2,2", "--box", "0,0,0,1,1,0"}, 2, "--box");
  refused(out + std::vector<std::string>{"--move", "0,0,0=1,0,0"}, 2, "--nodes");
  refused(out + std::vector<std::string>{"--lattice", "none.json"}, 1, "none.json");
  refused(out + std::vector<std::string>{"--lattice", "a.json", "--lattice", "b.json", "--moved", "c.obj"}, 2, "--moved");
}

TEST_F(LatticeCommand, PointsAreMovedToTheirTargets) {
  writeFile(folder / "pairs.csv", "x,y,z,tx,ty,tz\n0,0,0,0.5,0,0\n0.25,0.25,4,0.25,0.25,4\n");
  done({"--nodes", "4,4,6", "--basis", "bspline", "--targets", "pairs.csv", "--attributes", "affected", "--report", "r.json",
        "--save-lattice", "l.json", "-o", "out.ply"});
  EXPECT_NE(read("out.ply").find("\n0.5 0 0 200 0 30"), std::string::npos) << read("out.ply").substr(0, 600);
  EXPECT_NE(read("out.ply").find("affected"), std::string::npos);
  EXPECT_NE(read("r.json").find("\"met\": 2"), std::string::npos) << read("r.json");
  // The lattice that was found gives the same again.
  done({"--lattice", "l.json", "-o", "again.ply"});
  EXPECT_NE(read("again.ply").find("\n0.5 0 0 200 0 30"), std::string::npos);
}

TEST_F(LatticeCommand, ToolsPinsAndRefinementAreTaken) {
  writeFile(folder / "pins.csv", "0,0,0\n");
  done({"--nodes", "4,4,8", "--basis", "bspline", "--magnet", "0,0,4,1,0.2,0,0", "--suction", "0,0,2,0,0,1,1,0.1,0,0", "--press",
        "plane=0,0,3.9,0,0,-1", "--pins", "pins.csv", "--refine", "4000", "--target-tolerance", "1e-6", "--report", "r.json", "-o", "out.ply"});
  for (const char* word : {"magnet", "suction", "press", "penetrating"})
    EXPECT_NE(read("r.json").find(word), std::string::npos) << word;
}

TEST_F(LatticeCommand, MistakesOfMovingPointsAreNamed) {
  writeFile(folder / "pairs.csv", "1,2,3\n");
  refused({"--nodes", "2,2,2", "--targets", "pairs.csv", "-o", "out.ply"}, 1, "pairs.csv:1");
  refused({"--nodes", "2,2,2", "--targets", "none.csv", "-o", "out.ply"}, 1, "none.csv");
  refused({"--nodes", "2,2,2", "--magnet", "0,0,0,0,1,1,1", "-o", "out.ply"}, 2, "--magnet");
  refused({"--nodes", "2,2,2", "--suction", "0,0,0,0,0,0,1,1,1,1", "-o", "out.ply"}, 2, "--suction");
  refused({"--nodes", "2,2,2", "--press", "plane=1,2,3", "-o", "out.ply"}, 2, "--press");
  refused({"--nodes", "2,2,2", "--press", "bar.csv", "-o", "out.ply"}, 1, "bar.csv");
  refused({"--nodes", "2,2,2", "--pins", "pins.csv", "-o", "out.ply"}, 2, "--pins");
}

}  // namespace
}  // namespace fielddeform::cli_test
