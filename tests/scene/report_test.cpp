#include <fielddeform/core/json_reader.h>
#include <fielddeform/scene/report.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace fielddeform::scene {
namespace {

TEST(Report, NinetyNineOfAHundredValuesAreNotLarger) {
  std::vector<float> values;
  for (int i = 1; i <= 100; ++i) values.push_back(static_cast<float>(101 - i));
  const MaxAndP99 result = maxAndP99(values);
  EXPECT_EQ(result.max, 100);
  EXPECT_EQ(result.p99, 99);
  values.assign(1000, 1.0f);
  for (int i = 0; i < 10; ++i) values[static_cast<std::size_t>(i) * 50] = 7;
  EXPECT_EQ(maxAndP99(values).p99, 1);  // exactly 1 % is larger
  values[999] = 7;
  EXPECT_EQ(maxAndP99(values).p99, 7);
}

TEST(Report, PercentilesOfFewOrNoValues) {
  EXPECT_EQ(maxAndP99({}).max, 0);
  EXPECT_EQ(maxAndP99({}).p99, 0);
  EXPECT_EQ(maxAndP99({3}).p99, 3);
  EXPECT_EQ(maxAndP99({3, 1, 2}).p99, 3);
  EXPECT_EQ(maxAndP99({std::nanf(""), 2}).max, 2);
}

TEST(Report, RelativeChangeNeedsAVolumeBefore) {
  EXPECT_FALSE((VolumeReport{.before = 0.0, .after = 1.0, .asWritten = {}, .reason = {}}.relativeChange()));
  EXPECT_FALSE((VolumeReport{.before = {}, .after = 1.0, .asWritten = {}, .reason = {}}.relativeChange()));
  EXPECT_DOUBLE_EQ((*VolumeReport{.before = 2.0, .after = 1.0, .asWritten = {}, .reason = {}}.relativeChange()), -0.5);
}

TEST(Report, JsonHoldsEveryEntryAndReadsBack) {
  Report report;
  report.options = R"({"seed": 0})";
  report.vertices = 3;
  report.faces = 1;
  report.status = {1, 2, 0, 0, 0};
  report.residual = {0.5, 0.25};
  report.foldsBefore = 4;
  report.foldsAfter = 5;
  report.flipped = 6;
  report.volume.reason = "3 open edges";
  report.warnings = {"a \"quoted\" warning"};
  report.run.seconds = {{"read", 0.25}, {"write", std::numeric_limits<double>::min()}};
  report.run.threads = 2;
  report.run.paths = {{"input", "a.ply"}};
  const JsonDocument document = JsonDocument::parse(toJson(report), "report.json");
  const JsonValue root = document.root();
  root.allowKeys({"format", "version", "options", "method", "predictor", "vertices", "faces", "status", "residual", "folds",
                  "flipped", "volume", "inserted_vertices", "stretch", "warnings", "run"});
  EXPECT_EQ(root.require("status").require("converged").integer(0, 9), 2u);
  std::uint64_t sum = 0;
  for (const JsonValue count : root.require("status").members()) sum += count.integer(0, 9);
  EXPECT_EQ(sum, report.vertices);
  EXPECT_EQ(root.require("residual").require("p99").number(), 0.25);
  EXPECT_EQ(root.require("folds").require("after").integer(0, 9), 5u);
  EXPECT_TRUE(root.require("volume").require("before").isNull());
  EXPECT_TRUE(root.require("volume").require("relative_change").isNull());
  EXPECT_EQ(root.require("volume").require("reason").string(), "3 open edges");
  EXPECT_EQ(root.require("run").require("seconds").require("read").number(), 0.25);
  EXPECT_EQ(root.require("options").require("seed").integer(0, 0), 0u);
}

TEST(Report, NumbersThatAreNotFiniteBecomeNull) {
  Report report;
  report.residual = {std::numeric_limits<double>::infinity(), 1};
  const JsonDocument document = JsonDocument::parse(toJson(report), "report.json");
  EXPECT_TRUE(document.root().require("residual").require("max").isNull());
}

}  // namespace
}  // namespace fielddeform::scene
