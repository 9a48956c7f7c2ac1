// fielddeform casteljau.
#include <gtest/gtest.h>

#include "program.h"

namespace fielddeform::cli_test {
namespace {

constexpr const char* kArch = R"({"format": "fielddeform-casteljau", "version": 1, "frame": "z", "pieces": [
  {"points": [[0,0,0],[0,0,4],[4,0,4]], "s": [[[1,0,0],[0,0,-1]]], "t": [0,1,0]}]})";

TEST(CasteljauCommand, AStraightCurveKeepsEveryByteAndIsSaved) {
  const Scratch folder;
  writeFile(folder / "bar.ply", barPly(8));
  Result r = run(folder.path(), {"casteljau", "bar.ply", "--straight", "3", "--save-curve", "c.json", "-o", "out.ply"});
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_EQ(readFile(folder / "out.ply"), readFile(folder / "bar.ply"));
  r = run(folder.path(), {"casteljau", "bar.ply", "--curve", "c.json", "-o", "again.ply"});
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_EQ(readFile(folder / "again.ply"), readFile(folder / "bar.ply"));
}

TEST(CasteljauCommand, WritesEveryLevel) {
  const Scratch folder;
  writeFile(folder / "bar.ply", barPly(8));
  writeFile(folder / "arch.json", kArch);
  const Result r = run(folder.path(), {"casteljau", "bar.ply", "--curve", "arch.json", "--levels", "--report", "r.json", "-o", "out.ply"});
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_EQ(folder.files(), (std::vector<std::string>{"arch.json", "bar.ply", "out.ply", "out_level1_0.ply", "out_level1_1.ply", "r.json"}));
  EXPECT_NE(readFile(folder / "r.json").find("\"folds\": 0"), std::string::npos);
  EXPECT_NE(readFile(folder / "out.ply"), readFile(folder / "out_level1_0.ply"));
}

TEST(CasteljauCommand, SaysWhatIsWrongAndWritesNothing) {
  const Scratch folder;
  writeFile(folder / "bar.ply", barPly(4));
  writeFile(folder / "broken.json", "{}");
  const auto fails = [&](std::vector<std::string> arguments, int code, const std::string& word) {
    arguments.insert(arguments.begin(), {"casteljau", "bar.ply", "-o", "out.ply"});
    const Result r = run(folder.path(), arguments);
    EXPECT_EQ(r.code, code) << r.err;
    EXPECT_NE(r.err.find(word), std::string::npos) << r.err;
  };
  fails({}, 2, "--curve");
  fails({"--curve", "broken.json"}, 1, "format");
  fails({"--curve", "missing.json"}, 1, "missing.json");
  fails({"--straight", "0"}, 2, "--straight");
  fails({"--straight", "2", "--frame", "up"}, 2, "--frame");
  EXPECT_EQ(folder.files(), (std::vector<std::string>{"bar.ply", "broken.json"}));
}

}  // namespace
}  // namespace fielddeform::cli_test
