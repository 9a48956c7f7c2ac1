#include <fielddeform/field/distance.h>
#include <gtest/gtest.h>

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
