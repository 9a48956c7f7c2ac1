#include <fielddeform/core/json_reader.h>
#include <fielddeform/field/distance.h>
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

#include "program.h"

namespace fielddeform::cli_test {
namespace {

const char* kSpine = R"({"format": "fielddeform-skeleton", "version": 1, "primitives": [
  {"name": "spine", "type": "polyline", "points": [[0.5, 0.5, 0], [0.5, 0.5, 8]], "radius": 2}]})";

TEST(FieldCommand, WritesAnIsosurface) {
  const Scratch scratch;
  writeFile(scratch / "spine.json", kSpine);
  const Result result = run(scratch.path(), {"field", "spine.json", "-o", "tube.ply", "--isosurface", "0.5,1.5", "--voxel", "0.25"});
  ASSERT_EQ(result.code, 0) << result.err;
  const Result info = run(scratch.path(), {"info", "tube.ply"});
  EXPECT_NE(info.out.find("isovalue"), std::string::npos) << info.out;
  EXPECT_NE(info.out.find("closed"), std::string::npos) << info.out;
}

TEST(FieldCommand, WritesAVolumeThatIsASkeletonAgain) {
  if (!field::gridsAvailable()) GTEST_SKIP() << "built without OpenVDB";
  const Scratch scratch;
  writeFile(scratch / "spine.json", kSpine);
  const Result result = run(scratch.path(), {"field", "spine.json", "-o", "f.vdb", "--distance", "grid", "--voxel", "0.2", "--primitives"});
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_NE(result.out.find("grid \"pseudo_distance\""), std::string::npos) << result.out;
  EXPECT_NE(result.out.find("grid \"distance spine\""), std::string::npos) << result.out;
  EXPECT_NE(result.out.find("error at most"), std::string::npos) << result.out;
  const Result skeleton = run(scratch.path(), {"skeleton", "f.vdb", "-o", "lod.json", "--kind", "lod", "--faces", "60", "--isovalue", "1"});
  ASSERT_EQ(skeleton.code, 0) << skeleton.err;
  EXPECT_NE(readFile(scratch / "lod.json").find("\"closed\": true"), std::string::npos);
}

TEST(FieldCommand, AGridOfSeveralIsChosenByName) {
  if (!field::gridsAvailable()) GTEST_SKIP() << "built without OpenVDB";
  const Scratch scratch;
  writeFile(scratch / "two.json", R"({"format": "fielddeform-skeleton", "version": 1, "primitives": [
    {"name": "low", "type": "mesh", "closed": true, "radius": 0.5, "points": [[0,0,0],[1,0,0],[0,1,0],[0,0,1]], "faces": [[0,2,1],[0,1,3],[1,2,3],[0,3,2]]},
    {"name": "high", "type": "mesh", "closed": true, "radius": 0.5, "points": [[0,0,5],[1,0,5],[0,1,5],[0,0,6]], "faces": [[0,2,1],[0,1,3],[1,2,3],[0,3,2]]}]})");
  writeFile(scratch / "dots.obj", "v 0.2 0.2 -0.1\nv 0.2 0.2 4.9\nv 0.3 0.2 -0.1\nf 1 2 3\n");
  ASSERT_EQ(run(scratch.path(), {"field", "two.json", "-o", "f.vdb", "--primitives", "--voxel", "0.1"}).code, 0);
  const auto twist = [&](const std::string& name) {
    return run(scratch.path(), {"twist", "dots.obj", "--angle", "30", "--axis", "z", "--rest", "f.vdb", "--radius", "0.5", "-o", "out.obj", "--report", "r.json",
                                "--save-scene", "scene.json", "--grid", name});
  };
  // What is beyond the influence of the chosen grid's surface stays: two vertices are low, one is high.
  for (const auto& [name, fixed] : {std::pair<std::string, std::string>{"distance high", "\"fixed\": 2"}, {"distance low", "\"fixed\": 1"}}) {
    const Result done = twist(name);
    ASSERT_EQ(done.code, 0) << done.err;
    EXPECT_NE(readFile(scratch / "r.json").find(fixed), std::string::npos) << name << readFile(scratch / "r.json");
    EXPECT_EQ(readFile(scratch / "scene.json").find("\"grid\": \"distance"), std::string::npos);  // the surface itself is in it
  }
  const Result wrong = twist("middle");
  EXPECT_EQ(wrong.code, 1);
  for (const char* word : {"middle", "pseudo_distance", "distance low", "distance high"}) EXPECT_NE(wrong.err.find(word), std::string::npos) << wrong.err;
  const Result useless = run(scratch.path(), {"deform", "dots.obj", "--rest", "two.json", "--posed", "two.json", "--grid", "middle", "-o", "out.obj"});
  EXPECT_EQ(useless.code, 1);
  EXPECT_NE(useless.err.find("no skeleton is a volume"), std::string::npos) << useless.err;
  const Result surface = run(scratch.path(), {"field", "f.vdb", "--grid", "distance high", "--radius", "0.5", "-o", "high.ply", "--isosurface", "0.1", "--voxel", "0.1"});
  ASSERT_EQ(surface.code, 0) << surface.err;
  EXPECT_EQ(run(scratch.path(), {"field", "two.json", "--grid", "distance high", "-o", "x.ply", "--isosurface", "0.1"}).code, 1);
}

TEST(FieldCommand, MistakesLeaveNoFile) {
  const Scratch scratch;
  writeFile(scratch / "spine.json", kSpine);
  writeFile(scratch / "bare.json", R"({"format": "fielddeform-skeleton", "version": 1, "primitives": [
    {"name": "p", "type": "points", "points": [[0, 0, 0]]}]})");
  const std::vector<std::pair<int, std::vector<std::string>>> mistakes{
      {2, {"field", "spine.json"}},
      {2, {"field", "spine.json", "-o", "x.ply"}},
      {2, {"field", "spine.json", "-o", "x.txt", "--isosurface", "1"}},
      {2, {"field", "spine.json", "-o", "x.png", "--slice", "w"}},
      {2, {"field", "spine.json", "-o", "x.ply", "--isosurface", "1,a"}},
      {2, {"field", "spine.json", "-o", "x.ply", "--isosurface", "1", "--distance", "near"}},
      {1, {"field", "absent.json", "-o", "x.ply", "--isosurface", "1"}},
      {1, {"field", "bare.json", "-o", "x.ply", "--isosurface", "1"}},
      {1, {"field", "spine.json", "-o", "x.ply", "--isosurface", "1", "--voxel", "1e-6"}},
      {1, {"field", "spine.json", "-o", "no/folder/x.ply", "--isosurface", "1", "--voxel", "0.5"}}};
  for (const auto& [code, arguments] : mistakes) {
    const Result result = run(scratch.path(), arguments);
    EXPECT_EQ(result.code, code) << result.err;
    EXPECT_TRUE(result.err.starts_with("fielddeform: ")) << result.err;
    EXPECT_EQ(scratch.files(), (std::vector<std::string>{"bare.json", "spine.json"}));
  }
}

TEST(Distance, EveryDeformingCommandTakesIt) {
  const Scratch scratch;
  writeFile(scratch / "bar.ply", barPly(8));
  std::vector<std::string> kinds{"exact", "variational"};
  if (field::gridsAvailable()) kinds.push_back("grid");
  for (const std::string& kind : kinds) {
    const Result result = run(scratch.path(), {"bend", "bar.ply", "-o", kind + ".ply", "--angle", "30", "--distance", kind,
                                               "--save-scene", kind + ".json", "--centres", "200"});
    EXPECT_EQ(result.code, 0) << result.err;
    EXPECT_NE(readFile(scratch / (kind + ".json")).find("\"distance\": \"" + kind + "\""), std::string::npos);
    const std::string first = readFile(scratch / (kind + ".ply"));
    EXPECT_EQ(run(scratch.path(), {"run", kind + ".json"}).code, 0);
    EXPECT_EQ(readFile(scratch / (kind + ".ply")), first) << kind;
  }
}

// The coordinates of an ASCII PLY file of barPly()'s layout.
std::vector<double> coordinatesOf(const std::string& ply) {
  std::istringstream in(ply.substr(ply.find("end_header") + 11));
  std::vector<double> out;
  for (std::string line; std::getline(in, line) && line.find("200 ") != std::string::npos;) {
    std::istringstream row(line);
    for (int k = 0; k < 3; ++k) row >> out.emplace_back();
  }
  return out;
}

double rms(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(sum / static_cast<double>(a.size()));
}

// A bar deformed by a.json, and by b.json if that is not a bend.
std::vector<double> deformedBy(const Scratch& scratch, std::vector<std::string> command, const std::vector<std::string>& distance) {
  for (const char* word : {"-o", "out.ply", "--rest", "a.json", "--precision", "double", "--tolerance", "1e-9", "--falloff", "off"})
    command.emplace_back(word);
  command.insert(command.end(), distance.begin(), distance.end());
  const Result result = run(scratch.path(), command);
  EXPECT_EQ(result.code, 0) << result.err;
  return coordinatesOf(readFile(scratch / "out.ply"));
}

std::vector<std::string> gridOf(const std::string& voxel, const std::string& sampling, const std::string& of) {
  return {"--distance", "grid", "--voxel", voxel, "--sampling", sampling, "--grid-of", of};
}

TEST(Distance, ABendByGridsConvergesToTheExactOne) {
  if (!field::gridsAvailable()) GTEST_SKIP() << "built without OpenVDB";
  const Scratch scratch;
  writeFile(scratch / "bar.ply", barPly(100));
  // Beside the bar, so that no vertex is near enough to be exact, and askew to the voxels, so that every vertex meets others.
  writeFile(scratch / "a.json", R"({"format": "fielddeform-skeleton", "version": 1, "primitives": [
    {"name": "a", "type": "polyline", "points": [[-0.75, 0.1, -0.5], [-0.55, 0.4, 4.5]], "radius": 2}]})");
  const std::vector<std::string> bend{"bend", "bar.ply", "--angle", "-80", "--about", "y", "--track", "axial"};
  const std::vector<double> exact = deformedBy(scratch, bend, {});
  ASSERT_EQ(exact.size(), 3u * 404);
  for (const std::string of : {"primitives", "blend"}) {
    std::vector<double> linear, quadratic;
    for (const std::string voxel : {"0.16", "0.08", "0.04"}) {
      linear.push_back(rms(deformedBy(scratch, bend, gridOf(voxel, "trilinear", of)), exact));
      quadratic.push_back(rms(deformedBy(scratch, bend, gridOf(voxel, "quadratic", of)), exact));
    }
    EXPECT_GT(linear[0] / linear[1], 2.5) << of;  // 4 in the limit; at first the exact part is half of the reach
    EXPECT_GT(linear[1] / linear[2], 3.5) << of;
    EXPECT_LT(linear[2], 2e-4);
    // The bent spine's own corners, a few hundredths apart, are what is left.
    for (std::size_t i = 0; i < 3; ++i) EXPECT_LT(quadratic[i], 0.2 * linear[i]) << of;
  }
}

// A point whose radius grows carries everything away from it in proportion: x' = c + r'/r (x - c).
TEST(Distance, AGrowingPointIsMetWithTheOrderOfTheSampling) {
  if (!field::gridsAvailable()) GTEST_SKIP() << "built without OpenVDB";
  const Scratch scratch;
  writeFile(scratch / "bar.ply", barPly(100));
  const std::string point = R"({"format": "fielddeform-skeleton", "version": 1, "primitives": [
    {"name": "a", "type": "points", "points": [[-0.8, 0.1, 2]], "radius": )";
  writeFile(scratch / "a.json", point + "3}]}");
  writeFile(scratch / "b.json", point + "3.3}]}");
  const std::vector<std::string> grow{"deform", "bar.ply", "--posed", "b.json"};
  const std::vector<double> rest = deformedBy(scratch, {"deform", "bar.ply", "--posed", "a.json"}, {});
  const auto radial = [](const std::vector<double>& x, std::size_t i) { return std::hypot(x[i] + 0.8, x[i + 1] - 0.1, x[i + 2] - 2); };
  for (const std::string of : {"primitives", "blend"})
    for (const std::string sampling : {"trilinear", "quadratic"}) {
      std::vector<double> errors;
      for (const std::string voxel : {"0.16", "0.08", "0.04"}) {
        const std::vector<double> out = deformedBy(scratch, grow, gridOf(voxel, sampling, of));
        double sum = 0;
        for (std::size_t i = 0; i < rest.size(); i += 3) sum += std::pow(radial(out, i) - 1.1 * radial(rest, i), 2);
        errors.push_back(std::sqrt(sum / static_cast<double>(rest.size() / 3)));
      }
      const double order = sampling == "quadratic" ? 8 : 4;  // in the limit
      EXPECT_GT(errors[0] / errors[1], 0.75 * order) << of << sampling;
      EXPECT_GT(errors[1] / errors[2], 0.8 * order) << of << sampling;
    }
}

TEST(Distance, TheReportSaysWhatTheGridsAre) {
  if (!field::gridsAvailable()) GTEST_SKIP() << "built without OpenVDB";
  const Scratch scratch;
  writeFile(scratch / "bar.ply", barPly(24));
  const std::vector<std::string> command{"bend", "bar.ply", "-o", "out.ply", "--angle", "40", "--distance", "grid", "--voxel", "0.012", "--report", "r.json"};
  ASSERT_EQ(run(scratch.path(), command).code, 0);
  double near = 0, whole = 0;
  {
    const std::string text = readFile(scratch / "r.json");
    const JsonDocument document = JsonDocument::parse(text, "r.json");
    const JsonValue d = document.root().require("distance");
    EXPECT_EQ(d.require("used").string(), "grid");
    EXPECT_EQ(d.require("of").string(), "primitives");
    EXPECT_EQ(d.require("memory_limit_mb").number(), 2048);
    near = d.require("memory_mb").number();
    double sum = 0;
    std::vector<std::string> poses;
    for (const JsonValue g : d.require("grids").array()) {
      poses.push_back(g.require("pose").string());
      EXPECT_GT(g.require("voxel").number(), 0);
      EXPECT_GT(g.require("voxels").number(), 0);
      EXPECT_GT(g.require("error_bound").number(), 0);
      EXPECT_GT(g.require("error_bound_at_kinks").number(), g.require("error_bound").number());
      EXPECT_LE(g.require("error_measured").number(), g.require("error_bound_at_kinks").number());
      sum += g.require("memory_mb").number();
    }
    EXPECT_EQ(poses, (std::vector<std::string>{"rest", "posed"}));
    EXPECT_NEAR(sum, near, 1e-9);
  }
  std::vector<std::string> all = command;
  all.insert(all.end(), {"--grid-around", "influence", "--grid-of", "blend"});
  ASSERT_EQ(run(scratch.path(), all).code, 0);
  const JsonDocument document = JsonDocument::parse(readFile(scratch / "r.json"), "r.json");
  const JsonValue d = document.root().require("distance");
  EXPECT_EQ(d.require("of").string(), "blend");
  whole = d.require("memory_mb").number();
  EXPECT_GT(whole, 1.5 * near);
  EXPECT_NE(readFile(scratch / "r.json").find("\"grid_around\": \"influence\""), std::string::npos);
}

TEST(Distance, TooMuchMemoryIsRefusedAndNothingWritten) {
  if (!field::gridsAvailable()) GTEST_SKIP() << "built without OpenVDB";
  const Scratch scratch;
  writeFile(scratch / "bar.ply", barPly(24));
  writeFile(scratch / "spine.json", kSpine);
  for (const std::string of : {"primitives", "blend"})
    for (const std::string around : {"mesh", "influence"}) {
      const Result result = run(scratch.path(), {"bend", "bar.ply", "-o", "out.ply", "--angle", "40", "--distance", "grid", "--grid-of", of,
                                                 "--voxel", "0.001", "--distance-memory", "5", "--report", "r.json", "--grid-around", around});
      EXPECT_EQ(result.code, 1);
      EXPECT_NE(result.err.find(" needs about "), std::string::npos) << result.err;
      EXPECT_NE(result.err.find("must be <= 5 MB"), std::string::npos) << result.err;
      EXPECT_EQ(scratch.files(), (std::vector<std::string>{"bar.ply", "spine.json"}));
    }
  const Result result = run(scratch.path(), {"field", "spine.json", "-o", "f.vdb", "-o", "f.png", "--distance", "grid", "--grid-of", "blend",
                                             "--voxel", "0.01", "--distance-memory", "7", "--report", "r.json"});
  EXPECT_EQ(result.code, 1);
  EXPECT_NE(result.err.find("must be <= 7 MB"), std::string::npos) << result.err;
  EXPECT_EQ(scratch.files(), (std::vector<std::string>{"bar.ply", "spine.json"}));
}

TEST(FieldCommand, ReportsItsGrid) {
  if (!field::gridsAvailable()) GTEST_SKIP() << "built without OpenVDB";
  const Scratch scratch;
  writeFile(scratch / "spine.json", kSpine);
  const Result result = run(scratch.path(), {"field", "spine.json", "-o", "f.png", "--width", "32", "--distance", "grid", "--grid-of", "blend",
                                             "--voxel", "0.2", "--report", "r.json"});
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_NE(result.out.find("whole field: grid of "), std::string::npos) << result.out;
  EXPECT_NE(result.out.find("error at most"), std::string::npos) << result.out;
  const JsonDocument document = JsonDocument::parse(readFile(scratch / "r.json"), "r.json");
  const JsonValue d = document.root().require("distance");
  EXPECT_EQ(d.require("of").string(), "blend");
  for (const JsonValue g : d.require("grids").array()) {
    EXPECT_EQ(g.require("voxel").number(), 0.2);
    EXPECT_GT(g.require("voxels").number(), 0);
    EXPECT_GT(g.require("error_bound").number(), 0);
  }
}

TEST(Distance, WarpPairsComeFromAFile) {
  const Scratch scratch;
  writeFile(scratch / "bar.ply", barPly(8));
  writeFile(scratch / "pairs.txt", "# point, where it goes\n0 0 0  0 0 0\n1 1 0  1 1 0\n\n0 1 8  0.5 1 8\n1 0 8  1.5 0 8\n");
  const std::vector<std::string> command{"bend", "bar.ply", "-o", "out.ply", "--angle", "30", "--warp-pairs", "pairs.txt", "--save-scene", "s.json"};
  const Result result = run(scratch.path(), command);
  EXPECT_EQ(result.code, 0) << result.err;
  EXPECT_NE(readFile(scratch / "s.json").find("\"warp_pairs\""), std::string::npos);
  writeFile(scratch / "pairs.txt", "0 0 0 0 0\n");
  const Result broken = run(scratch.path(), command);
  EXPECT_EQ(broken.code, 1);
  EXPECT_TRUE(broken.err.starts_with("fielddeform: pairs.txt:1: 5 numbers")) << broken.err;
}

}  // namespace
}  // namespace fielddeform::cli_test
