#include <gtest/gtest.h>

#include "program.h"

namespace fielddeform::cli_test {
namespace {

// Width and height as a PNG file's header states them.
std::pair<unsigned, unsigned> pngSize(const std::string& png) {
  const auto number = [&](std::size_t at) {
    unsigned n = 0;
    for (std::size_t i = 0; i < 4; ++i) n = n << 8 | static_cast<unsigned char>(png.at(at + i));
    return n;
  };
  return {number(16), number(20)};
}

TEST(Render, DrawsAPictureOfTheWantedSize) {
  const Scratch scratch;
  writeFile(scratch / "bar.ply", barPly(4));
  writeFile(scratch / "spine.json",
            R"({"format": "fielddeform-skeleton", "version": 1, "primitives": [
                {"name": "spine", "type": "polyline", "points": [[0.1, 0.1, 0], [0.1, 0.1, 4]]}]})");
  const Result result = run(scratch.path(), {"render", "bar.ply", "bar.ply", "-o", "bar.png", "--size", "160x90",
                                             "--quality", "draft", "--skeleton", "spine.json", "--azimuth", "-20"});
  if (result.err.find("built without") != std::string::npos) GTEST_SKIP() << result.err;
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_EQ(pngSize(readFile(scratch / "bar.png")), std::make_pair(160u, 90u));
}

TEST(Render, MistakesLeaveNoFile) {
  const Scratch scratch;
  writeFile(scratch / "bar.ply", barPly(2));
  const std::vector<std::pair<int, std::vector<std::string>>> mistakes{
      {2, {"render", "bar.ply"}},
      {2, {"render", "bar.ply", "-o", "x.png", "--size", "1x1"}},
      {2, {"render", "bar.ply", "-o", "x.png", "--size", "100y200"}},
      {2, {"render", "bar.ply", "-o", "x.png", "--up", "0,1"}},
      {2, {"render", "bar.ply", "-o", "x.png", "--zoom", "nan"}},
      {2, {"render", "bar.ply", "-o", "x.png", "--color", "octarine"}},
      {2, {"render", "bar.ply", "-o", "x.png", "--framing", "none"}},
      {2, {"render", "bar.ply", "-o", "x.png", "--zoom", "0"}},
      {2, {"render", "bar.ply", "-o", "x.png", "--edges", "-1"}},
      {2, {"render", "bar.ply", "-o", "x.png", "--crease", "200"}},
      {2, {"render", "bar.ply", "-o", "x.png", "--direction", "0,0,0"}},
      {2, {"render", "bar.ply", "-o", "x.png", "--range", "2,1"}},
      {2, {"render", "bar.ply", "-o", "x.jpg"}},
      {2, {"render", "bar.ply", "-o", "x"}},
      {1, {"render", "bar.ply", "-o", "x.png", "--attribute", "absent"}},
      {1, {"render", "absent.ply", "-o", "x.png"}},
      {1, {"render", "bar.ply", "-o", "no/folder/x.png", "--size", "32", "--quality", "draft"}},
      {2, {"render", "bar.ply", "bar.ply", "bar.ply", "-o", "x.png", "--skeleton", "a", "--skeleton", "b"}}};
  for (const auto& [code, arguments] : mistakes) {
    const Result result = run(scratch.path(), arguments);
    EXPECT_EQ(result.code, code) << result.err;
    EXPECT_TRUE(result.err.starts_with("fielddeform: ")) << result.err;
    EXPECT_EQ(scratch.files(), std::vector<std::string>{"bar.ply"});
  }
}

}  // namespace
}  // namespace fielddeform::cli_test
