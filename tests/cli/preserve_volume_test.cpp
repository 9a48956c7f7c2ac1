// --preserve-volume, end to end: what is written holds the volume.
#include <fielddeform/core/json_reader.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <sstream>

#include "program.h"

namespace fielddeform::cli_test {
namespace {

namespace fs = std::filesystem;

double volumeOf(const fs::path& file) {
  const Result result = run(file.parent_path(), {"info", "--json", file.string()});
  EXPECT_EQ(result.code, 0) << result.err;
  return JsonDocument::parse(result.out, file).root().require("volume").number();
}

double deviation(const fs::path& before, const fs::path& after) { return std::abs(volumeOf(after) / volumeOf(before) - 1); }

// The bar of barPly() as OBJ, without its far end if it is to be open.
std::string barObj(int segments, bool open) {
  std::istringstream lines(barPly(segments));
  std::string out, line;
  while (std::getline(lines, line) && line != "end_header") {}
  for (int v = 0; v < 4 * (segments + 1) && std::getline(lines, line); ++v) {
    std::istringstream numbers(line);
    std::string x, y, z;
    numbers >> x >> y >> z;
    out.append("v ").append(x).append(" ").append(y).append(" ").append(z).append("\n");
  }
  std::vector<std::string> faces;
  while (std::getline(lines, line)) {
    std::istringstream numbers(line);
    int count = 0, v = 0;
    if (!(numbers >> count)) continue;
    bool end = true;
    std::string face = "f";
    for (int k = 0; k < count && numbers >> v; ++k) {
      end = end && v >= 4 * segments;
      face.append(" ").append(std::to_string(v + 1));
    }
    if (!open || !end) faces.push_back(face);
  }
  for (const std::string& face : faces) out += face + "\n";
  return out;
}

class PreserveVolume : public ::testing::Test {
 protected:
  void SetUp() override {
    writeFile(folder / "bar.obj", barObj(40, false));
    writeFile(folder / "open.obj", barObj(40, true));
    writeFile(folder / "bar.ply", barPly(40));
  }
  Result stretch(const std::string& mesh, const std::string& out, const std::vector<std::string>& more) const {
    std::vector<std::string> arguments = {"stretch", mesh, "--factor", "1.5", "-o", out};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(folder.path(), arguments);
  }

  Scratch folder;
};

TEST_F(PreserveVolume, IsReadBackFromTheWrittenObjTo1e12) {
  ASSERT_EQ(stretch("bar.obj", "plain.obj", {}).code, 0);
  EXPECT_GT(deviation(folder / "bar.obj", folder / "plain.obj"), 0.1);
  const Result result = stretch("bar.obj", "out.obj", {"--resample", "--preserve-volume", "--report", "out.json"});
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_NE(result.out.find("restored by a pass from +"), std::string::npos) << result.out;
  EXPECT_LE(deviation(folder / "bar.obj", folder / "out.obj"), 1e-12);
  const JsonDocument report = JsonDocument::read(folder / "out.json");
  const JsonValue pass = report.root().require("volume").require("pass");
  EXPECT_EQ(pass.require("mask").string(), "auto");
  EXPECT_TRUE(pass.require("needed").boolean());
  EXPECT_LE(pass.require("deviation").number(), 1e-12);
  EXPECT_GT(pass.require("change_before").number(), 0.1);
  EXPECT_EQ(pass.require("folds").require("after").integer(0, 1000), 0u);
  EXPECT_GT(pass.require("residual").require("after").require("max").number(), pass.require("residual").require("before").require("max").number());
  EXPECT_TRUE(report.root().require("run").require("seconds").find("volume"));
}

TEST_F(PreserveVolume, OfAFloatFileIsWhatRoundingLeavesUnlessDoublesAreWanted) {
  ASSERT_EQ(stretch("bar.ply", "float.ply", {"--preserve-volume", "--report", "float.json"}).code, 0);
  ASSERT_EQ(stretch("bar.ply", "double.ply", {"--preserve-volume", "--precision", "double"}).code, 0);
  const double inFloats = deviation(folder / "bar.ply", folder / "float.ply");
  EXPECT_LE(inFloats, 1e-6);
  EXPECT_LE(deviation(folder / "bar.ply", folder / "double.ply"), 1e-12);
  const JsonDocument report = JsonDocument::read(folder / "float.json");
  const JsonValue volume = report.root().require("volume");
  // Text holds the shortest decimals of each float, which info reads as doubles: each off by less than half a float's digit.
  EXPECT_NEAR(volume.require("as_written").number(), volumeOf(folder / "float.ply"), 1e-9);
  EXPECT_NEAR(volume.require("relative_change").number(), 0, 1e-12);
}

TEST_F(PreserveVolume, OfAnOpenMeshWhoseRimMovedIsRefusedAndNothingIsWritten) {
  const auto before = folder.files();
  const Result result = stretch("open.obj", "out.obj", {"--preserve-volume", "--report", "out.json", "--save-scene", "s.json"});
  EXPECT_EQ(result.code, 1);
  EXPECT_NE(result.err.find("4 boundary edges moved"), std::string::npos) << result.err;
  EXPECT_EQ(folder.files(), before);
}

TEST_F(PreserveVolume, ASavedSceneGivesTheSameBytes) {
  std::string mask;
  for (int v = 0; v < 4 * 41; ++v) mask += v < 40 ? "0\n" : v < 60 ? "0.5\n" : "1\n";
  writeFile(folder / "mask.txt", mask);
  const std::vector<std::vector<std::string>> choices = {
      {"--preserve-volume"}, {"--resample", "--volume-mask", "mask.txt", "--volume-lattice", "5,5,9"}, {"--volume-mask", "none"}};
  for (const auto& choice : choices) {
    std::vector<std::string> more = choice;
    more.insert(more.end(), {"--save-scene", "scene.json", "--from", "0.4"});
    const Result first = stretch("bar.obj", "out.obj", more);
    ASSERT_EQ(first.code, 0) << first.err;
    const std::string bytes = readFile(folder / "out.obj");
    fs::remove(folder / "out.obj");
    const Result again = run(folder.path(), {"run", "scene.json", "--threads", "1"});
    ASSERT_EQ(again.code, 0) << again.err;
    EXPECT_EQ(readFile(folder / "out.obj"), bytes);
    EXPECT_LE(deviation(folder / "bar.obj", folder / "out.obj"), 1e-12);
  }
}

TEST_F(PreserveVolume, EveryFrameHoldsIt) {
  ASSERT_EQ(stretch("bar.obj", "f.obj", {"--preserve-volume", "--frames", "4"}).code, 0);
  for (const char* frame : {"f_0000.obj", "f_0001.obj", "f_0002.obj", "f_0003.obj"})
    EXPECT_LE(deviation(folder / "bar.obj", folder / frame), 1e-12) << frame;
}

TEST_F(PreserveVolume, WrongOptionsAreUsageErrors) {
  EXPECT_EQ(stretch("bar.obj", "out.obj", {"--volume-lattice", "3,4,4"}).code, 2);
  EXPECT_EQ(stretch("bar.obj", "out.obj", {"--volume-lattice", "4,4"}).code, 2);
  EXPECT_EQ(stretch("bar.obj", "out.obj", {"--volume-solver", "newton"}).code, 2);
  writeFile(folder / "mask.txt", "2\n");
  EXPECT_EQ(stretch("bar.obj", "out.obj", {"--volume-mask", "mask.txt"}).code, 1);
}

// Bars of the project: real meshes bent and twisted with resampling keep their volume in the file, and the pass folds nothing.
void runOnReal(const std::vector<std::string>& edit) {
  const char* meshes = std::getenv("FIELDDEFORM_TEST_MESHES");
  if (!meshes) GTEST_SKIP() << "FIELDDEFORM_TEST_MESHES is not set";
  const Scratch folder;
  for (const std::string name : {"homer", "cow", "rocker-arm", "spot"}) {
    SCOPED_TRACE(name);
    const fs::path mesh = fs::path(meshes) / (name + ".obj");
    std::vector<std::string> arguments = edit;
    arguments.insert(arguments.end(), {mesh.string(), "-o", name + ".obj", "--resample", "--preserve-volume", "--report", name + ".json"});
    const Result result = run(folder.path(), arguments);
    ASSERT_EQ(result.code, 0) << result.err;
    EXPECT_LE(deviation(mesh, folder / (name + ".obj")), 1e-12);
    const JsonDocument report = JsonDocument::read(folder / (name + ".json"));
    const JsonValue folds = report.root().require("volume").require("pass").require("folds");
    EXPECT_LE(folds.require("after").integer(0, 1u << 30), folds.require("before").integer(0, 1u << 30));
  }
}

TEST(PreserveVolumeReal, Bend) { runOnReal({"bend", "--angle", "90"}); }
TEST(PreserveVolumeReal, Twist) { runOnReal({"twist", "--angle", "180"}); }

}  // namespace
}  // namespace fielddeform::cli_test
