#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>

#include "io_support.h"

namespace fielddeform::mesh {
namespace {

struct Counts {
  std::size_t vertices, faces;
};
// As the folder's own list states them.
const std::map<std::string, Counts> kMeshes = {
    {"cow.obj", {2903, 5804}},     {"homer.obj", {6002, 12000}},           {"rocker-arm.obj", {10044, 20088}},
    {"spot.obj", {2930, 5856}},    {"horse_quad.obj", {2400, 2398}},       {"suzanne.obj", {507, 500}},
    {"camel_b.obj", {2032, 3576}}, {"stanford-bunny.obj", {35947, 69451}}, {"teapot.obj", {3644, 6320}},
    {"woody.obj", {694, 1267}},    {"igea.ply", {134345, 268686}}};

TEST(FormatsReal, EveryMeshHasItsCountsAndComesBackTheSame) {
  const char* folder = std::getenv("FIELDDEFORM_TEST_MESHES");
  if (!folder) GTEST_SKIP() << "FIELDDEFORM_TEST_MESHES is not set";
  for (const auto& [name, counts] : kMeshes) {
    SCOPED_TRACE(name);
    const std::filesystem::path path = std::filesystem::path(folder) / name;
    if (!std::filesystem::exists(path)) continue;
    const Mesh mesh = readMesh(path);
    EXPECT_EQ(mesh.vertexCount(), counts.vertices);
    EXPECT_EQ(mesh.faceCount(), counts.faces);
    const std::string bytes = meshBytes(mesh, *formatOf(mesh));
    expectSame(mesh, parse(bytes, name));
    if (name == "igea.ply") {
      std::ifstream in(path, std::ios::binary);
      EXPECT_TRUE(std::string(std::istreambuf_iterator<char>(in), {}) == bytes);
    }
    for (const Format other : {Format::Ply, Format::Obj, Format::Off}) {
      const Mesh converted = parse(meshBytes(mesh, other), "t." + std::string(toString(other)));
      EXPECT_EQ(converted.corners(), mesh.corners());
      EXPECT_EQ(converted.offsets(), mesh.offsets());
    }
  }
}

TEST(FormatsReal, SpotKeepsItsSeams) {
  const char* folder = std::getenv("FIELDDEFORM_TEST_MESHES");
  if (!folder) GTEST_SKIP() << "FIELDDEFORM_TEST_MESHES is not set";
  const Mesh spot = readMesh(std::filesystem::path(folder) / "spot.obj");
  ASSERT_TRUE(spot.find(Element::Corner, "uv"));
  EXPECT_EQ(spot.find(Element::Corner, "uv")->valueCount(), 3225u);
  const Mesh ply = parse(meshBytes(spot, Format::Ply), "spot.ply");
  const Attribute *before = spot.find(Element::Corner, "uv"), *after = ply.find(Element::Corner, "uv");
  ASSERT_TRUE(after);
  for (std::size_t c = 0; c < spot.cornerCount(); ++c)
    for (int k = 0; k < 2; ++k) ASSERT_EQ(before->get(before->indices[c], k), after->get(c, k));
}

}  // namespace
}  // namespace fielddeform::mesh
