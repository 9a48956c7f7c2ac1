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
