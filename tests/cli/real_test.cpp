// Every real mesh through the three usual edits, with resampling: nothing is lost, the counts add up.
#include <fielddeform/core/json_reader.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "program.h"

namespace fielddeform::cli_test {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> realMeshes() {
  std::vector<fs::path> meshes;
  const char* folder = std::getenv("FIELDDEFORM_TEST_MESHES");
  if (!folder) return meshes;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string extension = entry.path().extension().string();
    if (extension == ".ply" || extension == ".obj" || extension == ".stl" || extension == ".off") meshes.push_back(entry.path());
  }
  std::sort(meshes.begin(), meshes.end());
  return meshes;
}

std::uint64_t count(const JsonValue& root, std::string_view key) { return root.require(key).integer(0, 1ull << 40); }

void expectNothingLost(const fs::path& before, const fs::path& after, const JsonValue& report, const Scratch& folder) {
  const JsonDocument one = JsonDocument::parse(run(folder.path(), {"info", "--json", before.string()}).out, before);
  const JsonDocument two = JsonDocument::parse(run(folder.path(), {"info", "--json", after.string()}).out, after);
  const JsonValue a = one.root(), b = two.root();
  const std::uint64_t inserted = count(report, "inserted_vertices");
  EXPECT_EQ(count(b, "vertices"), count(a, "vertices") + inserted);
  EXPECT_EQ(count(b, "vertices"), count(report, "vertices"));
  EXPECT_GE(count(b, "faces"), count(a, "faces"));
  EXPECT_TRUE(inserted > 0 || count(b, "faces") == count(a, "faces"));
  EXPECT_EQ(a.require("format").string(), b.require("format").string());
  EXPECT_EQ(a.require("encoding").string(), b.require("encoding").string());
  EXPECT_EQ(count(b, "boundary_loops"), count(a, "boundary_loops"));
  EXPECT_EQ(b.require("components").size(), a.require("components").size());
  ASSERT_EQ(b.require("attributes").size(), a.require("attributes").size());
  auto x = a.require("attributes").array().begin(), y = b.require("attributes").array().begin();
  for (std::size_t i = 0; i < a.require("attributes").size(); ++i, ++x, ++y) {
    EXPECT_EQ((*x).require("name").string(), (*y).require("name").string());
    EXPECT_EQ((*x).require("type").string(), (*y).require("type").string());
  }
  std::uint64_t sum = 0;
  for (const JsonValue n : report.require("status").members()) sum += n.integer(0, 1ull << 40);
  EXPECT_EQ(sum, count(report, "vertices"));
}

void runOnAll(const std::vector<std::string>& edit, std::uint64_t allowedFolds) {
  const auto meshes = realMeshes();
  if (meshes.empty()) GTEST_SKIP() << "FIELDDEFORM_TEST_MESHES is not set, or holds no meshes";
  const Scratch folder;
  for (const fs::path& mesh : meshes) {
    SCOPED_TRACE(mesh.filename().string());
    std::vector<std::string> arguments = edit;
    arguments.insert(arguments.end(), {mesh.string(), "-o", "out/", "--resample", "--report", "report/"});
    const Result result = run(folder.path(), arguments);
    ASSERT_EQ(result.code, 0) << result.err;
    fs::path reportFile = folder.path() / "report" / mesh.stem();
    const JsonDocument report = JsonDocument::read(reportFile += ".json");
    expectNothingLost(mesh, folder.path() / "out" / mesh.filename(), report.root(), folder);
    const std::uint64_t folds = count(report.root().require("folds"), "after");
    EXPECT_LE(folds, allowedFolds) << result.err;
  }
}

// Legs far from the spine cross one another in a twist by half a turn, and a coarse mesh folds there: measured 4 folded
// edges on one mesh, none on the others.
TEST(CommandsReal, Bend) { runOnAll({"bend", "--angle", "90"}, 0); }
TEST(CommandsReal, Twist) { runOnAll({"twist", "--angle", "180"}, 10); }
TEST(CommandsReal, Stretch) { runOnAll({"stretch", "--factor", "2"}, 0); }

}  // namespace
}  // namespace fielddeform::cli_test
