#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/field/detail/polygonise.h>
#include <fielddeform/field/detail/vdb_grid.h>
#include <fielddeform/field/vdb.h>
#include <fielddeform/mesh/measures.h>
#include <fielddeform/mesh/topology.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <numbers>
#include <set>

#include "skeletons.h"

namespace fielddeform::field {
namespace {

using skeleton::Primitive;
using skeleton::Skeleton;
constexpr double kPi = std::numbers::pi;

Skeleton of(std::vector<Primitive> primitives) {
  Skeleton s;
  s.primitives = std::move(primitives);
  return s;
}

void expectClosedManifold(const mesh::Mesh& m) {
  const mesh::EdgeTable table(m);
  const mesh::EdgeCounts edges = mesh::countEdges(table);
  EXPECT_TRUE(edges.closed() && edges.oriented());
  EXPECT_EQ(edges.nonManifold, 0u);
  EXPECT_TRUE(mesh::nonManifoldVertices(m, table).empty());
}

mesh::Mesh surfaceOf(const Field& field, double value, std::optional<double> voxel = {}) {
  Progress silent;
  return isosurface(field, value, {.voxel = voxel}, silent);
}

TEST(FieldIsosurface, OfAPointIsASphereOfSecondOrder) {
  const Field field(of({pointSet("p", {{0.3, 0.1, 0}}, 1)}));
  double last = 0;
  for (const double voxel : {0.1, 0.05}) {
    const mesh::Mesh m = surfaceOf(field, 0.5, voxel);
    expectClosedManifold(m);
    for (const Vec3& p : m.positions()) EXPECT_NEAR((p - Vec3(0.3, 0.1, 0)).norm(), 0.5, 1.1e-3 * voxel * std::sqrt(3.0));
    const double lack = 1 - *mesh::volume(m, m.positions()).value / (4 * kPi / 3 * 0.125);
    EXPECT_GT(lack, 0);  // chords
    if (last > 0) {
      EXPECT_NEAR(last / lack, 4, 0.5);
    }
    last = lack;
  }
}

TEST(FieldIsosurface, OfASegmentIsACapsuleAndOfACubeARoundedCube) {
  const mesh::Mesh capsule = surfaceOf(Field(of({polyline("l", {{0, 0, -0.5}, {0, 0, 0.5}}, 1)})), 0.3, 0.04);
  expectClosedManifold(capsule);
  const double volume = kPi * 0.09 + 4 * kPi / 3 * 0.027;
  EXPECT_NEAR(*mesh::volume(capsule, capsule.positions()).value, volume, 0.01 * volume);
  const Field cubeField(of({cube("c", 0.5, 0.5)}));
  const mesh::Mesh cubes = surfaceOf(cubeField, 0.2, 0.05), inner = surfaceOf(cubeField, -0.25, 0.05);
  expectClosedManifold(cubes);
  expectClosedManifold(inner);
  // Steiner: V + A r + mean width terms.
  const double rounded = 1 + 6 * 0.2 + 3 * kPi * 0.04 + 4 * kPi / 3 * 0.008;
  EXPECT_NEAR(*mesh::volume(cubes, cubes.positions()).value, rounded, 0.01 * rounded);
  EXPECT_NEAR(*mesh::volume(inner, inner.positions()).value, 0.125, 0.04 * 0.125);  // edges are cut off
}

TEST(FieldIsosurface, BeyondTheRadiusAndAcrossABlendItIsClosedToo) {
  const Field field(of({polyline("l", wavyLine(8), 0.4), pointSet("p", {{0, 0.8, 0.3}}, 0.5), patch("m", 2, 0.3)}));
  for (const double value : {0.05, 0.2, 0.45, 0.8}) {
    const mesh::Mesh m = surfaceOf(field, value);
    expectClosedManifold(m);
    EXPECT_GT(m.faceCount(), 100u);
    const mesh::Attribute* attribute = m.find(mesh::Element::Vertex, "isovalue");
    ASSERT_NE(attribute, nullptr);
    EXPECT_EQ(attribute->get(0), value);
  }
  EXPECT_EQ(surfaceOf(field, -5).faceCount(), 0u);
}

TEST(FieldIsosurface, RefusesTooMuchMemoryAndBadValues) {
  const Field field(of({polyline("l", wavyLine(8), 0.4)}));
  Progress silent;
  EXPECT_THROW(isosurface(field, 0.2, {.voxel = 1e-4, .maxMegabytes = 10}, silent), std::invalid_argument);
  EXPECT_THROW(isosurface(field, std::nan(""), {}, silent), std::invalid_argument);
  EXPECT_THROW(isosurface(field, 0.2, {.voxel = 0.0}, silent), std::invalid_argument);
  silent.cancel();
  EXPECT_THROW(isosurface(field, 0.2, {}, silent), Cancelled);
}

TEST(Polygonise, EverySignPatternOfACellJoinsItsNeighbours) {
  // Noise on 3^3 blocks inside a positive shell: every pattern occurs, and the surface must be closed.
  std::vector<detail::Cell> corners;
  for (int i = -1; i <= 1; ++i)
    for (int j = -1; j <= 1; ++j)
      for (int k = -1; k <= 1; ++k) corners.push_back({8 * i, 8 * j, 8 * k});
  std::vector<float> values(corners.size() * detail::kBlockSize);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const detail::Cell c = detail::pointOf(corners[i / detail::kBlockSize], i % detail::kBlockSize);
    bool inner = true;
    for (const int x : c) inner = inner && x > -8 && x < 15;
    values[i] = inner ? static_cast<float>(uniform01(5, i) - 0.5) : 1.0f;
  }
  const mesh::Mesh m = detail::polygonise(corners, values, 1000, [](const detail::Cell& a, const detail::Cell& b, double va, double vb) -> Vec3 {
    const double t = detail::betweenEnds(va / (va - vb));
    return (1 - t) * Vec3(a[0], a[1], a[2]) + t * Vec3(b[0], b[1], b[2]);
  });
  EXPECT_GT(m.faceCount(), 10000u);
  expectClosedManifold(m);
  EXPECT_GT(*mesh::volume(m, m.positions()).value, 0);
}

class Vdb : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!gridsAvailable()) GTEST_SKIP() << "built without OpenVDB";
    folder_ = std::filesystem::temp_directory_path() /
              (std::string("fielddeform_vdb_") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::filesystem::path folder_;
  Progress silent_;
};

TEST_F(Vdb, AFieldComesBackAsItsSurface) {
  const Skeleton s = of({polyline("l", wavyLine(8), 0.4), pointSet("p", {{0, 0.5, 0.3}}, 0.5)});
  const Field field(s);
  VdbWriteOptions options;
  options.samples.voxel = 0.03;
  options.primitives = true;
  const auto reports = writeVdb(field, s, folder_ / "f.vdb", options, silent_);
  ASSERT_EQ(reports.size(), 3u);
  EXPECT_EQ(reports[0].name, "pseudo_distance");
  EXPECT_EQ(reports[1].name, "distance l");
  EXPECT_GT(reports[0].voxels, 1000u);
  const mesh::Mesh m = readVdbSurface(folder_ / "f.vdb", {.isovalue = 0.25});
  expectClosedManifold(m);
  // Along a cell's diagonal, of length^2 3 h^2, with second derivatives of 1 / d; at kinks the slope of 1 bounds it.
  std::size_t beyond = 0;
  for (const Vec3& p : m.positions()) {
    const double error = std::abs(field.evaluate(p).pseudoDistance - 0.25);
    EXPECT_LT(error, std::sqrt(3.0) / 2 * 0.03);
    beyond += error > 3 * 0.03 * 0.03 / (8 * 0.25);
  }
  EXPECT_LT(beyond, m.vertexCount() / 50);
  const mesh::Mesh point = readVdbSurface(folder_ / "f.vdb", {.grid = "distance p", .isovalue = 0.3});
  for (const Vec3& p : point.positions()) EXPECT_NEAR((p - Vec3(0, 0.5, 0.3)).norm(), 0.3, 3 * 0.03 * 0.03 / (8 * 0.3));  // a cell's diagonal
  EXPECT_THROW(readVdbSurface(folder_ / "f.vdb", {.grid = "other"}), IoError);
  EXPECT_THROW(readVdbSurface(folder_ / "f.vdb", {.isovalue = -1.0}), IoError);
}

TEST_F(Vdb, TheSameFieldIsTheSameFile) {
  const Skeleton s = of({polyline("l", wavyLine(8), 0.4)});
  VdbWriteOptions options;
  options.samples.voxel = 0.05;
  for (const int threads : {1, 4}) {
    const ThreadLimit limit(threads);
    writeVdb(Field(s), s, folder_ / (threads == 1 ? "a.vdb" : "b.vdb"), options, silent_);
  }
  EXPECT_EQ(readTextFile(folder_ / "a.vdb"), readTextFile(folder_ / "b.vdb"));
}

TEST_F(Vdb, LevelSetsAndFogAreSkeletons) {
  const Skeleton s = of({cube("c", 0.5, 0.3)});
  const Field field(s);
  for (const bool fog : {false, true}) {
    const detail::Lattice lattice{Vec3(0.013, 0, 0), 0.04};
    std::vector<detail::Cell> corners;
    for (int i = -3; i < 3; ++i)
      for (int j = -3; j < 3; ++j)
        for (int k = -3; k < 3; ++k) corners.push_back({8 * i, 8 * j, 8 * k});
    std::vector<detail::VdbGrid> grids;
    grids.emplace_back(lattice, corners, fog ? 0.0f : 0.3f);
    for (std::size_t b = 0; b < corners.size(); ++b)
      for (std::size_t j = 0; j < detail::kBlockSize; ++j) {
        const double d = field.evaluate(lattice.point(detail::pointOf(corners[b], j))).pseudoDistance;
        grids[0].values(b)[j] = static_cast<float>(fog ? std::clamp(0.5 - d / 0.2, 0.0, 1.0) : std::min(d, 0.3));
      }
    grids[0].describe("cloud", {}, fog ? detail::VdbClass::Fog : detail::VdbClass::LevelSet);
    detail::writeVdbFile(grids, folder_ / "cloud.vdb");
    const Skeleton read = readSkeletonOrVolume(folder_ / "cloud.vdb");
    ASSERT_EQ(read.primitives.size(), 1u);
    EXPECT_EQ(read.primitives[0].name, "cloud");
    EXPECT_TRUE(read.primitives[0].closed);
    for (const Vec3& p : read.primitives[0].points) EXPECT_NEAR(field.evaluate(p).pseudoDistance, 0, 0.02);
    const mesh::Mesh m = readVdbSurface(folder_ / "cloud.vdb");
    expectClosedManifold(m);
    EXPECT_NEAR(*mesh::volume(m, m.positions()).value, 1, 0.02);
  }
}

TEST_F(Vdb, BrokenFilesAreErrors) {
  EXPECT_THROW(readVdbSurface(folder_ / "none.vdb"), IoError);
  writeTextFile(folder_ / "text.vdb", "this is no volume");
  EXPECT_THROW(readVdbSurface(folder_ / "text.vdb"), IoError);
  const Skeleton s = of({polyline("l", wavyLine(8), 0.4)});
  VdbWriteOptions options;
  options.samples.voxel = 0.05;
  writeVdb(Field(s), s, folder_ / "a.vdb", options, silent_);
  const std::string bytes = readTextFile(folder_ / "a.vdb");
  for (const std::size_t keep : {std::size_t{10}, std::size_t{60}, std::size_t{200}, bytes.size() / 2, bytes.size() - 9}) {
    writeTextFile(folder_ / "cut.vdb", bytes.substr(0, keep));
    EXPECT_THROW(readVdbSurface(folder_ / "cut.vdb", {.isovalue = 0.2}), std::runtime_error) << keep;
  }
  EXPECT_THROW(writeVdb(Field(s), s, folder_ / "missing" / "a.vdb", options, silent_), IoError);
  options.samples.voxel = 1e-5;
  EXPECT_THROW(writeVdb(Field(s), s, folder_ / "big.vdb", options, silent_), std::invalid_argument);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "big.vdb"));
}

}  // namespace
}  // namespace fielddeform::field
