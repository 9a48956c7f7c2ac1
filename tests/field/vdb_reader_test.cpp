// Our reader of .vdb files against OpenVDB's own idea of what it wrote.
#include <fielddeform/core/error.h>
#include <fielddeform/core/random.h>
#include <fielddeform/field/detail/vdb_reader.h>
#include <fielddeform/field/vdb.h>
#include <gtest/gtest.h>
#include <openvdb/io/Archive.h>
#include <openvdb/openvdb.h>

#include <algorithm>
#include <cmath>
#include <sstream>

namespace fielddeform::field {
namespace {

using detail::Cell;
using detail::VdbVolume;

class MemoryArchive : public openvdb::io::Archive {
 public:
  using openvdb::io::Archive::write;
};

std::string written(const openvdb::GridCPtrVec& grids, std::uint32_t compression, bool offsets = true) {
  std::ostringstream stream(std::ios::binary);
  MemoryArchive archive;
  archive.setCompression(compression);
  archive.write(stream, grids, offsets);
  return std::move(stream).str();
}

// Leaves with noise, with two inactive values, tiles of every level, some on negative sides.
template <class GridType>
typename GridType::Ptr noisyGrid(double background, std::uint64_t voxels = 600) {
  using Value = typename GridType::ValueType;
  openvdb::initialize();
  auto grid = GridType::create(static_cast<Value>(background));
  auto& tree = grid->tree();
  for (std::uint64_t i = 0; i < voxels; ++i) {
    const openvdb::Coord c(static_cast<int>(60 * uniform01(1, 3 * i)) - 40, static_cast<int>(60 * uniform01(1, 3 * i + 1)) - 9,
                           static_cast<int>(5000 * uniform01(1, 3 * i + 2)) - 2500);
    const auto v = static_cast<Value>(std::round(64 * (uniform01(2, i) - 0.5)) / 16);  // exact in 16 bits
    if (i % 3 == 0) tree.setValueOff(c, v);
    else if (i % 3 == 1) tree.setValueOff(c, static_cast<Value>(-background));
    else tree.setValue(c, v);
  }
  tree.addTile(1, openvdb::Coord(200, 0, 0), static_cast<Value>(-2), true);
  tree.addTile(2, openvdb::Coord(-1024, 256, 128), static_cast<Value>(0.5), false);
  tree.addTile(3, openvdb::Coord(8192, -4096, 0), static_cast<Value>(1.5), true);
  return grid;
}

float valueAt(const VdbVolume& v, const openvdb::Coord& c) {
  const Cell corner{c.x() & ~7, c.y() & ~7, c.z() & ~7};
  if (const float* block = v.block(corner)) return block[(c.x() & 7) << 6 | (c.y() & 7) << 3 | (c.z() & 7)];
  return *v.uniform(corner, 0);
}

template <class GridType>
void expectSame(const GridType& grid, const VdbVolume& v) {
  EXPECT_EQ(v.background, static_cast<float>(grid.background()));
  EXPECT_EQ(v.blocks.size(), grid.tree().leafCount());
  int wrong = 0;
  for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf)
    for (auto value = leaf->cbeginValueAll(); value; ++value)
      wrong += valueAt(v, value.getCoord()) != static_cast<float>(*value);
  for (std::uint64_t i = 0; i < 20000; ++i) {
    const auto along = [&](std::uint64_t k) { return static_cast<int>(20000 * uniform01(3, 3 * i + k)) - 10000; };
    const openvdb::Coord c = i % 2 ? openvdb::Coord(along(0), along(1), along(2)) : openvdb::Coord(along(0) / 40, along(1) / 40, along(2));
    wrong += valueAt(v, c) != static_cast<float>(grid.tree().getValue(c));
  }
  EXPECT_EQ(wrong, 0);
}

TEST(VdbReader, ReadsEveryCompressionAsOpenVdbWroteIt) {
  for (const std::uint32_t compression : {0u, 1u, 2u, 3u, 4u, 6u}) {  // none, zip, by mask, both, Blosc, that by mask
    const auto floats = noisyGrid<openvdb::FloatGrid>(3);
    const auto doubles = noisyGrid<openvdb::DoubleGrid>(0.25);
    floats->setName("floats");
    doubles->setName("doubles");
    for (const bool half : {false, true}) {
      floats->setSaveFloatAsHalf(half);
      doubles->setSaveFloatAsHalf(half);
      const std::string bytes = written({floats, doubles}, compression);
      SCOPED_TRACE(compression + (half ? 100u : 0u));
      expectSame(*floats, detail::readVdbVolume(bytes, "a.vdb", "", 100));
      const VdbVolume second = detail::readVdbVolume(bytes, "a.vdb", "doubles", 100);
      EXPECT_EQ(second.name, "doubles");
      expectSame(*doubles, second);
    }
  }
}

TEST(VdbReader, TransformsAndClassesComeAlong) {
  auto grid = noisyGrid<openvdb::FloatGrid>(3);
  using openvdb::math::Transform;
  std::vector<Transform::Ptr> transforms{Transform::createLinearTransform(0.25), Transform::createLinearTransform()};
  transforms.push_back(Transform::createLinearTransform(0.5));
  transforms.back()->postTranslate({1, 2, 3});
  transforms.push_back(transforms.back()->copy());
  transforms.back()->postScale({1, 2, 4});
  transforms.push_back(transforms.back()->copy());
  transforms.back()->postRotate(0.7, openvdb::math::X_AXIS);
  transforms.back()->postTranslate({-1, 0.5, 7});
  transforms.push_back(Transform::createLinearTransform());
  transforms.back()->postTranslate({0, 0, 9});
  for (const auto& t : transforms) {
    grid->setTransform(t);
    const VdbVolume v = detail::readVdbVolume(written({grid}, openvdb::io::COMPRESS_ZIP), "a.vdb", "", 100);
    EXPECT_FALSE(v.fog);
    for (const openvdb::Vec3d& u : {openvdb::Vec3d(0, 0, 0), openvdb::Vec3d(5, -7, 11)}) {
      const openvdb::Vec3d w = t->indexToWorld(u);
      const Eigen::Vector4d mine = v.toWorld * Eigen::Vector4d(u.x(), u.y(), u.z(), 1);
      EXPECT_LT((mine.head<3>() - Vec3(w.x(), w.y(), w.z())).norm(), 1e-12) << t->mapType();
    }
  }
  grid->setGridClass(openvdb::GRID_FOG_VOLUME);
  EXPECT_TRUE(detail::readVdbVolume(written({grid}, 0), "a.vdb", "", 100).fog);
}

// A world sphere of radius 1 about (1, 2, 3) in grids whose voxels are boxes of 0.1 by 0.2 by 0.05, turned twice.
TEST(VdbReader, AnisotropicFogAndLevelSetsLieWhereTheyAreInTheWorld) {
  openvdb::initialize();
  const auto transform = openvdb::math::Transform::createLinearTransform();
  transform->postScale({0.1, 0.2, 0.05});
  transform->postRotate(0.6, openvdb::math::Z_AXIS);
  transform->postRotate(-0.4, openvdb::math::X_AXIS);
  transform->postTranslate({1, 2, 3});
  auto fog = openvdb::FloatGrid::create(0), surface = openvdb::FloatGrid::create(0.6f);
  for (int i = -20; i <= 20; ++i)
    for (int j = -12; j <= 12; ++j)
      for (int k = -40; k <= 40; ++k) {
        const double d = (transform->indexToWorld(openvdb::Vec3d(i, j, k)) - openvdb::Vec3d(1, 2, 3)).length() - 1;
        const double density = std::clamp(0.5 - d / 0.6, 0.0, 1.0);
        if (density > 0) fog->tree().setValue({i, j, k}, static_cast<float>(density));
        if (std::abs(d) < 0.6) surface->tree().setValue({i, j, k}, static_cast<float>(d));
        else if (d < 0) surface->tree().setValueOff({i, j, k}, -0.6f);
      }
  fog->setGridClass(openvdb::GRID_FOG_VOLUME);
  surface->setGridClass(openvdb::GRID_LEVEL_SET);
  const auto vectors = openvdb::Vec3SGrid::create();
  vectors->tree().setValue({1, 2, 3}, openvdb::Vec3s(1, 2, 3));
  vectors->setName("vectors");
  fog->setName("fog");
  surface->setName("surface");
  for (const auto& grid : {fog, surface}) {
    grid->setTransform(transform->copy());
    for (const bool mirrored : {false, true}) {
      if (mirrored) grid->transform().preScale({1, 1, -1});
      for (const bool half : {false, true}) {
        grid->setSaveFloatAsHalf(half);
        const mesh::Mesh m = parseVdbSurface(written({vectors, grid}, openvdb::io::COMPRESS_BLOSC), "odd.vdb");
        ASSERT_GT(m.vertexCount(), 500u);
        double volume = 0;
        for (std::size_t f = 0; f < m.faceCount(); ++f) {
          const auto c = m.face(f);
          const auto at = [&](std::size_t k) { return Vec3(m.positions()[c[k]] - Vec3(1, 2, 3)); };
          volume += at(0).dot(at(1).cross(at(2))) / 6;
        }
        EXPECT_NEAR(volume, 4.18879, 0.1) << grid->getName() << mirrored;  // outwards; chords of voxels up to 0.2
        // Linear interpolation of a distance over boxes of that size: 0.23^2 / 8, and half floats.
        for (const Vec3& p : m.positions()) EXPECT_NEAR((p - Vec3(1, 2, 3)).norm(), 1, 0.012) << grid->getName();
      }
    }
  }
}

TEST(VdbReader, GridsWithoutASurfaceAreNamed) {
  openvdb::initialize();
  const auto empty = openvdb::FloatGrid::create(0);
  empty->setName("nothing");
  const auto message = [](const std::string& bytes) -> std::string {
    try {
      parseVdbSurface(bytes, "e.vdb");
    } catch (const IoError& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_NE(message(written({empty}, 0)).find("\"nothing\""), std::string::npos) << message(written({empty}, 0));
  empty->setGridClass(openvdb::GRID_FOG_VOLUME);
  EXPECT_NE(message(written({empty}, 0)).find("does not take the value 0.5"), std::string::npos);
  EXPECT_NE(message(written({}, 0)), "");
}

TEST(VdbReader, ASurfaceThatPassesBetweenTilesIsFound) {
  openvdb::initialize();
  // A cube of tiles without a stored voxel, half a large tile away from another that is of the same value.
  auto grid = openvdb::FloatGrid::create(1);
  grid->tree().addTile(2, openvdb::Coord(0, 0, 0), -1, true);
  grid->tree().addTile(2, openvdb::Coord(128, 0, 0), -2, true);
  grid->tree().addTile(1, openvdb::Coord(-8, 0, 0), -1, true);
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  const mesh::Mesh m = parseVdbSurface(written({grid}, 0), "tiles.vdb");
  Box box;
  for (const Vec3& p : m.positions()) box.extend(p);
  EXPECT_LT((box.min() - Vec3(-8.5, -0.5, -0.5)).norm(), 0.3);
  EXPECT_LT((box.max() - Vec3(255.5, 127.5, 127.5)).norm(), 0.3);
}

TEST(VdbReader, OtherFilesAreNamed) {
  openvdb::initialize();
  const auto vectors = openvdb::Vec3SGrid::create();
  const auto numbers = noisyGrid<openvdb::FloatGrid>(1);
  numbers->setName("density");
  const auto message = [&](const std::string& bytes, const std::string& grid) -> std::string {
    try {
      detail::readVdbVolume(bytes, "f.vdb", grid, 100);
    } catch (const IoError& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_EQ(message(written({vectors}, 0), ""), "f.vdb: no grid of floats or doubles, expected at least one");
  EXPECT_EQ(message(written({vectors, numbers}, 0), ""), "");
  EXPECT_EQ(message(written({numbers}, 0), "heat"), "f.vdb: no grid \"heat\", expected one of \"density\"");
  EXPECT_NE(message(written({numbers}, 0, false), "").find("stream"), std::string::npos);
  const openvdb::FloatGrid::Ptr sharing = openvdb::gridPtrCast<openvdb::FloatGrid>(numbers->copyGrid());
  sharing->setName("twin");
  EXPECT_NE(message(written({numbers, sharing}, 0), "twin").find("shares the tree"), std::string::npos);
  const auto frustum = noisyGrid<openvdb::FloatGrid>(1);
  frustum->setTransform(openvdb::math::Transform::createFrustumTransform(openvdb::BBoxd({0, 0, 0}, {9, 9, 9}), 0.5, 10, 1));
  EXPECT_NE(message(written({frustum}, 0), "").find("expected a linear one"), std::string::npos);
}

// Whatever is cut off or overwritten: an error that names the file, or a surface of numbers, within the memory.
TEST(VdbReader, AnyBytesGiveASurfaceOrAnError) {
  auto grid = noisyGrid<openvdb::FloatGrid>(1, 60);
  for (const std::uint32_t compression : {0u, 3u, 6u}) {
    const std::string whole = written({grid}, compression);
    VdbReadOptions options;
    options.isovalue = 0.1;
    options.maxMegabytes = 20;
    int read = 0;
    const auto tryIt = [&](const std::string& bytes) {
      try {
        const mesh::Mesh m = parseVdbSurface(bytes, "bad.vdb", options);
        for (const Vec3& p : m.positions()) ASSERT_TRUE(p.allFinite());
        ++read;
      } catch (const IoError& e) {
        EXPECT_TRUE(std::string(e.what()).starts_with("bad.vdb: ")) << e.what();
      }
    };
    tryIt(whole);
    EXPECT_EQ(read, 1);
    for (std::uint64_t i = 0; i < 40; ++i) tryIt(whole.substr(0, static_cast<std::size_t>(uniform01(5, i) * static_cast<double>(whole.size()))));
    EXPECT_EQ(read, 1) << "a file that was cut off was read";
    for (std::uint64_t i = 0; i < 150; ++i) {
      std::string bytes = whole;
      // Mostly in the header and the tree's top, where the sizes are.
      const double share = uniform01(6, 3 * i), reach = i % 3 ? 900 : static_cast<double>(bytes.size());
      const auto at = static_cast<std::size_t>(share * std::min(reach, static_cast<double>(bytes.size() - 8)));
      const std::uint64_t what = splitmix64(7, i);
      for (std::size_t k = 0; k < (i % 2 ? 1 : 8); ++k) bytes[at + k] = static_cast<char>(i % 5 == 0 ? 0xFF : what >> 8 * k);
      tryIt(bytes);
    }
  }
}

}  // namespace
}  // namespace fielddeform::field
