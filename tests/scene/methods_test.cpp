#include <fielddeform/core/error.h>
#include <fielddeform/scene/methods.h>
#include <fielddeform/scene/scene.h>
#include <gtest/gtest.h>
#include <tests/support/methods.h>

namespace fielddeform::scene {
namespace {

using tests::Claim;
using tests::deformBy;

std::string sceneText(const std::string& method, const std::string& more) {
  return R"({"format": "fielddeform-scene", "version": 1, "inputs": ["scan.ply"], "method": ")" + method +
         R"(", "skeleton": {"rest": "rest.json"}, )" + more +
         R"("edits": [{"op": "bend", "primitive": "spine", "angle_deg": 90}], "output": {"mesh": "out.ply"}})";
}

std::string problemOf(const std::string& text) {
  try {
    parseScene(text, "scene.json");
  } catch (const IoError& problem) {
    return problem.what();
  }
  return "";
}

TEST(MethodTable, WordsNameOneMethodEach) {
  for (const MethodInfo& info : methods()) {
    EXPECT_EQ(methodFromString(info.word), info.kind);
    EXPECT_EQ(toString(info.kind), info.word);
    EXPECT_FALSE(info.what.empty());
  }
  EXPECT_FALSE(methodFromString("magic"));
  EXPECT_TRUE(takes(MethodKind::Gffd, MethodOption::Tracking));
  EXPECT_FALSE(takes(MethodKind::Barr, MethodOption::Falloff));
}

TEST(MethodScenes, EveryMethodIsReadAndWritten) {
  for (const MethodInfo& info : methods()) {
    const std::string text = sceneText(std::string(info.word), "");
    const Scene scene = parseScene(text, "a/scene.json");
    EXPECT_EQ(scene.method, info.kind);
    EXPECT_EQ(methodOf(scene), info.word);
    const std::string once = formatScene(scene, "a");
    EXPECT_EQ(formatScene(parseScene(once, "a/scene.json"), "a"), once);
  }
  const Scene lattice = parseScene(sceneText("lattice", "\"nodes\": [4, 5, 6], "), "scene.json");
  EXPECT_EQ(lattice.latticeNodes, (std::array<int, 3>{4, 5, 6}));
  EXPECT_NE(formatScene(lattice, "").find("\"nodes\": [4, 5, 6]"), std::string::npos);
  EXPECT_EQ(parseScene(sceneText("wires", "\"wire_blend\": 2.5, "), "s.json").wireBlend, 2.5);
  const Scene sum = parseScene(sceneText("wires", "\"wire_blend\": \"sum\", "), "s.json");
  EXPECT_FALSE(sum.wireBlend);
  EXPECT_FALSE(parseScene(formatScene(sum, ""), "s.json").wireBlend);
}

TEST(MethodScenes, KeysThatAMethodHasNoUseForAreRefused) {
  const std::vector<std::pair<std::string, std::string>> mistakes{
      {"barr", "\"field\": {}, "},        {"rbf", "\"tracking\": {\"falloff\": \"off\"}, "}, {"lbs", "\"tracking\": {\"predictor\": \"mls\"}, "},
      {"axial", "\"nodes\": [4, 4, 4], "}, {"gffd", "\"wire_blend\": 1, "},                  {"lattice", "\"lattices\": [], "},
      {"dqs", "\"lattices\": [\"a.json\"], "}};
  for (const auto& [method, key] : mistakes) EXPECT_NE(problemOf(sceneText(method, key)), "") << method << key;
  EXPECT_EQ(problemOf(sceneText("lbs", "\"tracking\": {\"falloff\": 0.5}, \"field\": {\"sharpness\": 3}, ")), "");
  EXPECT_NE(problemOf(sceneText("lattice", "\"nodes\": [1, 4, 4], ")), "");
  EXPECT_NE(problemOf(sceneText("wires", "\"wire_blend\": -1, ")), "");
  EXPECT_NE(problemOf(sceneText("wires", "\"wire_blend\": \"max\", ")), "");
  EXPECT_NE(problemOf(sceneText("magic", "")).find("gffd"), std::string::npos);
}

// The figures of docs/methods.md on a coarser mesh; bounds are twice what was measured there.
TEST(Claims, GffdReproducesTheMethodsBeforeIt) {
  const double mean[] = {1e-4, 2e-4, 1e-6, 1e-12, 1e-12, 2e-4, 0.02, 0.04, 0.05, 0.004};
  const auto claims = tests::claims(32, 40);
  ASSERT_EQ(claims.size(), std::size(mean));
  for (std::size_t i = 0; i < claims.size(); ++i)
    EXPECT_LT(tests::missesOf(claims[i], deformBy(MethodKind::Gffd, claims[i].mesh, claims[i].rest, claims[i].posed)).mean, mean[i])
        << claims[i].name;
}

TEST(Claims, BarrAndAxialReproduceThemselvesFromTheSkeletonsAlone) {
  const auto claims = tests::claims(16, 20);
  for (std::size_t i = 0; i < 5; ++i)
    EXPECT_LT(tests::missesOf(claims[i], deformBy(MethodKind::Barr, claims[i].mesh, claims[i].rest, claims[i].posed)).max, 1e-5)
        << claims[i].name;
  EXPECT_EQ(tests::missesOf(claims[5], deformBy(MethodKind::Axial, claims[5].mesh, claims[5].rest, claims[5].posed)).max, 0);
}

TEST(CandyWrapper, CollapsesByLinearBlendingAndByNothingThatTurns) {
  const Claim joint = tests::candyWrapper(true, 24, 41);
  const auto waist = [&](MethodKind method) { return tests::waist(joint, deformBy(method, joint.mesh, joint.rest, joint.posed)); };
  EXPECT_LT(waist(MethodKind::Lbs), 1e-10);
  EXPECT_LT(waist(MethodKind::Casteljau), 5e-4);  // two lines' images in the mean: 0.000 in docs/methods.md
  EXPECT_NEAR(waist(MethodKind::Dqs), 1, 1e-10);
  EXPECT_GT(waist(MethodKind::Gffd), 0.97);
  const Claim spread = tests::candyWrapper(false, 24, 41);
  const auto even = [&](MethodKind method) { return tests::waist(spread, deformBy(method, spread.mesh, spread.rest, spread.posed)); };
  EXPECT_NEAR(even(MethodKind::Barr), 1, 1e-6);
  EXPECT_NEAR(even(MethodKind::Axial), 1, 1e-9);
  EXPECT_NEAR(even(MethodKind::Dqs), 1, 1e-10);
  EXPECT_GT(even(MethodKind::Gffd), 0.99);
  EXPECT_LT(even(MethodKind::Lbs), 0.97);
}

}  // namespace
}  // namespace fielddeform::scene
