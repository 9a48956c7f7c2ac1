#include <fielddeform/map/press_tool.h>
#include <fielddeform/mesh/io.h>
#include <fielddeform/scene/run.h>
#include <gtest/gtest.h>
#include <samples/generate/hsu.h>
#include <samples/generate/samples.h>

#include <cmath>

/// What the samples of Hsu, Hughes & Kaufman 1992 claim.
namespace fielddeform::samples {
namespace {

struct Outcome {
  scene::RunResult result;
  std::vector<Vec3> rest, posed;
};

Outcome runSample(const std::string& name) {
  const auto folder = std::filesystem::temp_directory_path() / ("fielddeform_hsu_" + name);
  std::filesystem::create_directories(folder / "shapes");
  std::filesystem::create_directories(folder / name);
  for (const char* shape : {"block", "ball", "ball-tool", "egg", "ring", "stone"})
    for (const Sample& sample : samples())
      if (sample.name == shape) sample.write(folder / "shapes" / sample.file);
  std::filesystem::copy_file(std::filesystem::path(FIELDDEFORM_SAMPLES_DIR) / name / "scene.json", folder / name / "scene.json",
                             std::filesystem::copy_options::overwrite_existing);
  scene::Scene scene = scene::readScene(folder / name / "scene.json");
  scene.output.picture.reset();
  scene.check = scene::Check{};
  Progress progress;
  Outcome run;
  run.result = scene::run(scene, {}, progress);
  run.rest = mesh::readMesh(scene.inputs[0]).positions();
  run.posed = mesh::readMesh(scene.output.mesh).positions();
  EXPECT_TRUE(run.result.broken.empty()) << name << ": " << (run.result.broken.empty() ? "" : run.result.broken[0]);
  std::filesystem::remove_all(folder);
  return run;
}

TEST(HsuSamplesSlow, TheFlatTopIsFlatOverItsWholePatch) {
  const Outcome run = runSample("hsu-flat-top");
  EXPECT_EQ(run.result.report.moves.at(0).solve.unmet, 0u);
  int patch = 0;
  double deviation = 0, tallest = 0;
  for (std::size_t v = 0; v < run.rest.size(); ++v) {
    const Vec3& p = run.rest[v];
    tallest = std::max(tallest, run.posed[v].y());
    if (p.y() < 0.399 || std::abs(p.x()) > 0.36 || std::abs(p.z()) > 0.36) continue;
    ++patch;
    deviation = std::max(deviation, std::abs(run.posed[v].y() - 0.65));
  }
  EXPECT_GT(patch, 400);
  EXPECT_LE(deviation, 1e-9);
  RecordProperty("deviation", std::to_string(1e12 * deviation) + "e-12");
  // Figure 1a: nodes moved into a plane give a dome.
  map::Lattice flat = std::get<map::Lattice>(run.result.resolved.lattices.at(0).source);
  const std::vector<Vec3> nodes = flat.restNodes();
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const bool above = std::abs(nodes[i].x()) <= 0.36 && std::abs(nodes[i].z()) <= 0.36 && nodes[i].y() > 0.3;
    flat.displacements[i] = above ? Vec3(0, 0.25, 0) : Vec3(Vec3::Zero());
  }
  const map::LatticeMap dome(flat);
  const double middle = dome.position(Vec3(0, 0.4, 0)).y(), edge = dome.position(Vec3(0.35, 0.4, 0)).y();
  EXPECT_GT(middle - edge, 0.05);
}

TEST(HsuSamplesSlow, ThreeConstraintsAreMetAndAFinerLatticeReachesLess) {
  const Outcome coarse = runSample("hsu-three-coarse"), fine = runSample("hsu-three-fine");
  std::size_t moved[2] = {0, 0};
  int k = 0;
  for (const Outcome* run : {&coarse, &fine}) {
    EXPECT_EQ(run->result.report.moves.at(0).solve.met, 3u);
    for (std::size_t v = 0; v < run->rest.size(); ++v) moved[k] += (run->posed[v] - run->rest[v]).norm() > 0.01;
    ++k;
  }
  EXPECT_LT(2 * moved[1], moved[0]);
}

TEST(HsuSamplesSlow, TheLatticeRefinesItselfForTheWaves) {
  const Outcome run = runSample("hsu-refined");
  const map::MoveReport& waves = run.result.report.moves.at(1);
  EXPECT_EQ(waves.solve.met, 17u);
  EXPECT_GT(waves.refinements, 0);
}

TEST(HsuSamplesSlow, NothingIsBeyondThePlanes) {
  const Outcome run = runSample("hsu-press-plane");
  double highest = -9, lowest = 9;
  for (const Vec3& p : run.posed) highest = std::max(highest, p.y()), lowest = std::min(lowest, p.y());
  EXPECT_LE(highest, 0.72 + 1e-5);  // 1e-6 of the lattice's size
  EXPECT_GE(lowest, -0.8 - 1e-5);
  EXPECT_GT(highest, 0.72 - 1e-3);
}

TEST(HsuSamplesSlow, NothingOfTheBlockIsInTheBall) {
  const Outcome run = runSample("hsu-press-ball");
  const map::PressTool tool = map::PressTool::solid(ball(Vec3(0, 0.75, 0), 0.55, 64));
  double deepest = 0;
  for (const Vec3& p : run.posed) deepest = std::max(deepest, tool.contact(p).depth);
  EXPECT_LE(deepest, 1e-5);
  EXPECT_GT(run.result.report.moves.at(0).deepestBefore, 0.15);
}

TEST(HsuSamplesSlow, TheProngsTouchTheStoneAndDoNotEnterIt) {
  const Outcome run = runSample("hsu-ring");
  const mesh::Mesh gem = stone();
  const map::PressTool tool = map::PressTool::solid(gem);
  double deepest = 0;
  for (const Vec3& p : run.posed) deepest = std::max(deepest, tool.contact(p).depth);
  EXPECT_LE(deepest, 1e-5);
  // Touch: grown by 1 % about its middle, the stone holds points of all six prongs.
  mesh::Mesh grown = gem;
  for (Vec3& p : grown.mutablePositions()) p = Vec3(0, 1.4, 0) + 1.02 * (p - Vec3(0, 1.4, 0));
  const map::PressTool near = map::PressTool::solid(grown);
  bool touches[6] = {};
  for (std::size_t v = 0; v < run.rest.size(); ++v) {
    if (!(near.contact(run.posed[v]).depth > 0)) continue;
    const double turn = std::atan2(run.rest[v].z(), run.rest[v].x()) / (std::acos(-1.0) / 3);
    touches[(static_cast<int>(std::floor(turn)) + 6) % 6] = true;
  }
  for (const bool t : touches) EXPECT_TRUE(t);
}

TEST(HsuSamplesSlow, TheBustTakesEveryMove) {
  const Outcome run = runSample("hsu-bust");
  EXPECT_EQ(run.result.report.moves.size(), 17u);
  for (const map::MoveReport& move : run.result.report.moves) EXPECT_GT(move.vertices, 10u) << move.kind;
  double lowest = 9;
  for (const Vec3& p : run.posed) lowest = std::min(lowest, p.y());
  EXPECT_NEAR(lowest, -1.08, 0.01);  // later moves reach its edge a little
}

}  // namespace
}  // namespace fielddeform::samples
