#include <fielddeform/core/angle.h>
#include <fielddeform/core/error.h>
#include <fielddeform/scene/scene.h>
#include <gtest/gtest.h>

#include <filesystem>

namespace fielddeform::scene {
namespace {

const char* kSmall = R"({"format": "fielddeform-scene", "version": 1, "inputs": ["scan.ply"],
  "skeleton": {"rest": "rest.json"},
  "edits": [{"op": "bend", "primitive": "spine", "angle_deg": 90}],
  "output": {"mesh": "out.ply"}})";

// The example of the file format's contract, word by word.
const char* kWhole = R"({"format": "fielddeform-scene", "version": 1, "seed": 0, "inputs": ["scan.ply"], "method": "gffd",
 "skeleton": {"rest": "rest.json", "posed": null, "pairs": []},
 "edits": [{"op": "bend", "primitive": "spine", "angle_deg": 90, "about": "auto", "from": 0, "to": 1}],
 "field": {"distance": "exact", "potential": "exponential", "sharpness": 4},
 "tracking": {"predictor": "auto", "corrector": true, "tolerance": 1e-4, "falloff": "auto", "guard": true},
 "resample": {"by": "both", "max_stretch": 1.8, "max_deviation": 1e-3, "max_vertices": null}, "volume": null,
 "output": {"mesh": "out.ply", "report": "out.json", "precision": "keep"}})";

const char* kLattices = R"({"format": "fielddeform-scene", "version": 1, "inputs": ["scan.ply"], "method": "lattice",
 "lattices": ["own.json", {"file": "other.json", "fit": true},
  {"nodes": [5, 2, 2], "basis": "bspline", "degree": 2, "border": "free", "box": "oriented", "padding": 0.1, "outside": "keep",
   "moves": [{"node": [4, 1, 0], "by": [0, 0.5, 0]}]},
  {"box": {"origin": [0, 0, 0], "edges": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]},
   "axes": [{"basis": "bernstein", "nodes": 2}, {"basis": "bernstein", "nodes": 2}, {"basis": "bernstein", "nodes": 3}],
   "moves": [{"node": [1, 1, 2], "by": [0.1, 0, 0]}]}],
 "output": {"mesh": "out.ply"}})";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

std::string problemOf(const std::string& text) {
  try {
    parseScene(text, "scene.json");
  } catch (const IoError& problem) {
    return problem.what();
  }
  return "";
}

TEST(SceneFile, TheContractsExampleIsRead) {
  const Scene scene = parseScene(kWhole, "folder/scene.json");
  EXPECT_EQ(scene.inputs, std::vector<std::filesystem::path>{"folder/scan.ply"});
  EXPECT_EQ(std::get<std::filesystem::path>(scene.rest), "folder/rest.json");
  ASSERT_EQ(scene.edits.size(), 1u);
  const auto& bend = std::get<skeleton::Bend>(scene.edits[0].operation);
  EXPECT_EQ(bend.angle, kPi / 2);
  EXPECT_FALSE(bend.about);
  EXPECT_EQ(scene.tracking.predictor, gffd::Predictor::Auto);
  ASSERT_TRUE(scene.resample);
  EXPECT_FALSE(scene.resample->maxVertices);
  EXPECT_EQ(*scene.output.report, "folder/out.json");
}

TEST(SceneFile, DefaultsAreThoseOfTheOptions) {
  const Scene scene = parseScene(kSmall, "scene.json");
  EXPECT_EQ(scene.tracking.tolerance, gffd::Options{}.tolerance);
  EXPECT_FALSE(scene.resample);
  EXPECT_FALSE(scene.check);
  EXPECT_EQ(scene.output.normals, Normals::Turn);
}

TEST(SceneFile, WritingWhatWasReadIsAFixedPoint) {
  for (const char* text : {kSmall, kWhole, kLattices}) {
    const std::string once = formatScene(parseScene(text, "a/scene.json"), "a");
    EXPECT_EQ(formatScene(parseScene(once, "a/scene.json"), "a"), once);
  }
}

TEST(SceneFile, LatticesAreFilesRulesOrTheLatticeItself) {
  const Scene scene = parseScene(kLattices, "folder/scene.json");
  EXPECT_EQ(methodOf(scene), "lattice");
  ASSERT_EQ(scene.lattices.size(), 4u);
  EXPECT_EQ(std::get<std::filesystem::path>(scene.lattices[0].source), "folder/own.json");
  EXPECT_FALSE(scene.lattices[0].fit);
  EXPECT_TRUE(scene.lattices[1].fit);
  const auto& rule = std::get<LatticeRule>(scene.lattices[2].source);
  EXPECT_EQ(rule.nodes, (std::array<int, 3>{5, 2, 2}));
  EXPECT_EQ(rule.border, map::Border::Free);
  EXPECT_EQ(rule.outside, map::Outside::Keep);
  EXPECT_TRUE(rule.oriented);
  ASSERT_EQ(rule.moves.size(), 1u);
  EXPECT_EQ(rule.moves[0].by, Vec3(0, .5, 0));
  EXPECT_EQ(std::get<map::Lattice>(scene.lattices[3].source).nodeCount(), 12u);
}

TEST(SceneFile, LatticesMayFollowPoints) {
  const std::string sculpt = R"("sculpt": {"moves": [{"op": "targets", "file": "pairs.csv"}, {"op": "press", "point": [0, 0, 1], "normal": [0, 0, -1]}],
    "pins": "pins.csv", "refine": 500, "tolerance": 1e-6})";
  for (const char* place : {"\"fit\": true", "\"outside\": \"keep\"", "\"moves\": [{\"node\": [1, 1, 2], \"by\": [0.1, 0, 0]}]"}) {
    const Scene scene = parseScene(replaced(kLattices, place, place + (", " + sculpt)), "folder/scene.json");
    int found = 0;
    for (const LatticeStep& step : scene.lattices) {
      if (step.sculpt.moves.empty()) continue;
      ++found;
      ASSERT_EQ(step.sculpt.moves.size(), 2u);
      EXPECT_EQ(std::get<map::TargetsFile>(step.sculpt.moves[0]).path, "folder/pairs.csv");
      EXPECT_EQ(step.sculpt.pins, "folder/pins.csv");
      EXPECT_EQ(step.sculpt.maxNodes, 500u);
      EXPECT_EQ(step.sculpt.tolerance, 1e-6);
    }
    EXPECT_EQ(found, 1);
    const std::string once = formatScene(scene, "folder");
    EXPECT_EQ(formatScene(parseScene(once, "folder/scene.json"), "folder"), once);
  }
  EXPECT_NE(problemOf(replaced(kLattices, "\"fit\": true", "\"fit\": true, \"sculpt\": {\"moves\": []}")), "");
  EXPECT_NE(problemOf(replaced(kLattices, "\"fit\": true", "\"fit\": true, \"sculpt\": {\"moves\": [{\"op\": \"magic\"}]}")), "");
}

TEST(SceneFile, KeysOfTheOtherMethodAreRefused) {
  EXPECT_NE(problemOf(replaced(kLattices, "\"output\"", "\"edits\": [], \"output\"")).find("no such key with the method"),
            std::string::npos);
  EXPECT_NE(problemOf(replaced(kSmall, "\"output\"", "\"lattices\": [], \"output\"")).find("no such key with the method"),
            std::string::npos);
  EXPECT_NE(problemOf(replaced(kLattices, "[5, 2, 2]", "[5, 2]")), "");
  EXPECT_NE(problemOf(replaced(kLattices, "[5, 2, 2]", "[5, 1, 2]")), "");
}

TEST(SceneFile, EveryEntrySurvives) {
  Scene scene = parseScene(kWhole, "scene.json");
  scene.seed = 7;
  scene.read.invalid = mesh::InvalidPoints::Keep;
  scene.read.weld = mesh::Weld::Exact;
  scene.rest = AxisRest{Vec3(0, 1, 2)};
  scene.pairs = {{"a", "b"}};
  scene.symmetry = Axis::Z;
  scene.tracking.predictor = gffd::Predictor::Warp;
  scene.tracking.corrector = false;
  scene.tracking.tolerance = 1.0 / 3;
  scene.tracking.maxIterations = 5;
  scene.tracking.falloff = gffd::Falloff::On;
  scene.tracking.falloffBand = 0.7;
  scene.tracking.guard = false;
  scene.tracking.strictValue = true;
  scene.tracking.substeps = 3;
  scene.tracking.evaluation = gffd::Evaluation::Grid;
  scene.tracking.retry = false;
  scene.tracking.midpointValue = gffd::MidpointValue::Mean;
  scene.tracking.radius = 0.1;
  scene.tracking.field = {skeleton::Potential::SoftObject, 2.5};
  scene.resample->by = resample::Criterion::Deviation;
  scene.resample->maxVertices = 1000;
  scene.mask = Mask{"weight", {}};
  scene.output.picture = "out.png";
  scene.output.precision = mesh::Precision::Double;
  scene.output.normals = Normals::Recompute;
  scene.output.statusAttribute = scene.output.residualAttribute = scene.output.displacementAttribute = true;
  scene.output.frames = 4;
  scene.check = Check{.folds = 3, .flipped = {}, .residual = 0.25};
  scene.extras = R"({"note": [1, 2]})";
  const Scene back = parseScene(formatScene(scene, ""), "scene.json");
  EXPECT_EQ(formatScene(back, ""), formatScene(scene, ""));
  EXPECT_EQ(back.seed, 7u);
  EXPECT_EQ(back.read.invalid, mesh::InvalidPoints::Keep);
  EXPECT_EQ(back.read.weld, mesh::Weld::Exact);
  EXPECT_EQ(std::get<AxisRest>(back.rest).axis, Vec3(0, 1, 2));
  EXPECT_EQ(back.pairs.at(0).posed, "b");
  EXPECT_EQ(back.symmetry, Axis::Z);
  EXPECT_EQ(back.tracking.tolerance, 1.0 / 3);
  EXPECT_EQ(back.tracking.falloffBand, 0.7);
  EXPECT_EQ(back.tracking.field.potential, skeleton::Potential::SoftObject);
  EXPECT_EQ(back.tracking.midpointValue, gffd::MidpointValue::Mean);
  EXPECT_EQ(back.resample->maxVertices, 1000u);
  EXPECT_EQ(back.mask->attribute, "weight");
  EXPECT_EQ(back.output.frames, 4);
  EXPECT_TRUE(back.output.displacementAttribute);
  EXPECT_FALSE(back.check->flipped);
  EXPECT_EQ(back.check->residual, 0.25);
  EXPECT_EQ(back.extras, scene.extras);
}

TEST(SceneFile, EveryEditSurvives) {
  Scene scene = parseScene(kSmall, "scene.json");
  skeleton::Primitive with;
  with.name = "new";
  with.points = {{0, 0, 0}, {1, 0, 0}};
  const skeleton::Spine spine{.axis = Vec3(1, 2, 3), .pivot = Vec3(4, 5, 6), .from = 0.1, .to = 0.9};
  const auto edit = [](auto operation) { return skeleton::Edit{"spine", std::move(operation)}; };
  scene.edits = {edit(skeleton::Bend{spine, 0.3, {}, Vec3(0, 0, 1)}),
                 edit(skeleton::Bend{{}, {}, -2.0, {}}),
                 edit(skeleton::Twist{spine, 1.0}),
                 edit(skeleton::Taper{spine, 0.5}),
                 edit(skeleton::Stretch{spine, 2}),
                 edit(skeleton::Translate{{1, 2, 3}}),
                 edit(skeleton::Rotate{0.7, Vec3(0, 1, 0), Vec3(1, 1, 1)}),
                 edit(skeleton::Scale{{1, 2, 3}, Vec3(0, 1, 0)}),
                 edit(skeleton::MovePoints{{0, 2}, {{1, 0, 0}, {0, 1, 0}}}),
                 edit(skeleton::MovePoints{{1}, {{1, 0, 0}}}),
                 edit(skeleton::Press{{0, 0, 1}, {0, 0, 1}, 0.5}),
                 edit(skeleton::Replace{with})};
  const Scene back = parseScene(formatScene(scene, ""), "scene.json");
  ASSERT_EQ(back.edits.size(), scene.edits.size());
  for (std::size_t i = 0; i < back.edits.size(); ++i)
    EXPECT_EQ(back.edits[i].operation.index(), scene.edits[i].operation.index()) << i;
  EXPECT_EQ(formatScene(back, ""), formatScene(scene, ""));
  const auto& bend = std::get<skeleton::Bend>(back.edits[0].operation);
  EXPECT_EQ(bend.spine.axis, spine.axis);
  EXPECT_EQ(bend.spine.pivot, spine.pivot);
  EXPECT_EQ(bend.about, Vec3(0, 0, 1));
  EXPECT_EQ(std::get<skeleton::Scale>(back.edits[7].operation).factor, Vec3(1, 2, 3));
  EXPECT_EQ(std::get<skeleton::MovePoints>(back.edits[8].operation).by[1], Vec3(0, 1, 0));
  EXPECT_EQ(std::get<skeleton::Replace>(back.edits[11].operation).with.points, with.points);
}

TEST(SceneFile, MistakesNameTheirPlace) {
  struct Case {
    std::string from, to, expected;
  };
  const std::vector<Case> cases{
      {"\"inputs\"", "\"inptus\"", "inputs"},
      {"[\"scan.ply\"]", "[]", "/inputs"},
      {"[\"scan.ply\"]", "[\"\"]", "/inputs/0"},
      {"\"bend\"", "\"bnd\"", "did you mean \"bend\""},
      {"\"angle_deg\": 90", "\"angle_deg\": \"90\"", "/edits/0/angle_deg"},
      {"\"angle_deg\": 90", "\"angle\": 90", "angle_deg"},
      {"\"angle_deg\": 90", "\"angle_deg\": 90, \"radius\": 1", "/edits/0"},
      {"\"angle_deg\": 90", "\"angle_deg\": 90, \"from\": 0.5, \"to\": 0.5", "/edits/0"},
      {"\"angle_deg\": 90", "\"angle_deg\": 90, \"angle_deg\": 90", "angle_deg"},
      {"\"angle_deg\": 90", "\"angle_deg\": 90, \"axis\": [0, 0, 0]", "/edits/0/axis"},
      {"{\"rest\": \"rest.json\"}", "{\"rest\": 3}", "/skeleton/rest"},
      {"{\"rest\": \"rest.json\"}", "{\"rest\": {\"primitives\": []}}", "/skeleton/rest"},
      {"{\"rest\": \"rest.json\"}", "{\"rest\": \"r\", \"posed\": \"p\"}", "/edits"},
      {"\"version\": 1", "\"version\": 2", "version"},
      {"\"fielddeform-scene\"", "\"fielddeform-skeleton\"", "format"},
      {"{\"mesh\": \"out.ply\"}", "{\"mesh\": \"out.ply\", \"frames\": 1}", "/output/frames"},
      {"{\"mesh\": \"out.ply\"}", "{\"mesh\": \"out.ply\"}, \"volume\": true", "/volume"},
      {"{\"mesh\": \"out.ply\"}", "{\"mesh\": \"out.ply\"}, \"volume\": {\"solvr\": \"exact\"}", "solver"},
      {"{\"mesh\": \"out.ply\"}", "{\"mesh\": \"out.ply\"}, \"volume\": {\"energy\": \"spring\"}", "did you mean \"springs\""},
      {"{\"mesh\": \"out.ply\"}", "{\"mesh\": \"out.ply\"}, \"volume\": {\"mask\": {}}", "/volume/mask"},
      {"{\"mesh\": \"out.ply\"}", "{\"mesh\": \"out.ply\"}, \"volume\": {\"mask\": \"given\"}", "/volume/mask"},
      {"{\"mesh\": \"out.ply\"}", "{\"mesh\": \"out.ply\"}, \"volume\": {\"lattice\": [4, 3, 5]}", "/volume/lattice/1"},
      {"{\"mesh\": \"out.ply\"}", "{\"mesh\": \"out.ply\"}, \"mask\": {}", "/mask"},
      {"{\"mesh\": \"out.ply\"}", "{\"mesh\": \"out.ply\"}, \"tracking\": {\"falloff\": 0}", "/tracking/falloff"},
      {"{\"mesh\": \"out.ply\"}", "{\"mesh\": \"out.ply\"}, \"tracking\": {\"substeps\": 1.5}", "/tracking/substeps"},
      {"{\"mesh\": \"out.ply\"}", "{\"mesh\": \"out.ply\"}, \"resample\": {\"max_stretch\": 0.5}", "/resample/max_stretch"}};
  for (const Case& c : cases) {
    const std::string problem = problemOf(replaced(kSmall, c.from, c.to));
    EXPECT_TRUE(problem.starts_with("scene.json:")) << c.to << " -> " << problem;
    EXPECT_NE(problem.find(c.expected), std::string::npos) << c.to << " -> " << problem;
  }
  EXPECT_TRUE(problemOf("").starts_with("scene.json:"));
  EXPECT_NE(problemOf("{\n\"format\": x}").find("scene.json:2:"), std::string::npos) << problemOf("{\n\"format\": x}");
}

TEST(SceneFile, UnknownKeysAreFreeInExtrasAlone) {
  EXPECT_EQ(problemOf(replaced(kSmall, "\"version\": 1", "\"version\": 1, \"extras\": {\"anything\": {\"x\": 1}}")), "");
  EXPECT_NE(problemOf(replaced(kSmall, "\"version\": 1", "\"version\": 1, \"anything\": 1")), "");
}

TEST(SceneFile, TheVolumePassReadsBack) {
  const auto with = [](const char* volume) {
    return parseScene(replaced(kSmall, "{\"mesh\": \"out.ply\"}", std::string("{\"mesh\": \"out.ply\"}, \"volume\": ") + volume), "a/scene.json");
  };
  EXPECT_FALSE(with("null").volume);
  ASSERT_TRUE(with("{}").volume);
  EXPECT_EQ(with("{}").volume->options.mask, volume::MaskKind::Auto);
  const Scene scene = with(R"({"mask": {"file": "m.txt"}, "lattice": [4, 5, 6], "energy": "springs", "solver": "augmented-lagrangian"})");
  const Scene back = parseScene(formatScene(scene, "b"), "b/scene.json");
  for (const Scene* s : {&scene, &back}) {
    EXPECT_EQ(s->volume->options.mask, volume::MaskKind::Given);
    EXPECT_EQ(s->volume->mask->file.lexically_normal(), "a/m.txt");
    EXPECT_EQ(*s->volume->options.nodes, (std::array<int, 3>{4, 5, 6}));
    EXPECT_EQ(s->volume->options.energy, volume::LocalEnergy::Springs);
    EXPECT_EQ(s->volume->options.solver, volume::LocalSolver::AugmentedLagrangian);
  }
  EXPECT_EQ(parseScene(formatScene(with("{\"mask\": \"rest\"}"), ""), "s.json").volume->options.mask, volume::MaskKind::Rest);
}

TEST(SceneFile, PathsStayRightWhenTheSceneIsSavedElsewhere) {
  const Scene scene = parseScene(kSmall, "one/scene.json");
  const Scene back = parseScene(formatScene(scene, "two/three"), "two/three/scene.json");
  EXPECT_EQ(back.inputs[0].lexically_normal(), scene.inputs[0]);
  EXPECT_EQ(back.output.mesh.lexically_normal(), scene.output.mesh);
}

}  // namespace
}  // namespace fielddeform::scene
