// The samples that show every method by one skeleton: each runs, and only its method differs.
#include <fielddeform/core/error.h>
#include <fielddeform/mesh/io.h>
#include <fielddeform/scene/run.h>
#include <gtest/gtest.h>
#include <samples/generate/samples.h>

#include <algorithm>
#include <filesystem>

namespace fielddeform::samples {
namespace {

namespace fs = std::filesystem;

void runEvery(const std::string& name, const std::vector<std::string>& shapes) {
  const fs::path folder = fs::path(::testing::TempDir()) / name;
  fs::create_directories(folder / "shapes");
  fs::create_directories(folder / name);
  for (const Sample& sample : samples())
    if (std::find(shapes.begin(), shapes.end(), sample.name) != shapes.end()) sample.write(folder / "shapes" / sample.file);
  fs::copy_file(fs::path(FIELDDEFORM_SAMPLES_DIR) / name / "scene.json", folder / name / "scene.json", fs::copy_options::overwrite_existing);
  scene::Scene scene = scene::readScene(folder / name / "scene.json");
  const std::size_t vertices = mesh::readMesh(scene.inputs[0]).vertexCount();
  for (const scene::MethodInfo& info : scene::methods()) {
    scene.method = info.kind;
    Progress progress;
    const scene::RunResult result = scene::run(scene, {}, progress);
    EXPECT_EQ(result.report.method, info.word);
    EXPECT_EQ(result.report.vertices, vertices) << info.word;
    EXPECT_EQ(result.report.status[static_cast<std::size_t>(Status::Invalid)], 0u) << info.word;
    const mesh::Mesh written = mesh::readMesh(scene.output.mesh);
    for (const Vec3& p : written.positions()) ASSERT_TRUE(p.allFinite()) << info.word;
  }
  fs::remove_all(folder);
}

TEST(MethodSamplesSlow, TheBaluster) { runEvery("methods-baluster", {"baluster", "baluster-spine"}); }
TEST(MethodSamplesSlow, TheTeapot) { runEvery("methods-teapot", {"teapot", "teapot-skeleton"}); }

}  // namespace
}  // namespace fielddeform::samples
