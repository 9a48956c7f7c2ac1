#include <fielddeform/core/error.h>
#include <fielddeform/solid/size.h>
#include <fielddeform/solid/solid_io.h>
#include <gtest/gtest.h>
#include <tests/solid/solids.h>

namespace fielddeform::solid {
namespace {

std::string refusal(const std::string& text) {
  try {
    parseSolids(text, "s.json");
  } catch (const IoError& error) {
    return error.what();
  }
  return "";
}

const std::string kBox = R"({"name": "a", "degree": [1, 1, 1], "box": {"origin": [0,0,0], "edges": [[1,0,0],[0,1,0],[0,0,1]]}})";
const std::string kNext = R"({"name": "b", "degree": [1, 1, 1], "size": "x1.5", "box": {"origin": [1,0,0], "edges": [[2,0,0],[0,1,0],[0,0,1]]}})";
std::string file(const std::string& solids, const std::string& more = "") {
  return R"({"format": "fielddeform-solids", "version": 1, "solids": [)" + solids + "]" + more + "}";
}

TEST(SolidIo, ComesBackAndPosesItsProblem) {
  const SolidFile f = parseSolids(file(kBox + "," + kNext, R"(,
    "joints": [{"faces": ["a.u1", "b.u0"], "continuity": 1, "ratio": 2}],
    "moves": [{"solid": "b", "index": [1, 1, 1], "by": [0.5, 0, 0]}],
    "constraints": [{"fix": {"solid": "b", "index": [1, 1, 1]}}, {"fix": {"solid": "a", "uvw": [0, 0.5, 0.5]}, "to": [0, 0.5, 0.6]},
      {"attach": [{"solid": "a", "index": [0,0,0]}, {"solid": "a", "uvw": [0,0,0]}]}, {"fix_side": "a.w0"},
      {"difference": [{"solid": "a", "index": [0,0,0]}, {"solid": "b", "index": [1,0,0]}], "by": [3, 0, 0]}],
    "objective": {"least_squares": 1}, "inner": "coons")"), "s.json");
  const std::string text = formatSolids(f);
  EXPECT_EQ(formatSolids(parseSolids(text, "again.json")), text);
  EXPECT_EQ(f.object.points.size(), 12u);
  EXPECT_EQ(f.object.joints[0].ratio, 2);
  const Problem p = problemOf(f);
  ASSERT_EQ(p.rows.size(), 8u);
  EXPECT_EQ(p.rows[0].value, Vec3(3.5, 1, 1));  // where the move took it
  EXPECT_EQ(p.rows[1].value, Vec3(0, .5, .6));
  EXPECT_NEAR(*p.sizes[1], 3, 1e-14);
  EXPECT_EQ(p.objective, Objective::leastSquaresOnly());
  Progress silent;
  const Result r = solve(p, {}, silent);
  EXPECT_LT(r.report.deviation, 1e-11);
  EXPECT_LT(r.report.rowResidual, 1e-11);
}

TEST(SolidIo, NamesWhatIsWrongAndWhere) {
  const auto expect = [](const std::string& text, const std::string& word) { EXPECT_NE(refusal(text).find(word), std::string::npos) << word << "\n" << refusal(text); };
  EXPECT_EQ(refusal(file(kBox)), "");
  expect(file(""), "none");
  expect(file(kBox + "," + kBox), "two are named \"a\"");
  expect(R"({"format": "fielddeform-lattice", "version": 1})", "fielddeform-solids");
  expect(file(kBox, R"(, "joint": [])"), "joints");
  expect(file(R"({"name": "a", "degree": [0,1,1], "points": []})"), "/solids/0/degree/0");
  expect(file(R"({"name": "a", "degree": [13,1,1], "points": []})"), "/solids/0/degree/0");
  expect(file(R"({"name": "a", "degree": [1,1,1], "points": [[0,0,0]]})"), "8 for these degrees");
  expect(file(R"({"name": "a", "degree": [1,1,1]})"), "points");
  expect(file(R"({"name": "", "degree": [1,1,1], "box": {"origin": [0,0,0], "edges": [[1,0,0],[0,1,0],[0,0,1]]}})"), "no name");
  expect(file(R"({"name": "a", "degree": [1,1,1], "size": "1.2", "box": {"origin": [0,0,0], "edges": [[1,0,0],[0,1,0],[0,0,1]]}})"), "/solids/0/size");
  expect(file(R"({"name": "a", "degree": [1,1,1], "size": -2, "box": {"origin": [0,0,0], "edges": [[1,0,0],[0,1,0],[0,0,1]]}})"), "/solids/0/size");
  expect(file(kBox + "," + kNext, R"(, "joints": [{"faces": ["a.u0", "b.u0"]}])"), "do not coincide");
  expect(file(kBox, R"(, "joints": [{"faces": ["a.u0", "c.u0"]}])"), "/joints/0/faces/1");
  expect(file(kBox, R"(, "joints": [{"faces": ["a.u0", "a.x0"]}])"), "/joints/0/faces/1");
  expect(file(kBox, R"(, "joints": [{"faces": ["a.u0"]}])"), "/joints/0/faces");
  expect(file(kBox, R"(, "moves": [{"solid": "z", "index": [0,0,0], "by": [0,0,0]}])"), "/moves/0/solid");
  expect(file(kBox, R"(, "moves": [{"solid": "a", "index": [0,2,0], "by": [0,0,0]}])"), "degrees are 1, 1, 1");
  expect(file(kBox, R"(, "constraints": [{"fix": {"solid": "a", "uvw": [0,2,0]}}])"), "from 0 to 1");
  expect(file(kBox, R"(, "constraints": [{"to": [0,0,0]}])"), "one of \"fix\"");
  expect(file(kBox, R"(, "constraints": [{"fix_side": "a.u0", "to": [0,0,0]}])"), "only \"fix\"");
  expect(file(kBox, R"(, "objective": {})"), "all weights are 0");
  expect(file(kBox, R"(, "objective": {"bend": -1})"), "/objective/bend");
  expect(file(kBox, R"(, "inner": "full")"), "/inner");
  expect(file(R"({"name": "a", "degree": [1,1,1], "points": [[0,0,0],[1e400,0,0]]})"), "s.json");
}

TEST(SolidIo, RefusesMoreThanItCanHold) {
  std::string solids;
  for (int k = 0; k < 12; ++k) {
    if (k) solids += ",";
    solids += R"({"name": "s)" + std::to_string(k) + R"(", "degree": [12,12,12], "box": {"origin": [0,0,0], "edges": [[1,0,0],[0,1,0],[0,0,1]]}})";
  }
  EXPECT_NE(refusal(file(solids)).find("at most"), std::string::npos);
}

}  // namespace
}  // namespace fielddeform::solid
