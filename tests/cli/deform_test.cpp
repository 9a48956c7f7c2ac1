// The deforming commands, end to end.
#include <fielddeform/core/json_reader.h>
#include <gtest/gtest.h>

#include <csignal>
#include <set>
#include <sstream>
#include <thread>

#include "program.h"

namespace fielddeform::cli_test {
namespace {

constexpr const char* kRest = R"({"format": "fielddeform-skeleton", "version": 1, "primitives": [
  {"name": "spine", "type": "polyline", "radius": 1,
   "points": [[0.125, 0.125, 0], [0.125, 0.125, 1], [0.125, 0.125, 2], [0.125, 0.125, 3], [0.125, 0.125, 4]]}]})";

std::string shifted(std::string skeleton, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = skeleton.find(from, at)) != std::string::npos; at += to.size())
    skeleton.replace(at, from.size(), to);
  return skeleton;
}

class Deform : public ::testing::Test {
 protected:
  void SetUp() override {
    writeFile(folder / "bar.ply", barPly(16));
    writeFile(folder / "rest.json", kRest);
  }
  Result call(const std::vector<std::string>& arguments) const { return run(folder.path(), arguments); }
  std::string read(const std::string& name) const { return readFile(folder / name); }

  Scratch folder;
};

TEST_F(Deform, AnUneditedSkeletonGivesTheInputByteForByte) {
  const Result result = call({"deform", "bar.ply", "--rest", "rest.json", "--posed", "rest.json", "-o", "out.ply"});
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_EQ(read("out.ply"), read("bar.ply"));
}

TEST_F(Deform, PrimitivesWithoutPartnerAreNamedAndPairingThemHelps) {
  writeFile(folder / "posed.json", shifted(shifted(kRest, "[0.125, ", "[2.125, "), "\"spine\"", "\"q\""));
  std::vector<std::string> arguments = {"deform", "bar.ply", "--rest", "rest.json", "--posed", "posed.json", "-o", "out.ply"};
  const Result result = call(arguments);
  ASSERT_EQ(result.code, 0) << result.err;
  const std::string said = result.out + result.err;
  EXPECT_NE(said.find("'spine' is removed and 'q' added; use --pair spine=q"), std::string::npos) << said;
  EXPECT_EQ(said.find("on the mesh?"), std::string::npos) << said;
  arguments.insert(arguments.end(), {"--pair", "spine=q"});
  const Result paired = call(arguments);
  ASSERT_EQ(paired.code, 0) << paired.err;
  EXPECT_NE(read("out.ply"), read("bar.ply"));
  EXPECT_EQ((paired.out + paired.err).find("is removed"), std::string::npos) << paired.out << paired.err;
}

TEST_F(Deform, AMovedSkeletonMovesTheMesh) {
  // 2 is exact in the file's floats, and a translation is exact in the map.
  writeFile(folder / "posed.json", shifted(kRest, "[0.125, ", "[2.125, "));
  const Result result = call({"deform", "bar.ply", "--rest", "rest.json", "--posed", "posed.json", "-o", "out.ply"});
  ASSERT_EQ(result.code, 0) << result.err;
  const std::string out = read("out.ply");
  EXPECT_NE(out.find("\n2 0 0 200 0 30\n"), std::string::npos) << out.substr(0, 600);
  EXPECT_NE(out.find("\n2.25 0.25 4 200 20 30\n"), std::string::npos) << out.substr(0, 600);
}

TEST_F(Deform, APreviewsVerticesGoWhereTheyGoInTheWholeMesh) {
  writeFile(folder / "long.ply", barPly(500));
  const std::vector<std::string> bend{"bend", "long.ply", "--angle", "40", "--no-guard", "--no-retry", "--evaluation", "grid", "-o"};
  const auto with = [&](std::vector<std::string> more) {
    std::vector<std::string> arguments = bend;
    arguments.insert(arguments.end(), more.begin(), more.end());
    return call(arguments);
  };
  ASSERT_EQ(with({"whole.obj"}).code, 0);
  const Result preview = with({"proxy.obj", "--preview", "60"});
  ASSERT_EQ(preview.code, 0) << preview.err;
  EXPECT_NE((preview.out + preview.err).find("a preview: "), std::string::npos);
  const auto vertices = [&](const std::string& name) {
    std::set<std::string> places;  // without colours, which a preview has not
    std::istringstream text(read(name));
    for (std::string line, v, x, y, z; std::getline(text, line);)
      if (std::istringstream(line) >> v >> x >> y >> z && v == "v") places.insert(x + ' ' + y + ' ' + z);
    return places;
  };
  const auto whole = vertices("whole.obj"), proxy = vertices("proxy.obj");
  EXPECT_GT(proxy.size(), 8u);
  EXPECT_LT(proxy.size(), 200u);
  for (const std::string& v : proxy) EXPECT_TRUE(whole.contains(v)) << v;
}

TEST_F(Deform, SizesWhoseCubesAreNoNumbersAndEndlessAnglesAreRefused) {
  writeFile(folder / "huge.obj", "v 0 0 0\nv 1e200 0 0\nv 0 1e200 0\nf 1 2 3\n");
  writeFile(folder / "tiny.obj", "v 0 0 0\nv 1e-200 0 0\nv 0 1e-200 0\nf 1 2 3\n");
  for (const char* file : {"huge.obj", "tiny.obj"}) {
    const Result result = call({"bend", file, "-o", "out.obj", "--angle", "30"});
    EXPECT_EQ(result.code, 1);
    EXPECT_NE(result.err.find("expected sizes from 1e-90"), std::string::npos) << result.err;
    EXPECT_FALSE(std::filesystem::exists(folder / "out.obj"));
  }
  const Result result = call({"twist", "bar.ply", "-o", "out.ply", "--angle", "1e9"});
  EXPECT_EQ(result.code, 2);
  EXPECT_NE(result.err.find("expected a number in -360000..360000"), std::string::npos) << result.err;
}

TEST_F(Deform, ValuesOutOfRangeAreWrongUsageAndNameTheOption) {
  const std::vector<std::vector<std::string>> mistakes{
      {"--radius", "0"},      {"--radius", "-1"},        {"--radius", "inf"},       {"--tolerance", "-1"},   {"--tolerance", "0"},
      {"--tolerance", "nan"}, {"--sharpness", "0"},      {"--sharpness", "501"},    {"--falloff", "0"},      {"--falloff", "1.5"},
      {"--substeps", "0"},    {"--max-stretch", "0.5"},  {"--max-deviation", "0"},  {"--max-vertices", "-1"}, {"--frames", "1"},
      {"--from", "-0.5"},     {"--allow-residual", "-1"}, {"--angle", "400000"},    {"--axis", "0,0,0"},     {"--allow-folds", "-1"},
      {"--picture", "p.jpg"}, {"--picture", "p"},        {"--output", "out.xyz"}};
  for (const auto& mistake : mistakes) {
    std::vector<std::string> arguments{"bend", "absent.ply"};  // not even looked for
    if (mistake[0] != "--output") arguments.insert(arguments.end(), {"-o", "out.ply"});
    if (mistake[0] != "--angle") arguments.insert(arguments.end(), {"--angle", "30"});
    arguments.insert(arguments.end(), mistake.begin(), mistake.end());
    const Result result = call(arguments);
    EXPECT_EQ(result.code, 2) << mistake[0] << " " << mistake[1] << ": " << result.err;
    EXPECT_NE(result.err.find(mistake[0]), std::string::npos) << result.err;
    EXPECT_NE(result.err.find("expected"), std::string::npos) << result.err;
  }
  EXPECT_EQ(call({"bend", "bar.ply", "-o", "out.ply", "--angle", "30", "--axis", "z", "--about", "0,0,-2"}).code, 2);
  EXPECT_EQ(call({"bend", "bar.ply", "bar.ply", "-o", "out/", "--angle", "30", "--save-scene", "s.json"}).code, 2);
  EXPECT_EQ(call({"skeleton", "bar.ply", "-o", "spine.json", "--points", "1"}).code, 2);
  EXPECT_EQ(call({"skeleton", "bar.ply", "-o", "spine.fbx"}).code, 2);
  EXPECT_EQ(call({"skeleton", "bar.ply", "-o", "spine"}).code, 2);
  EXPECT_EQ(folder.files(), (std::vector<std::string>{"bar.ply", "rest.json"}));
}

TEST_F(Deform, NamesOfPicturesMayBeInUpperCaseFoldersOrDevices) {
  EXPECT_EQ(call({"skeleton", "bar.ply", "-o", "SPINE.OBJ"}).code, 0);
  EXPECT_EQ(call({"skeleton", "bar.ply", "-o", "/dev/null"}).code, 0);
  EXPECT_EQ(call({"twist", "bar.ply", "-o", "/dev/null", "--angle", "+30", "--radius", "+1"}).code, 0);
}

TEST_F(Deform, AScenesPictureIsRefusedByItsNameBeforeTheMeshIsRead) {
  ASSERT_EQ(call({"bend", "bar.ply", "-o", "out.ply", "--angle", "30", "--save-scene", "scene.json"}).code, 0);
  std::string scene = read("scene.json");
  const auto at = scene.find("\"out.ply\"");
  ASSERT_NE(at, std::string::npos) << scene;
  writeFile(folder / "scene.json", scene.replace(at, 9, "\"out.xyz\""));
  const Result result = call({"run", "scene.json"});
  EXPECT_EQ(result.code, 1);
  EXPECT_NE(result.err.find("expected a name that ends in .ply"), std::string::npos) << result.err;
}

TEST_F(Deform, SeveralInputsNeedAFolderAndNoneIsMadeUnderAFilesName) {
  writeFile(folder / "other.ply", barPly(16));
  const Result result = call({"bend", "bar.ply", "other.ply", "-o", "out.obj", "--angle", "10"});
  EXPECT_EQ(result.code, 1);
  EXPECT_NE(result.err.find("several inputs need a folder"), std::string::npos) << result.err;
  EXPECT_FALSE(std::filesystem::exists(folder / "out.obj"));
  EXPECT_EQ(call({"bend", "bar.ply", "other.ply", "-o", "out/", "--angle", "10"}).code, 0);
  EXPECT_TRUE(std::filesystem::exists(folder / "out" / "other.ply"));
}

TEST_F(Deform, AStraightSkeletonBendsAboutTheMeshsSecondExtent) {
  // Four times as wide as thick: about the wide axis, whatever the rounding of the line says.
  writeFile(folder / "slab.obj",
            "v -.4 -.1 0\nv .4 -.1 0\nv .4 .1 0\nv -.4 .1 0\nv -.4 -.1 4\nv .4 -.1 4\nv .4 .1 4\nv -.4 .1 4\n"
            "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n");
  writeFile(folder / "line.json", R"({"format": "fielddeform-skeleton", "version": 1, "primitives": [{"name": "s", "type": "polyline",
    "radius": 2, "points": [[0, 0, 0], [0, 1e-9, 1], [1e-9, 0, 2], [0, 0, 3], [0, 0, 4]]}]})");
  ASSERT_EQ(call({"bend", "slab.obj", "--rest", "line.json", "-o", "a.obj", "--angle", "40", "--save-scene", "a.json"}).code, 0);
  const JsonDocument scene = JsonDocument::read(folder / "a.json");
  Vec3 about = Vec3::Zero();
  for (const JsonValue edit : scene.root().require("edits").array(1)) about = edit.require("about").vec3();
  EXPECT_LT((about - Vec3(1, 0, 0)).norm(), 1e-6) << about.transpose();
}

TEST_F(Deform, ASavedSceneReplaysToTheByteForOddAxes) {
  for (const char* angle : {"33", "70", "123.456"}) {
    ASSERT_EQ(call({"bend", "bar.ply", "-o", "a.ply", "--angle", angle, "--axis", ".1,.2,1", "--about", "1,.3,.7",
                    "--precision", "double", "--save-scene", "a.json"}).code, 0);
    const std::string first = read("a.ply");
    ASSERT_EQ(call({"run", "a.json"}).code, 0);
    EXPECT_EQ(read("a.ply"), first) << angle;
  }
}

TEST_F(Deform, TheSameBytesOnAnyNumberOfThreads) {
  std::string first;
  for (const char* threads : {"1", "2", "7"}) {
    const Result result = call({"bend", "bar.ply", "-o", "out.ply", "--angle", "90", "--resample", "--threads", threads});
    ASSERT_EQ(result.code, 0) << result.err;
    if (first.empty()) first = read("out.ply");
    EXPECT_EQ(read("out.ply"), first) << threads;
  }
}

TEST_F(Deform, ASavedSceneReplaysToTheSameBytes) {
  const std::vector<std::vector<std::string>> edits{
      {"bend", "--angle", "70", "--from", "0.2"}, {"bend", "--arc-radius", "3"}, {"twist", "--angle", "100"},
      {"taper", "--factor", "0.5"}, {"stretch", "--factor", "1.7", "--resample"}, {"bend", "--angle", "50", "--radius", "2"},
      {"bend", "--angle", "50", "--rest", "rest.json"}};
  for (auto arguments : edits) {
    arguments.insert(arguments.end(), {"bar.ply", "-o", "out.ply", "--save-scene", "saved.json"});
    ASSERT_EQ(call(arguments).code, 0) << arguments[0];
    const std::string out = read("out.ply");
    writeFile(folder / "out.ply", "");
    const Result again = call({"run", "saved.json"});
    ASSERT_EQ(again.code, 0) << again.err;
    EXPECT_EQ(read("out.ply"), out) << arguments[0] << " " << arguments[2];
    EXPECT_NE(out, read("bar.ply"));
  }
}

TEST_F(Deform, ReportCountsAddUpAndMatchTheFile) {
  const Result result = call({"bend", "bar.ply", "-o", "out.ply", "--angle", "120", "--resample", "--report", "out.json"});
  ASSERT_EQ(result.code, 0) << result.err;
  const JsonDocument report = JsonDocument::read(folder / "out.json");
  const JsonValue root = report.root();
  const auto vertices = root.require("vertices").integer(0, 1u << 30);
  std::uint64_t sum = 0;
  for (const JsonValue count : root.require("status").members()) sum += count.integer(0, 1u << 30);
  EXPECT_EQ(sum, vertices);
  EXPECT_EQ(vertices, 68 + root.require("inserted_vertices").integer(1, 1u << 30));
  EXPECT_NE(read("out.ply").find("element vertex " + std::to_string(vertices) + "\n"), std::string::npos);
  EXPECT_EQ(root.require("run").require("paths").require("output").string(), "out.ply");
  EXPECT_GT(root.require("volume").require("as_written").number(), 0);
}

TEST_F(Deform, OneBadMeshDoesNotStopTheRest) {
  writeFile(folder / "bad.ply", "ply\nnonsense\n");
  writeFile(folder / "two.ply", barPly(8));
  const Result result = call({"twist", "bar.ply", "bad.ply", "two.ply", "-o", "out/", "--angle", "45", "--report", "reports/"});
  EXPECT_EQ(result.code, 1);
  EXPECT_NE(result.err.find("fielddeform: bad.ply:"), std::string::npos) << result.err;
  EXPECT_NE(result.out.find("2 of 3 meshes done"), std::string::npos) << result.out;
  EXPECT_EQ(folder.files(),
            (std::vector<std::string>{"bad.ply", "bar.ply", "out", "out/bar.ply", "out/two.ply", "reports",
                                      "reports/bar.json", "reports/two.json", "rest.json", "two.ply"}));
}

TEST_F(Deform, FailuresLeaveNoOutputAndTheOldFileAlone) {
  writeFile(folder / "out.ply", "old");
  const auto before = folder.files();
  const std::vector<std::pair<int, std::vector<std::string>>> failures{
      {1, {"bend", "absent.ply", "-o", "out.ply", "--angle", "9"}},
      {1, {"bend", "bar.ply", "-o", "no/folder/out.ply", "--angle", "9"}},
      {1, {"bend", "bar.ply", "-o", "out.ply", "--angle", "9", "--report", "no/folder/out.json"}},
      {1, {"bend", "bar.ply", "-o", "out.ply", "--angle", "9", "--mask", "absent"}},
      {1, {"bend", "bar.ply", "-o", "out.ply", "--angle", "9", "--mask", "rest.json"}},
      {1, {"bend", "bar.ply", "-o", "out.ply", "--angle", "9", "--rest", "bar.ply"}},
      {1, {"bend", "bar.ply", "-o", "out.ply", "--angle", "9", "--rest", "rest.json", "--primitive", "absent"}},
      {1, {"deform", "bar.ply", "-o", "out.ply", "--rest", "rest.json", "--posed", "rest.json", "--pair", "a=b"}},
      {2, {"bend", "bar.ply", "-o", "out.ply", "--angle", "9", "--radius", "-1"}},
      {2, {"bend", "bar.ply", "-o", "out.ply"}},
      {2, {"bend", "bar.ply", "-o", "out.ply", "--angle", "9", "--arc-radius", "1"}},
      {2, {"bend", "bar.ply", "-o", "out.ply", "--angle", "nan"}},
      {2, {"bend", "bar.ply", "-o", "out.ply", "--angle", "9", "--from", "0.8", "--to", "0.2"}},
      {2, {"bend", "bar.ply", "-o", "out.ply", "--angle", "9", "--axis", "0,0,0"}},
      {2, {"bend", "bar.ply", "-o", "out.ply", "--angle", "9", "--track", "best"}},
      {2, {"bend", "bar.ply", "-o", "out.ply", "--angle", "9", "--frames", "1"}},
      {2, {"taper", "bar.ply", "-o", "out.ply", "--factor", "0"}},
      {2, {"deform", "bar.ply", "-o", "out.ply", "--rest", "rest.json"}},
      {2, {"deform", "bar.ply", "-o", "out.ply", "--rest", "rest.json", "--posed", "rest.json", "--pair", "a"}}};
  for (const auto& [code, arguments] : failures) {
    const Result result = call(arguments);
    std::string line;
    for (const auto& a : arguments) line += a + " ";
    EXPECT_EQ(result.code, code) << line << result.err;
    EXPECT_TRUE(result.err.starts_with("fielddeform: ")) << line << result.err;
    EXPECT_EQ(folder.files(), before) << line;
    EXPECT_EQ(read("out.ply"), "old") << line;
  }
}

TEST_F(Deform, ACheckThatFailsEndsWithThreeAndStillWrites) {
  const std::vector<std::string> common{"bend", "bar.ply", "-o", "out.ply", "--angle", "90", "--no-corrector"};
  auto strict = common, lax = common;
  strict.insert(strict.end(), {"--allow-residual", "0"});
  lax.insert(lax.end(), {"--allow-residual", "100"});
  const Result failed = call(strict);
  EXPECT_EQ(failed.code, 3) << failed.err;
  EXPECT_NE(failed.err.find("check failed: residual"), std::string::npos) << failed.err;
  EXPECT_EQ(folder.files().size(), 3u);
  EXPECT_EQ(call(lax).code, 0);
}

TEST_F(Deform, FramesGoFromTheInputToTheResult) {
  ASSERT_EQ(call({"bend", "bar.ply", "-o", "all.ply", "--angle", "90"}).code, 0);
  ASSERT_EQ(call({"bend", "bar.ply", "-o", "half.ply", "--angle", "45"}).code, 0);
  const Result result = call({"bend", "bar.ply", "-o", "f.ply", "--angle", "90", "--frames", "3"});
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_EQ(read("f_0000.ply"), read("bar.ply"));
  EXPECT_EQ(read("f_0001.ply"), read("half.ply"));  // half the parameter is half the angle
  EXPECT_EQ(read("f_0002.ply"), read("all.ply"));
}

TEST_F(Deform, AMaskOfZerosKeepsAllAndOfOnesChangesNothing) {
  std::string zeros, ones;
  for (int i = 0; i < 68; ++i) {
    zeros += "0\n";
    ones += "1\n";
  }
  writeFile(folder / "zeros", zeros);
  writeFile(folder / "ones", ones);
  ASSERT_EQ(call({"bend", "bar.ply", "-o", "free.ply", "--angle", "90"}).code, 0);
  ASSERT_EQ(call({"bend", "bar.ply", "-o", "none.ply", "--angle", "90", "--mask", "zeros"}).code, 0);
  ASSERT_EQ(call({"bend", "bar.ply", "-o", "full.ply", "--angle", "90", "--mask", "ones"}).code, 0);
  EXPECT_EQ(read("none.ply"), read("bar.ply"));
  EXPECT_EQ(read("full.ply"), read("free.ply"));
  EXPECT_NE(read("free.ply"), read("bar.ply"));
}

TEST_F(Deform, InvalidVerticesAreRefusedOrSkippedAndCounted) {
  writeFile(folder / "nan.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nv 0 0 1\nf 1 3 2\nf 1 2 5\n");
  const Result refused = call({"twist", "nan.obj", "-o", "out.obj", "--angle", "90"});
  EXPECT_EQ(refused.code, 1);
  EXPECT_NE(refused.err.find("nan.obj:4:"), std::string::npos) << refused.err;
  const Result result = call({"twist", "nan.obj", "-o", "out.obj", "--angle", "90", "--skip-invalid", "--report", "r.json",
                              "--attributes", "displacement"});
  ASSERT_EQ(result.code, 0) << result.err;
  const JsonDocument report = JsonDocument::read(folder / "r.json");
  EXPECT_EQ(report.root().require("status").require("invalid").integer(0, 9), 1u);
  EXPECT_NE(read("out.obj").find("v nan 0 0\n"), std::string::npos) << read("out.obj");
}

TEST_F(Deform, WeldedFacetsAreOneSurfaceAndComeBackAsFacets) {
  // A tetrahedron as STL: four facets, twelve corners, four places.
  std::string stl = "solid t\n";
  const char* corners[] = {"0 0 0", "1 0 0", "0 1 0", "0 0 2"};
  const int facets[4][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  for (const auto& facet : facets) {
    stl += "facet normal 0 0 0\nouter loop\n";
    for (const int c : facet) stl += std::string("vertex ") + corners[c] + "\n";
    stl += "endloop\nendfacet\n";
  }
  writeFile(folder / "t.stl", stl + "endsolid t\n");
  const Result result = call({"twist", "t.stl", "-o", "out.stl", "--angle", "40", "--weld", "--report", "r.json"});
  ASSERT_EQ(result.code, 0) << result.err;
  const JsonDocument report = JsonDocument::read(folder / "r.json");
  EXPECT_EQ(report.root().require("vertices").integer(0, 99), 4u);
  EXPECT_FALSE(report.root().require("volume").require("before").isNull());
  const JsonDocument info = JsonDocument::parse(call({"info", "--json", "out.stl"}).out, "out.stl");
  EXPECT_EQ(info.root().require("vertices").integer(0, 99), 12u);
}

TEST_F(Deform, AttributesAreWrittenOnceHoweverOften) {
  const std::vector<std::string> names{"--attributes", "status,residual,displacement"};
  ASSERT_EQ(call({"bend", "bar.ply", "-o", "one.ply", "--angle", "30", names[0], names[1]}).code, 0);
  const Result again = call({"bend", "one.ply", "-o", "two.ply", "--angle", "30", names[0], names[1]});
  ASSERT_EQ(again.code, 0) << again.err;
  for (const char* file : {"one.ply", "two.ply"}) {
    const JsonDocument info = JsonDocument::parse(call({"info", "--json", file}).out, file);
    EXPECT_EQ(info.root().require("attributes").size(), 6u) << file;  // PLY: the vector is three numbers; and the colour
  }
}

TEST_F(Deform, InterruptedRunsEndWith130AndLeaveTheOldFile) {
  writeFile(folder / "big.ply", barPly(60000));
  writeFile(folder / "out.ply", "old");
  Background program(folder.path(), {"bend", "big.ply", "-o", "out.ply", "--angle", "90", "--resample", "--max-deviation", "1e-9"});
  std::this_thread::sleep_for(std::chrono::milliseconds(700));
  EXPECT_EQ(program.interrupt(SIGINT), 130);
  EXPECT_EQ(read("out.ply"), "old");
  EXPECT_EQ(folder.files(), (std::vector<std::string>{"bar.ply", "big.ply", "out.ply", "rest.json"}));
}

TEST_F(Deform, WatchRunsAgainWhenTheSkeletonIsSaved) {
  writeFile(folder / "posed.json", kRest);
  writeFile(folder / "scene.json", R"({"format": "fielddeform-scene", "version": 1, "inputs": ["bar.ply"],
    "skeleton": {"rest": "rest.json", "posed": "posed.json"}, "output": {"mesh": "out.ply"}})");
  Background watch(folder.path(), {"watch", "scene.json", "--runs", "3", "--interval", "20", "--no-picture"});
  const auto waitUntil = [&](const std::function<bool()>& done) {
    for (int i = 0; i < 500 && !done(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(20));
    return done();
  };
  ASSERT_TRUE(waitUntil([&] { return read("out.ply") == read("bar.ply"); }));
  writeFile(folder / "posed.json", std::string(kRest).substr(0, 100));  // half saved: reported, watched on
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  writeFile(folder / "posed.json", shifted(kRest, "[0.125, ", "[2.125, "));
  EXPECT_TRUE(waitUntil([&] { return read("out.ply").find("\n2.25 0.25 4 200 20 30\n") != std::string::npos; }));
  EXPECT_EQ(watch.wait(), 0);
}

TEST_F(Deform, WatchEndsWith130) {
  writeFile(folder / "scene.json", "{}");
  Background watch(folder.path(), {"watch", "scene.json", "--interval", "20"});
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  EXPECT_EQ(watch.interrupt(SIGINT), 130);
}

TEST_F(Deform, SkeletonsAreMadeAndUsed) {
  ASSERT_EQ(call({"skeleton", "bar.ply", "-o", "spine.json"}).code, 0);
  ASSERT_EQ(call({"skeleton", "bar.ply", "-o", "points.obj", "--kind", "points", "--points", "20"}).code, 0);
  ASSERT_EQ(call({"bend", "bar.ply", "-o", "auto.ply", "--angle", "60"}).code, 0);
  const Result result = call({"bend", "bar.ply", "-o", "named.ply", "--angle", "60", "--rest", "spine.json", "--axis", "z",
                              "--about", "y"});
  EXPECT_EQ(result.code, 0) << result.err;
  EXPECT_NE(read("points.obj").find("\np "), std::string::npos);
  ASSERT_EQ(call({"skeleton", "bar.ply", "-o", "lod.json", "--kind", "lod", "--faces", "40"}).code, 0);
  const Result same = call({"deform", "bar.ply", "--rest", "lod.json", "--posed", "lod.json", "-o", "same.ply"});
  ASSERT_EQ(same.code, 0) << same.err;
  EXPECT_EQ(read("same.ply"), read("bar.ply"));
  const Result twisted = call({"twist", "bar.ply", "--rest", "lod.json", "--angle", "90", "-o", "twisted.ply", "--check"});
  EXPECT_EQ(twisted.code, 0) << twisted.err;
}

}  // namespace
}  // namespace fielddeform::cli_test
