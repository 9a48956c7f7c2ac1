// fielddeform solid.
#include <gtest/gtest.h>

#include <cmath>

#include "program.h"

namespace fielddeform::cli_test {
namespace {

constexpr const char* kTwo = R"({"format": "fielddeform-solids", "version": 1,
 "solids": [{"name": "a", "degree": [2, 2, 2], "box": {"origin": [-2,-2,0], "edges": [[4,0,0], [0,4,0], [0,0,4]]}},
            {"name": "b", "degree": [2, 2, 2], "box": {"origin": [-2,-2,4], "edges": [[4,0,0], [0,4,0], [0,0,4]]}}],
 "joints": [{"faces": ["a.w1", "b.w0"], "continuity": 1}], "constraints": [{"fix_side": "a.w0"}]})";

class SolidCommand : public ::testing::Test {
 protected:
  void SetUp() override { writeFile(folder / "two.json", kTwo); }
  Result call(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), {"solid", "two.json"});
    return run(folder.path(), arguments);
  }
  double numberAfter(const std::string& file, const std::string& key) const {
    const std::string text = readFile(folder / file);
    const auto at = text.find(key);
    return at == std::string::npos ? std::nan("") : std::stod(text.substr(at + key.size()));
  }
  Scratch folder;
};

TEST_F(SolidCommand, MeetsVolumesByBothMethods) {
  for (const std::string method : {"exact", "uzawa"}) {
    const Result r = call({"--volume", "a=x1.25", "--move", "b:1,1,2=0,0,1", "--method", method, "--max-outer", "5000", "--report", "r.json", "--check", "-o", "out.ply"});
    ASSERT_EQ(r.code, 0) << r.err;
    EXPECT_NEAR(numberAfter("r.json", "\"after\": ") / 80, 1, method == "exact" ? 1e-12 : 1e-4);
    EXPECT_LT(numberAfter("r.json", "\"deviation\": "), 1e-4);
  }
  Result r = call({"--save-object", "same.json", "-o", "same.obj"});
  ASSERT_EQ(r.code, 0) << r.err;
  r = run(folder.path(), {"solid", "same.json", "-o", "again.obj"});
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_EQ(readFile(folder / "again.obj"), readFile(folder / "same.obj"));
}

TEST_F(SolidCommand, CarriesAMeshAndLeavesItWhereNothingMoves) {
  writeFile(folder / "bar.ply", barPly(8));
  Result r = call({"--embed", "bar.ply", "-o", "same.ply"});
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_EQ(readFile(folder / "same.ply"), readFile(folder / "bar.ply"));
  r = call({"--embed", "bar.ply", "--volume", "b=x1.5", "--frames", "3", "-o", "out.ply"});
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_EQ(readFile(folder / "out_0000.ply"), readFile(folder / "bar.ply"));
  EXPECT_NE(readFile(folder / "out_0002.ply"), readFile(folder / "bar.ply"));
  r = call({"--samples", "2", "-o", "inside.ply"});
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_NE(readFile(folder / "inside.ply").find("element vertex 54"), std::string::npos);
}

TEST_F(SolidCommand, DilatesOverARangeOfTargetsAsAnAnimation) {
  const Result r = call({"--volume", "a=x0.8..x1.2", "--frames", "3", "--tessellate", "24", "-o", "f.ply"});
  ASSERT_EQ(r.code, 0) << r.err;
  // Both solids hold 64; the range is gone through in equal ratios. Chords of curved sides cut off little.
  for (const auto& [file, expected] : {std::pair{"f_0000.ply", 0.8 * 64 + 64}, {"f_0001.ply", std::sqrt(0.8 * 1.2) * 64 + 64}, {"f_0002.ply", 1.2 * 64 + 64}}) {
    const std::string out = run(folder.path(), {"info", "--json", file}).out, key = "\"volume\": ";
    ASSERT_NE(out.find(key), std::string::npos) << out;
    EXPECT_NEAR(std::stod(out.substr(out.find(key) + key.size())), expected, 1e-3 * expected) << file;
  }
}

TEST_F(SolidCommand, SaysWhatIsWrongAndWritesNothing) {
  const auto fails = [&](std::vector<std::string> arguments, int code, const std::string& word) {
    arguments.insert(arguments.end(), {"-o", "out.ply"});
    const Result r = call(arguments);
    EXPECT_EQ(r.code, code) << r.err;
    EXPECT_NE(r.err.find(word), std::string::npos) << r.err;
  };
  fails({"--volume", "a"}, 2, "--volume");
  fails({"--volume", "a=much"}, 2, "--volume");
  fails({"--volume", "a=x1..x2"}, 2, "--frames");
  fails({"--volume", "c=x2"}, 1, "there are: a, b");
  fails({"--volume", "a=-3"}, 1, "expected a positive number");
  fails({"--move", "a:0,0,9=1,0,0"}, 1, "degrees are 2, 2, 2");
  fails({"--move", "a:0,0=1,0,0"}, 2, "--move");
  fails({"--fix-side", "a.up"}, 1, "SOLID.SIDE");
  fails({"--fix", "a:0,0,0", "--target", "a:0,0,0=9,9,9"}, 1, "contradicts");
  fails({"--weights", "0,0,0,0"}, 2, "--weights");
  fails({"--method", "uzawa", "--rho1", "60", "--volume", "a=x2"}, 1, "rho1");
  EXPECT_EQ(folder.files(), std::vector<std::string>{"two.json"});
}

}  // namespace
}  // namespace fielddeform::cli_test
