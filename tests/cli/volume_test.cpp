// fielddeform volume.
#include <gtest/gtest.h>

#include <cmath>

#include "program.h"

namespace fielddeform::cli_test {
namespace {

double numberAfter(const std::string& text, const std::string& key) {
  const auto at = text.find(key);
  return at == std::string::npos ? std::nan("") : std::stod(text.substr(at + key.size()));
}
double volumeOf(const Scratch& folder, const std::string& file) {
  return numberAfter(run(folder.path(), {"info", "--json", file}).out, "\"volume\": ");
}

TEST(VolumeCommand, MeetsFactorsNumbersAndMeshes) {
  const Scratch folder;
  writeFile(folder / "bar.ply", barPly(8));
  const double own = volumeOf(folder, "bar.ply");
  Result r = run(folder.path(), {"volume", "bar.ply", "--target", "1.2x", "--pin", "z-", "--precision", "double", "-o", "big.ply"});
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_NEAR(volumeOf(folder, "big.ply") / (1.2 * own), 1, 1e-12);
  for (const std::string solver : {"exact", "augmented-lagrangian", "projection"}) {
    r = run(folder.path(), {"volume", "bar.ply", "--target", "big.ply", "--solver", solver, "--nodes", "3,3,3", "--precision", "double", "-o", "same.ply"});
    ASSERT_EQ(r.code, 0) << r.err;
    EXPECT_NEAR(volumeOf(folder, "same.ply") / (1.2 * own), 1, 2e-12) << solver;
  }
  r = run(folder.path(), {"volume", "bar.ply", "--target", "0.5", "--keep-centre", "--report", "r.json", "-o", "half.obj"});
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_NEAR(volumeOf(folder, "half.obj"), 0.5, 1e-7);  // the input's coordinates are float
  const std::string report = readFile(folder / "r.json");
  EXPECT_NEAR(numberAfter(report, "\"as_written\": "), volumeOf(folder, "half.obj"), 1e-7);
  EXPECT_EQ(numberAfter(report, "\"target\": "), 0.5);
}

TEST(VolumeCommand, TakesTessellationsAsLevelsAndKnowsTheSmoothSolid) {
  const Scratch folder;
  writeFile(folder / "bar.ply", barPly(16));
  writeFile(folder / "coarse.ply", barPly(2));
  writeFile(folder / "middle.ply", barPly(6));
  const Result r = run(folder.path(), {"volume", "bar.ply", "--target", "1.3x", "--pin", "z-", "--nodes", "3,3,3", "--solver", "augmented-lagrangian", "--level", "coarse.ply",
                                       "--level", "middle.ply", "--smooth-volume", "--max-saddles", "0", "--precision", "double", "--report", "r.json", "-o", "big.ply"});
  ASSERT_EQ(r.code, 0) << r.err;
  const double own = volumeOf(folder, "bar.ply");
  EXPECT_NEAR(volumeOf(folder, "big.ply") / (1.3 * own), 1, 1e-12);
  const std::string report = readFile(folder / "r.json");
  std::size_t levels = 0;
  for (std::size_t at = report.find("\"triangles\""); at != std::string::npos; at = report.find("\"triangles\"", at + 1)) ++levels;
  EXPECT_GE(levels, 2u);  // it may end before the finest
  // A solid whose long faces have few vertices bulges more than its triangles.
  const double smooth = numberAfter(report.substr(report.find("smooth_volume")), "\"after\": ");
  EXPECT_NEAR(numberAfter(report.substr(report.find("smooth_volume")), "\"before\": ") / own, 1, 1e-12);
  EXPECT_NEAR(smooth / (1.3 * own), 1, 0.05);
  EXPECT_NE(smooth, 1.3 * own);
  EXPECT_EQ(run(folder.path(), {"volume", "bar.ply", "--smooth-volume", "--basis", "bspline", "-o", "x.ply"}).code, 1);
  EXPECT_EQ(run(folder.path(), {"volume", "bar.ply", "--components", "--level", "coarse.ply", "-o", "x.ply"}).code, 2);
}

TEST(InfoCommand, KnowsLatticeFiles) {
  const Scratch folder;
  writeFile(folder / "bar.ply", barPly(8));
  ASSERT_EQ(run(folder.path(), {"volume", "bar.ply", "--target", "1.2x", "--nodes", "3,2,4", "--pin", "z-", "--save-lattice", "l.json", "-o", "o.ply"}).code, 0);
  const Result text = run(folder.path(), {"info", "l.json"});
  ASSERT_EQ(text.code, 0) << text.err;
  EXPECT_NE(text.out.find("3 x 2 x 4 = 24"), std::string::npos) << text.out;
  EXPECT_NE(text.out.find("bernstein of degree 3"), std::string::npos) << text.out;
  const std::string json = run(folder.path(), {"info", "l.json", "--json"}).out;
  EXPECT_EQ(numberAfter(json, "\"nodes\": "), 24);
  EXPECT_EQ(numberAfter(json, "\"moved_nodes\": "), 18);
  writeFile(folder / "other.json", "{\"format\": \"something\"}");
  EXPECT_EQ(run(folder.path(), {"info", "other.json"}).code, 1);
}

TEST(VolumeCommand, SaysWhatCannotBeAndWritesNothing) {
  const Scratch folder;
  writeFile(folder / "bar.ply", barPly(4));
  writeFile(folder / "open.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const auto fails = [&](std::vector<std::string> arguments, int code, const std::string& word) {
    arguments.insert(arguments.begin(), "volume");
    arguments.insert(arguments.end(), {"-o", "out.ply"});
    const Result r = run(folder.path(), arguments);
    EXPECT_EQ(r.code, code) << r.err;
    EXPECT_NE(r.err.find(word), std::string::npos) << r.err;
  };
  fails({"open.obj"}, 1, "3 boundary edges");
  fails({"bar.ply", "--target", "-1"}, 1, "expected a positive number");
  fails({"bar.ply", "--target", "open.obj"}, 1, "has no volume");
  fails({"bar.ply", "--target", "2x", "--nodes", "2,2,2", "--pin", "x-", "--pin", "x+"}, 1, "pinned");
  fails({"bar.ply", "--nodes", "1,2,3"}, 2, "--nodes");
  fails({"bar.ply", "--pin", "up"}, 2, "--pin");
  fails({"bar.ply", "--target", "missing.ply"}, 1, "missing.ply");
  EXPECT_EQ(folder.files(), (std::vector<std::string>{"bar.ply", "open.obj"}));
}

}  // namespace
}  // namespace fielddeform::cli_test
