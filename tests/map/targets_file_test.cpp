#include <fielddeform/core/error.h>
#include <fielddeform/map/targets_file.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>

namespace fielddeform::map {
namespace {

const std::vector<Vec3> kVertices{Vec3(0, 0, 0), Vec3(1, 2, 3), Vec3(4, 5, 6)};

std::string problem(const std::string& text) {
  try {
    parseTargets(text, "pairs.csv", kVertices);
  } catch (const IoError& e) {
    return e.what();
  }
  return "none";
}

TEST(TargetsFile, RowsArePointsOrVerticesWithAndWithoutWeights) {
  const auto points = parseTargets("x,y,z,tx,ty,tz\n0.5, 1e-3 ,-2,+3,4,5\n", "p", kVertices);
  ASSERT_EQ(points.size(), 1u);
  EXPECT_EQ(points[0].rest, Vec3(0.5, 1e-3, -2));
  EXPECT_EQ(points[0].image, Vec3(3, 4, 5));
  EXPECT_EQ(points[0].weight, 1);
  const auto weighted = parseTargets("1,2,3,4,5,6,0.25", "p", kVertices);
  EXPECT_EQ(weighted.at(0).weight, 0.25);
  const auto vertices = parseTargets("\xEF\xBB\xBF# a comment\r\n\r\nvertex, tx, ty, tz, weight\r\n2,0,1,0,3 # the tip\r\n0,1,1,1,1", "p", kVertices);
  ASSERT_EQ(vertices.size(), 2u);
  EXPECT_EQ(vertices[0].rest, kVertices[2]);
  EXPECT_EQ(vertices[0].image, Vec3(0, 1, 0));
  EXPECT_EQ(vertices[0].weight, 3);
  EXPECT_EQ(vertices[1].rest, kVertices[0]);
}

TEST(TargetsFile, PinsArePointsOrVertices) {
  EXPECT_EQ(parsePins("x,y,z\n1,2,3\n4,5,6", "p", kVertices), (std::vector<Vec3>{{1, 2, 3}, {4, 5, 6}}));
  EXPECT_EQ(parsePins("1\n0\n", "p", kVertices), (std::vector<Vec3>{kVertices[1], kVertices[0]}));
  EXPECT_THROW(parsePins("1,2\n", "p", kVertices), IoError);
}

TEST(TargetsFile, ErrorsNameFileLineFoundAndExpected) {
  EXPECT_EQ(problem("1,0,0,0\n# a\n3,0,0,0\n"), "pairs.csv:3: row 1: vertex 3, expected less than 3");
  EXPECT_EQ(problem("-1,0,0,0\n"), "pairs.csv:1: row 0: vertex -1, expected a vertex number, counted from 0");
  EXPECT_EQ(problem("0.5,0,0,0\n"), "pairs.csv:1: row 0: vertex 0.5, expected a vertex number, counted from 0");
  EXPECT_EQ(problem("0,0,0,0\n1,2,3,4,5,6\n"), "pairs.csv:2: row 1: 6 numbers, expected vertex,tx,ty,tz");
  EXPECT_EQ(problem("0,0,nan,0\n"), "pairs.csv:1: row 0: \"nan\", expected a finite number");
  EXPECT_EQ(problem("0,0,,0\n"), "pairs.csv:1: row 0: nothing, expected a finite number");
  EXPECT_EQ(problem("0,0,1e999,0\n"), "pairs.csv:1: row 0: \"1e999\", expected a finite number");
  EXPECT_EQ(problem("0,0,1 2,0\n"), "pairs.csv:1: row 0: \"1 2\", expected a finite number");
  EXPECT_EQ(problem("0,0,0,0,0\n"), "pairs.csv:1: row 0: weight 0, expected a weight > 0");
  EXPECT_TRUE(problem("a,b\n1,0,0,0\n").starts_with("pairs.csv:1: row 0: \"a,b\", expected x,y,z,tx,ty,tz or "));
  EXPECT_EQ(problem("1,2\n").substr(0, 41), "pairs.csv:1: row 0: 2 numbers, expected x");
  EXPECT_EQ(problem("# nothing\n").substr(0, 39), "pairs.csv:1: row 0: end of file, expect");
  EXPECT_NE(problem("vertex,tx,ty,tz\nvertex,tx,ty,tz\n"), "none");
  EXPECT_THROW(readTargets("no such file.csv", kVertices), IoError);
  EXPECT_THROW(readTargets(".", kVertices), IoError);
}

TEST(TargetsFile, ReadsAFile) {
  const auto path = std::filesystem::temp_directory_path() / "fielddeform_targets_file_test.csv";
  std::ofstream(path) << "1,9,8,7\n";
  EXPECT_EQ(readTargets(path, kVertices).at(0).image, Vec3(9, 8, 7));
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace fielddeform::map
