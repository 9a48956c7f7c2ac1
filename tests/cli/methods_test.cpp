// Every method by skeleton, end to end: what works for one works for all, and options that mean nothing are refused.
#include <fielddeform/core/json_reader.h>
#include <fielddeform/scene/methods.h>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <sstream>

#include "program.h"

namespace fielddeform::cli_test {
namespace {

namespace fs = std::filesystem;

constexpr const char* kRest = R"({"format": "fielddeform-skeleton", "version": 1, "primitives": [
  {"name": "spine", "type": "polyline", "radius": 1,
   "points": [[0.125, 0.125, 0], [0.125, 0.125, 1], [0.125, 0.125, 2], [0.125, 0.125, 3], [0.125, 0.125, 4]]}]})";

std::vector<std::string> words() {
  std::vector<std::string> out;
  for (const scene::MethodInfo& info : scene::methods()) out.emplace_back(info.word);
  return out;
}

class Methods : public ::testing::Test {
 protected:
  void SetUp() override {
    writeFile(folder / "bar.ply", barPly(24));
    writeFile(folder / "rest.json", kRest);
  }
  Result call(std::vector<std::string> arguments, const std::string& method) const {
    arguments.insert(arguments.end(), {"--method", method});
    return run(folder.path(), arguments);
  }
  JsonDocument report(const std::string& name) const { return JsonDocument::read(folder / name); }

  Scratch folder;
};

class MethodsSlow : public Methods {};

std::uint64_t count(const JsonValue& root, std::string_view key) { return root.require(key).integer(0, 1ull << 40); }

// Counts that add up, nothing that is not finite, and the method's own name.
void expectSound(const JsonDocument& document, const std::string& method) {
  const JsonValue root = document.root();
  EXPECT_EQ(root.require("method").string(), method);
  std::uint64_t sum = 0;
  for (const JsonValue n : root.require("status").members()) sum += n.integer(0, 1ull << 40);
  EXPECT_EQ(sum, count(root, "vertices"));
  EXPECT_EQ(count(root.require("status"), "invalid"), 0u);
  EXPECT_GT(count(root.require("status"), "converged"), 0u);
  EXPECT_TRUE(std::isfinite(root.require("stretch").require("max").number()));
}

TEST_F(Methods, AnUneditedSkeletonGivesTheInputByteForByte) {
  for (const std::string& method : words()) {
    const Result result = call({"deform", "bar.ply", "--rest", "rest.json", "--posed", "rest.json", "-o", "out.ply"}, method);
    ASSERT_EQ(result.code, 0) << method << result.err;
    EXPECT_EQ(readFile(folder / "out.ply"), readFile(folder / "bar.ply")) << method;
  }
}

TEST_F(Methods, AMovedSkeletonMovesTheMesh) {
  std::string posed = kRest;
  for (std::size_t at = 0; (at = posed.find("[0.125, ", at)) != std::string::npos; at += 8) posed.replace(at, 8, "[2.125, ");
  writeFile(folder / "posed.json", posed);
  for (const std::string& method : words()) {
    if (method == "wires") continue;  // carries space by its density, not as a whole
    const Result result = call({"deform", "bar.ply", "--rest", "rest.json", "--posed", "posed.json", "-o", "out.ply"}, method);
    ASSERT_EQ(result.code, 0) << method << result.err;
    const std::string out = readFile(folder / "out.ply");
    // Exact in the file's floats, but for a rounding of zero.
    EXPECT_NE(out.find("\n2.25 0.25 4 200 20 30\n"), std::string::npos) << method << out.substr(0, 600);
  }
}

TEST_F(MethodsSlow, EachWorksWithResamplingMaskFramesAndTheVolumePass) {
  std::string mask;
  for (int v = 0; v < 100; ++v) mask += v < 4 ? "0\n" : "1\n";
  writeFile(folder / "mask.txt", mask);
  for (const std::string& method : words()) {
    SCOPED_TRACE(method);
    const std::vector<std::string> bend{"bend", "bar.ply", "--angle", "60", "--axis", "z", "--about", "x", "-o", "out.ply",
                                        "--report", "out.json"};
    const auto with = [&](std::initializer_list<const char*> more) {
      std::vector<std::string> arguments = bend;
      arguments.insert(arguments.end(), more.begin(), more.end());
      const Result result = call(arguments, method);
      EXPECT_EQ(result.code, 0) << result.err;
      expectSound(report("out.json"), method);
    };
    with({"--resample", "--max-deviation", "0.0001"});
    EXPECT_GT(count(report("out.json").root(), "inserted_vertices"), 0u);
    with({"--mask", "mask.txt"});
    EXPECT_GE(count(report("out.json").root().require("status"), "fixed"), 4u);
    with({"--preserve-volume", "--precision", "double"});
    const JsonDocument kept = report("out.json");
    EXPECT_LT(std::abs(kept.root().require("volume").require("relative_change").number()), 1e-9);
    with({"--frames", "3"});
    EXPECT_EQ(readFile(folder / "out_0000.ply"), readFile(folder / "bar.ply"));
    EXPECT_NE(readFile(folder / "out_0001.ply"), readFile(folder / "out_0002.ply"));
  }
}

TEST_F(MethodsSlow, ASavedSceneGivesTheSameBytes) {
  for (const std::string& method : words()) {
    SCOPED_TRACE(method);
    for (const std::vector<std::string>& edit : {std::vector<std::string>{"bend", "--angle", "60"}, {"twist", "--angle", "100"}, {"taper", "--factor", "0.5"}}) {
      std::vector<std::string> arguments = edit;
      arguments.insert(arguments.end(), {"bar.ply", "-o", "out.ply", "--save-scene", "scene.json"});
      ASSERT_EQ(call(arguments, method).code, 0);
      const std::string once = readFile(folder / "out.ply");
      fs::remove(folder / "out.ply");
      const Result again = run(folder.path(), {"run", "scene.json"});
      ASSERT_EQ(again.code, 0) << again.err;
      EXPECT_EQ(readFile(folder / "out.ply"), once);
    }
  }
}

TEST_F(Methods, OptionsThatMeanNothingAreRefusedAndBothAreNamed) {
  const std::vector<std::pair<std::string, std::vector<std::string>>> mistakes{
      {"barr", {"--track", "mls"}},      {"lbs", {"--no-corrector"}},    {"rbf", {"--falloff", "0.5"}},
      {"lattice", {"--sharpness", "3"}}, {"wires", {"--nodes", "4,4,4"}}, {"gffd", {"--nodes", "4,4,4"}},
      {"axial", {"--wire-blend", "2"}},  {"dqs", {"--allow-residual", "1"}}, {"rbf", {"--resample-like", "paper"}},
      {"barr", {"--potential", "gaussian"}}, {"wires", {"--tolerance", "1"}}, {"lbs", {"--substeps", "2"}}};
  for (const auto& [method, option] : mistakes) {
    std::vector<std::string> arguments{"bend", "absent.ply", "--angle", "30", "-o", "out.ply"};
    arguments.insert(arguments.end(), option.begin(), option.end());
    const Result result = call(arguments, method);
    EXPECT_EQ(result.code, 2) << method << option[0];
    EXPECT_NE(result.err.find(option[0]), std::string::npos) << result.err;
    EXPECT_NE(result.err.find("--method " + method), std::string::npos) << result.err;
  }
  EXPECT_EQ(call({"bend", "bar.ply", "--angle", "30", "-o", "out.ply"}, "magic").code, 2);
  EXPECT_EQ(call({"bend", "bar.ply", "--angle", "30", "-o", "out.ply", "--nodes", "1,4,4"}, "lattice").code, 2);
  EXPECT_EQ(call({"bend", "bar.ply", "--angle", "30", "-o", "out.ply", "--wire-blend", "-1"}, "wires").code, 2);
}

TEST_F(Methods, WhatAMethodCannotFollowIsSaid) {
  const std::string fewer = R"({"format": "fielddeform-skeleton", "version": 1, "primitives": [
    {"name": "spine", "type": "polyline", "radius": 1, "points": [[0, 0, 0], [0, 0, 4]]}]})";
  writeFile(folder / "fewer.json", fewer);
  writeFile(folder / "points.json", R"({"format": "fielddeform-skeleton", "version": 1, "primitives": [
    {"name": "p", "type": "points", "radius": 1, "points": [[0, 0, 0], [0, 0, 4]]}]})");
  for (const std::string& method : words()) {
    if (method == "gffd") continue;
    const Result replaced = call({"deform", "bar.ply", "--rest", "rest.json", "--posed", "fewer.json", "-o", "out.ply"}, method);
    EXPECT_EQ(replaced.code, 1) << method;
    EXPECT_NE(replaced.err.find("'" + method + "': primitive 'spine' was replaced"), std::string::npos) << replaced.err;
  }
  for (const std::string method : {"axial", "wires", "casteljau"}) {
    const Result result = call({"deform", "bar.ply", "--rest", "points.json", "--posed", "points.json", "-o", "out.ply"}, method);
    EXPECT_EQ(result.code, 1) << method;
    EXPECT_NE(result.err.find("expected a line"), std::string::npos) << result.err;
  }
}

TEST_F(Methods, BarrNamesWhatItFound) {
  ASSERT_EQ(call({"twist", "bar.ply", "--angle", "90", "-o", "out.ply", "--report", "out.json"}, "barr").code, 0);
  EXPECT_EQ(report("out.json").root().require("fit").require("found").string(), "twist");
  // From the two poses alone.
  ASSERT_EQ(run(folder.path(), {"twist", "bar.ply", "--rest", "rest.json", "--angle", "90", "-o", "x.ply", "--save-scene", "s.json"}).code, 0);
  std::string posed = kRest;
  const std::string points = "\"points\"";
  posed.insert(posed.find(points), "\"roll_deg\": [0, 22.5, 45, 67.5, 90], ");
  writeFile(folder / "posed.json", posed);
  ASSERT_EQ(call({"deform", "bar.ply", "--rest", "rest.json", "--posed", "posed.json", "-o", "out.ply", "--report", "out.json"}, "barr").code, 0);
  const std::string found = report("out.json").root().require("fit").require("found").string();
  EXPECT_TRUE(found.starts_with("twist by ") && found.find("90") != std::string::npos) << found;
}

TEST_F(Methods, AZoneOfInfluenceEndsWhereTheRadiusDoes) {
  // A short line at one end of the bar: the other end stays, and between them nothing tears.
  const std::string rest = R"({"format": "fielddeform-skeleton", "version": 1, "primitives": [
    {"name": "tip", "type": "polyline", "radius": 1, "points": [[0.125, 0.125, 3.5], [0.125, 0.125, 4]]}]})";
  std::string posed = rest;
  for (std::size_t at = 0; (at = posed.find("[0.125, ", at)) != std::string::npos; at += 8) posed.replace(at, 8, "[0.625, ");
  writeFile(folder / "tip.json", rest);
  writeFile(folder / "moved.json", posed);
  // Half a unit dies out within half the radius, by a smoothstep: a slope of 1.5, an edge of sqrt(1 + 1.5^2) = 1.80 at most.
  for (const std::string method : {"gffd", "axial", "lbs", "dqs", "wires"}) {
    ASSERT_EQ(call({"deform", "bar.ply", "--rest", "tip.json", "--posed", "moved.json", "-o", "out.ply", "--report", "out.json"}, method).code, 0);
    const JsonDocument document = report("out.json");
    EXPECT_GT(count(document.root().require("status"), "fixed"), 40u) << method;
    EXPECT_LT(document.root().require("stretch").require("max").number(), 1.85) << method;
  }
}

const fs::path kMeshes[] = {"spot.obj", "rocker-arm.obj"};

TEST(MethodsReal, EveryMethodOnTwoMeshes) {
  const char* meshes = std::getenv("FIELDDEFORM_TEST_MESHES");
  if (!meshes) GTEST_SKIP() << "FIELDDEFORM_TEST_MESHES is not set";
  const Scratch folder;
  for (const fs::path& name : kMeshes) {
    const fs::path mesh = fs::path(meshes) / name;
    ASSERT_TRUE(fs::exists(mesh)) << mesh;
    const JsonDocument info = JsonDocument::parse(run(folder.path(), {"info", "--json", mesh.string()}).out, mesh);
    for (const std::string& method : words())
      for (const std::vector<std::string>& edit : {std::vector<std::string>{"bend", "--angle", "60"}, {"twist", "--angle", "90"}}) {
        SCOPED_TRACE(name.string() + " " + method + " " + edit[0]);
        std::vector<std::string> arguments = edit;
        arguments.insert(arguments.end(), {mesh.string(), "-o", "out.ply", "--report", "out.json", "--method", method});
        const Result result = run(folder.path(), arguments);
        ASSERT_EQ(result.code, 0) << result.err;
        const JsonDocument report = JsonDocument::read(folder / "out.json");
        expectSound(report, method);
        EXPECT_EQ(count(report.root(), "vertices"), count(info.root(), "vertices"));
        EXPECT_EQ(count(report.root(), "faces"), count(info.root(), "faces"));
        const JsonDocument after = JsonDocument::parse(run(folder.path(), {"info", "--json", "out.ply"}).out, "out.ply");
        EXPECT_EQ(count(after.root(), "vertices"), count(info.root(), "vertices"));
      }
  }
}

struct RealMesh {
  fs::path path;
  std::uint64_t vertices = 0, faces = 0;
  std::array<double, 3> low{}, high{};
  double volume = 0;
};

RealMesh measured(const fs::path& mesh, const Scratch& folder) {
  const JsonDocument info = JsonDocument::parse(run(folder.path(), {"info", "--json", mesh.string()}).out, mesh);
  RealMesh out{mesh, count(info.root(), "vertices"), count(info.root(), "faces"), {}, {}, 0};
  const Vec3 low = info.root().require("bounds").require("min").vec3(), high = info.root().require("bounds").require("max").vec3();
  for (std::size_t k = 0; k < 3; ++k) out.low[k] = low[static_cast<Eigen::Index>(k)], out.high[k] = high[static_cast<Eigen::Index>(k)];
  if (const auto volume = info.root().find("volume"); volume && !volume->isNull()) out.volume = volume->number();
  return out;
}

void expectNothingLost(const RealMesh& before, const fs::path& after, const Scratch& folder) {
  const RealMesh now = measured(after, folder);
  EXPECT_EQ(now.vertices, before.vertices);
  EXPECT_EQ(now.faces, before.faces);
}

std::vector<RealMesh> twoRealMeshes(const Scratch& folder) {
  std::vector<RealMesh> out;
  if (const char* meshes = std::getenv("FIELDDEFORM_TEST_MESHES"))
    for (const fs::path& name : kMeshes) out.push_back(measured(fs::path(meshes) / name, folder));
  return out;
}

// Barr's twist keeps the volume of space; what is left is the surface's triangles cutting corners: 0.06 % of the rocker arm.
TEST(MethodsReal, BarrsTwistKeepsTheVolumeOfTwoMeshes) {
  const Scratch folder;
  const auto meshes = twoRealMeshes(folder);
  if (meshes.empty()) GTEST_SKIP() << "FIELDDEFORM_TEST_MESHES is not set";
  for (const RealMesh& mesh : meshes) {
    ASSERT_EQ(run(folder.path(), {"twist", mesh.path.string(), "--angle", "90", "--method", "barr", "-o", "out.ply", "--precision", "double"}).code, 0);
    const RealMesh after = measured("out.ply", folder);
    ASSERT_GT(mesh.volume, 0);
    EXPECT_NEAR(after.volume / mesh.volume, 1, 2e-3) << mesh.path;
  }
}

// Along a straight curve nothing moves; along an arc nothing is lost, and nothing folds: its centre is far from the mesh.
TEST(MethodsReal, DeCasteljausCurveCarriesTwoMeshes) {
  const Scratch folder;
  const auto meshes = twoRealMeshes(folder);
  if (meshes.empty()) GTEST_SKIP() << "FIELDDEFORM_TEST_MESHES is not set";
  for (const RealMesh& mesh : meshes) {
    SCOPED_TRACE(mesh.path.string());
    const Result same = run(folder.path(), {"casteljau", mesh.path.string(), "--straight", "3", "--save-curve", "curve.json", "-o", "same.obj", "--normals", "keep"});
    ASSERT_EQ(same.code, 0) << same.err;
    EXPECT_NE(same.out.find(" 0 vertices moved"), std::string::npos) << same.out;
    // The straight cubic of the frame, its last point moved across by a third of its length.
    const JsonDocument curve = JsonDocument::read(folder / "curve.json");
    const auto vec = [](const Vec3& v) { return fmt::format("[{}, {}, {}]", v.x(), v.y(), v.z()); };
    const JsonValue frame = curve.root().require("frame");
    const Vec3 origin = frame.require("origin").vec3();
    std::vector<Vec3> edge;
    for (const JsonValue e : frame.require("edges").array(3)) edge.push_back(e.vec3());
    const double length = edge[0].norm();
    std::string points;
    for (int k = 0; k < 4; ++k) {
      const Vec3 p = origin + k / 3.0 * edge[0] + (k == 3 ? length / 3 : 0) * edge[1].normalized();
      points += (k ? ", " : "") + vec(p);
    }
    writeFile(folder / "bent.json", fmt::format(R"({{"format": "fielddeform-casteljau", "version": 1, "frame": {{"origin": {}, "edges": [{}, {}, {}]}},
      "pieces": [{{"points": [{}], "s": {}, "t": {}}}]}})", vec(origin), vec(edge[0]), vec(edge[1]), vec(edge[2]), points, vec(edge[1]), vec(edge[2])));
    const Result bent = run(folder.path(), {"casteljau", mesh.path.string(), "--curve", "bent.json", "-o", "out.ply", "--report", "out.json"});
    ASSERT_EQ(bent.code, 0) << bent.err;
    const JsonDocument report = JsonDocument::read(folder / "out.json");
    EXPECT_EQ(count(report.root(), "folds"), 0u);
    EXPECT_EQ(count(report.root().require("status"), "invalid"), 0u);
    EXPECT_EQ(count(report.root().require("status"), "stalled"), 0u);
    expectNothingLost(mesh, "out.ply", folder);
  }
}

// Ridden in a solid that grows by a fifth: at rest every vertex comes back, and the mesh grows with its cell.
TEST(MethodsReal, ASolidCarriesTwoMeshes) {
  const Scratch folder;
  const auto meshes = twoRealMeshes(folder);
  if (meshes.empty()) GTEST_SKIP() << "FIELDDEFORM_TEST_MESHES is not set";
  for (const RealMesh& mesh : meshes) {
    SCOPED_TRACE(mesh.path.string());
    Vec3 low(mesh.low[0], mesh.low[1], mesh.low[2]), size(mesh.high[0], mesh.high[1], mesh.high[2]);
    size -= low;
    low -= 0.02 * size;
    size *= 1.04;
    writeFile(folder / "cell.json", fmt::format(R"({{"format": "fielddeform-solids", "version": 1, "solids": [{{"name": "cell", "degree": [2, 2, 2],
      "box": {{"origin": [{}, {}, {}], "edges": [[{}, 0, 0], [0, {}, 0], [0, 0, {}]]}}}}]}})", low.x(), low.y(), low.z(), size.x(), size.y(), size.z()));
    const Result grown = run(folder.path(), {"solid", "cell.json", "--volume", "cell=x1.2", "--fix-side", "cell.w0", "--embed", mesh.path.string(),
                                             "--precision", "double", "--check", "--report", "out.json", "-o", "out.ply"});
    ASSERT_EQ(grown.code, 0) << grown.err;
    expectNothingLost(mesh, "out.ply", folder);
    const RealMesh after = measured("out.ply", folder);
    EXPECT_GT(after.volume / mesh.volume, 1.05);
    EXPECT_LT(after.volume / mesh.volume, 1.6);
    const Result kept = run(folder.path(), {"solid", "cell.json", "--embed", mesh.path.string(), "--precision", "double", "-o", "kept.ply"});
    ASSERT_EQ(kept.code, 0) << kept.err;
    EXPECT_NEAR(measured("kept.ply", folder).volume / mesh.volume, 1, 1e-9);
  }
}

}  // namespace
}  // namespace fielddeform::cli_test
