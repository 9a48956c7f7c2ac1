#include <fielddeform/core/parallel.h>
#include <fielddeform/map/extended_lattice_io.h>
#include <fielddeform/mesh/io.h>
#include <fielddeform/mesh/quality.h>
#include <fielddeform/scene/run.h>
#include <fielddeform/skeleton/io.h>
#include <fielddeform/solid/regularity.h>
#include <fielddeform/solid/solid_io.h>
#include <fielddeform/solid/tessellate.h>
#include <gtest/gtest.h>
#include <samples/generate/figures.h>
#include <samples/generate/hirota.h>
#include <samples/generate/hsu.h>
#include <samples/generate/isosurface.h>
#include <samples/generate/rappoport.h>
#include <samples/generate/samples.h>
#include <samples/generate/shapes.h>

#include <cmath>
#include <map>
#include <numbers>
#include <set>

namespace fielddeform::samples {
namespace {

/// Every directed edge once, its opposite too; every vertex's faces in one fan.
void expectClosedManifold(const mesh::Mesh& m) {
  std::map<std::pair<Index, Index>, Index> next;  // round a vertex: the face's next edge
  std::vector<Index> faces(m.vertexCount(), 0), start(m.vertexCount(), kNoIndex);
  for (std::size_t f = 0; f < m.faceCount(); ++f) {
    const auto c = m.face(f);
    for (std::size_t k = 0; k < c.size(); ++k) {
      const Index before = c[(k + c.size() - 1) % c.size()], after = c[(k + 1) % c.size()];
      ASSERT_TRUE(next.emplace(std::pair(c[k], after), before).second) << "edge " << c[k] << " " << after;
      ++faces[c[k]], start[c[k]] = after;
    }
  }
  for (Index v = 0; v < m.vertexCount(); ++v) {
    ASSERT_NE(start[v], kNoIndex) << "isolated vertex " << v;
    Index at = start[v], turned = 0;
    do {
      const auto step = next.find({v, at});
      ASSERT_NE(step, next.end()) << "border at " << v << " " << at;
      at = step->second, ++turned;
    } while (at != start[v] && turned <= faces[v]);
    ASSERT_EQ(turned, faces[v]) << "vertex " << v << " joins several fans";
  }
}

double volume(const mesh::Mesh& m) {
  double sum = 0;
  for (std::size_t f = 0; f < m.faceCount(); ++f) {
    m.forEachTriangle(
        f, [&](Index a, Index b, Index c) { sum += m.positions()[a].dot(m.positions()[b].cross(m.positions()[c])); });
  }
  return sum / 6;
}

TEST(Isosurface, OfABallLiesOnItAndIsClosed) {
  const mesh::Mesh ball =
      isosurface(Box(Vec3(-1.2, -1.2, -1.2), Vec3(1.2, 1.2, 1.2)), 0.1, [](const Vec3& p) { return p.norm() - 1; });
  expectClosedManifold(ball);
  for (const Vec3& p : ball.positions()) EXPECT_NEAR(p.norm(), 1, 1e-4);  // two Newton steps from within a cell
  // Chords of 0.1 lie up to 0.1^2 / 8 inside; each cuts a share of the volume.
  EXPECT_NEAR(volume(ball), 4 * std::numbers::pi / 3, 0.01 * volume(ball));
}

TEST(Isosurface, IsAManifoldWhereSheetsTouch) {
  // Two balls in one point, walls thinner than the grid, and noise-like waves.
  const std::vector<Implicit> functions{
      [](const Vec3& p) { return std::min((p - Vec3(0.5, 0, 0)).norm(), (p + Vec3(0.5, 0, 0)).norm()) - 0.5; },
      [](const Vec3& p) { return std::max(std::abs(p.norm() - 0.8) - 0.02, p.norm() - 0.9); },
      [](const Vec3& p) {
        return std::max(p.norm() - 0.95, 0.05 * (std::sin(14 * p.x()) + std::sin(14 * p.y()) + std::sin(14 * p.z())));
      }};
  for (const Implicit& f : functions) {
    for (const double spacing : {0.09, 0.13}) {
      expectClosedManifold(isosurface(Box(Vec3(-1.31, -1.31, -1.31), Vec3(1.31, 1.31, 1.31)), spacing, f));
    }
  }
}

TEST(Samples, HirotasShapesAreClosedAndTurnedOutwards) {
  for (const mesh::Mesh& m : {torus(6), club(16), quadruped(.5), pitcher(4)}) {
    expectClosedManifold(m);
    EXPECT_GT(volume(m), 0);
  }
  // Pappus: 2 pi^2 R r^2, less what chords cut off: about (pi / n)^2 * 2/3 a section, and as much round the ring.
  const double exact = 2 * std::numbers::pi * std::numbers::pi * .4 * .4;
  EXPECT_NEAR(volume(torus(16)), exact, .01 * exact);
  EXPECT_LT(volume(torus(16)), exact);
}

TEST(Samples, TeapotHasItsPatches) {
  const mesh::Mesh pot = teapot(4);
  const Box box = mesh::boundingBox(pot.positions());
  EXPECT_NEAR(box.max().y(), 3.15, 1e-12);
  EXPECT_NEAR(box.min().y(), 0, 1e-12);
  EXPECT_NEAR(box.min().x(), -3, 1e-12);
  // Rows run along the profile and around: 4 + 2 profiles and 2 + 2 swept patches, each 4 deep; poles are triangles.
  const std::size_t expected = 4 * 4 * 16 + 2 * 4 * 16 + 2 * (2 * 4 * 8);
  EXPECT_EQ(pot.faceCount(), expected);
  // The spout's mouth, the rim and the ends inside the body are open, as in the original.
  for (const Vec3& p : pot.positions()) EXPECT_TRUE(p.allFinite());
  EXPECT_GT(volume(pot), 0);
}

TEST(Samples, ShapesAreClosedAndPointOutwards) {
  for (const mesh::Mesh& m : {baluster(), bunny(), bunny(0.3), otter(0.3)}) {
    expectClosedManifold(m);
    EXPECT_GT(volume(m), 0);
  }
}

/// The examples of Rappoport et al. 1996, as samples/run solves them.
TEST(Samples, SolidsMeetTheirVolumesAndAreNotTurnedInsideOut) {
  std::vector<solid::SolidFile> files(3, amphora());
  files[0].sizes[0] = {solid::SizeSpec::Kind::Factor, 0.7};
  files[1].sizes[0] = {solid::SizeSpec::Kind::Factor, 1.5};
  files[2] = telephone();
  for (const solid::SolidFile& file : files) {
    Progress silent;
    const solid::Result result = solid::solve(solid::problemOf(file), {}, silent);
    EXPECT_EQ(result.report.outcome, solid::Outcome::Converged) << result.report.message;
    EXPECT_LT(result.report.deviation, 1e-12);
    EXPECT_LT(result.report.rowResidual, 1e-12);
    solid::Object after = file.object;
    after.points = result.points;
    for (std::size_t s = 0; s < after.solids.size(); ++s) EXPECT_EQ(solid::checkRegular(after, s).orientation, solid::Orientation::Positive);
    expectClosedManifold(solid::tessellate(after, 6));
  }
}

/// Coquillart's cylindrical lattice: one block, no face turned over, nothing moved outside the cells.
TEST(Samples, TheExtendedLatticeRaisesAFlowerWithoutFolds) {
  const map::ExtendedLattice lattice = map::readExtendedLattice(std::filesystem::path(FIELDDEFORM_SAMPLES_DIR) / "extended-flower/lattice.json");
  EXPECT_FALSE(map::jointsOf(lattice).empty());
  const map::ExtendedLatticeMap map(lattice);
  const mesh::Mesh rest = block(30);
  std::vector<Vec3> posed(rest.vertexCount());
  Progress silent;
  map.apply(*map.bind(rest.positions()), {.position = posed, .safe = {}, .status = {}, .residual = {}}, silent);
  double highest = 0;
  for (std::size_t v = 0; v < posed.size(); ++v) {
    const Vec3& p = rest.positions()[v];
    if (std::hypot(p.x(), p.z()) > 0.99 || std::hypot(p.x(), p.z()) < 0.05) {
      EXPECT_EQ(posed[v], p);
    }
    highest = std::max(highest, posed[v].y());
  }
  EXPECT_GT(highest, 0.6);
  EXPECT_EQ(mesh::countFolds(rest, rest.positions(), posed), 0u);
}

TEST(Samples, DoNotDependOnTheNumberOfThreads) {
  std::vector<std::string> bytes;
  for (const int threads : {1, 7}) {
    const ThreadLimit limit(threads);
    bytes.push_back(mesh::meshBytes(otter(0.25), mesh::Format::Ply));
  }
  EXPECT_EQ(bytes[0], bytes[1]);
}

TEST(SamplesSlow, TheRabbitsSkeletonStandsOnItsVertices) {
  const mesh::Mesh m = bunny();
  const auto less = [](const Vec3& a, const Vec3& b) { return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end()); };
  const std::set<Vec3, decltype(less)> vertices(m.positions().begin(), m.positions().end(), less);
  const auto folder = std::filesystem::temp_directory_path() / "fielddeform_samples_lod";
  std::filesystem::create_directories(folder);
  for (const Sample& sample : samples())
    if (sample.name == "bunny-lod") sample.write(folder / sample.file);
  const skeleton::Skeleton lod = skeleton::readSkeleton(folder / "bunny-lod.json");
  ASSERT_EQ(lod.primitives.size(), 1u);
  EXPECT_TRUE(lod.primitives[0].closed);
  EXPECT_LE(lod.primitives[0].faces.size(), 2800u);
  for (const Vec3& p : lod.primitives[0].points) EXPECT_TRUE(vertices.contains(p)) << p.transpose();
  std::filesystem::remove_all(folder);
}

TEST(SamplesSlow, OtterIsLikeAScan) {
  const mesh::Mesh m = otter();
  EXPECT_GE(m.vertexCount(), 100000u);
  EXPECT_EQ(m.positionType(), mesh::ScalarType::Float32);
  const mesh::Attribute* color = m.find(mesh::Element::Vertex, "color");
  ASSERT_NE(color, nullptr);
  EXPECT_EQ(color->type(), mesh::ScalarType::UInt8);
  EXPECT_EQ(color->valueCount(), m.vertexCount());
  expectClosedManifold(m);
}

/// The scenes of the sample folders, without their pictures.
TEST(SamplesSlow, ScenesFollowTheirSkeletonsWithoutFolds) {
  const auto folder = std::filesystem::temp_directory_path() / "fielddeform_samples_scenes";
  std::filesystem::create_directories(folder / "shapes");
  for (const Sample& sample : samples()) {
    if (sample.name != "otter") sample.write(folder / "shapes" / sample.file);
  }
  int scenes = 0;
  for (const auto& entry : std::filesystem::directory_iterator(FIELDDEFORM_SAMPLES_DIR)) {
    // The figures of Qin et al. that deform a mesh; those of Hsu et al. are run by hsu_test.cpp.
    const std::string name = entry.path().filename().string();
    if (!name.starts_with("figure") || name.starts_with("figures01-04")) continue;
    const auto copy = folder / entry.path().filename();
    std::filesystem::create_directories(copy);
    std::filesystem::copy_file(entry.path() / "scene.json", copy / "scene.json",
                               std::filesystem::copy_options::overwrite_existing);
    scene::Scene scene = scene::readScene(copy / "scene.json");
    scene.output.picture.reset();
    scene.check = scene::Check{};  // no folds, no flipped faces
    Progress progress;
    const scene::RunResult result = scene::run(scene, {}, progress);
    EXPECT_TRUE(result.broken.empty()) << entry.path();
    EXPECT_TRUE(std::filesystem::exists(scene.output.mesh)) << entry.path();
    ++scenes;
  }
  EXPECT_EQ(scenes, 5);
  std::filesystem::remove_all(folder);
}

TEST(SamplesSlow, AllReadBack) {
  const auto folder = std::filesystem::temp_directory_path() / "fielddeform_samples_test";
  std::filesystem::create_directories(folder);
  std::set<std::string> names;
  for (const Sample& sample : samples()) {
    EXPECT_TRUE(names.insert(sample.name).second);
    const auto file = folder / sample.file;
    sample.write(file);
    if (sample.name == "amphora" || sample.name == "telephone")
      EXPECT_GT(solid::readSolids(file).object.solids.size(), 0u) << sample.name;
    else if (file.extension() == ".json")
      EXPECT_NO_THROW(skeleton::readSkeleton(file)) << sample.name;
    else
      EXPECT_GT(mesh::readMesh(file).faceCount(), 0u) << sample.name;
  }
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace fielddeform::samples
