#include <fielddeform/core/json_reader.h>
#include <fielddeform/map/lattice_io.h>
#include <gtest/gtest.h>

#include "program.h"

namespace fielddeform::cli_test {
namespace {

TEST(Info, CountsWhatTheFileHolds) {
  const Scratch scratch;
  writeFile(scratch / "bar.ply", barPly(4));
  const Result result = run(scratch.path(), {"info", "bar.ply", "--json"});
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_EQ(result.err, "");
  const JsonDocument document = JsonDocument::parse(result.out, "info");
  const JsonValue root = document.root();
  EXPECT_EQ(root.require("vertices").integer(0, 100), 20u);
  EXPECT_EQ(root.require("quads").integer(0, 100), 18u);
  EXPECT_TRUE(root.require("closed").boolean());
  EXPECT_NEAR(root.require("volume").number(), 0.25 * 0.25 * 4, 1e-12);  // float coordinates are exact here
  EXPECT_EQ(root.require("attributes").size(), 1u);
  EXPECT_EQ((*root.require("attributes").array().begin()).require("name").string(), "color");
  EXPECT_EQ(scratch.files(), std::vector<std::string>{"bar.ply"});
}

TEST(Info, KnowsLatticesInBothFormats) {
  const Scratch scratch;
  map::Lattice lattice;
  lattice.axis.fill(map::AxisBasis::bernstein(3));
  for (const char* file : {"lattice.json", "lattice.obj"}) {
    map::writeLattice(lattice, scratch / file);
    const Result result = run(scratch.path(), {"info", file});
    EXPECT_EQ(result.code, 0) << result.err;
    EXPECT_NE(result.out.find("3 x 3 x 3 = 27"), std::string::npos) << result.out;
  }
}

TEST(Info, PlainTextSaysWhyThereIsNoVolume) {
  const Scratch scratch;
  writeFile(scratch / "open.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const Result result = run(scratch.path(), {"info", "open.obj"});
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_NE(result.out.find("none: 3 boundary edges"), std::string::npos) << result.out;
}

TEST(Info, AnAbsentFileIsBadInputNotWrongUsage) {
  const Scratch scratch;
  const Result result = run(scratch.path(), {"info", "absent.ply"});
  EXPECT_EQ(result.code, 1);
  EXPECT_EQ(result.out, "");
  EXPECT_TRUE(result.err.starts_with("fielddeform: absent.ply: ")) << result.err;
}

TEST(Info, ATruncatedFileNamesThePlace) {
  const Scratch scratch;
  std::string text = barPly(4);
  text.resize(text.size() / 2);
  writeFile(scratch / "half.ply", text);
  const Result result = run(scratch.path(), {"info", "half.ply"});
  EXPECT_EQ(result.code, 1);
  EXPECT_TRUE(result.err.starts_with("fielddeform: half.ply:")) << result.err;
}

}  // namespace
}  // namespace fielddeform::cli_test
