#include <fielddeform/core/error.h>
#include <fielddeform/core/json_reader.h>
#include <fielddeform/core/json_writer.h>
#include <fielddeform/map/move_io.h>
#include <fielddeform/mesh/io.h>
#include <gtest/gtest.h>

#include <fstream>
#include <numbers>

#include "../support/shapes.h"

namespace fielddeform::map {
namespace {

MoveSpec parse(const std::string& text) {
  const JsonDocument document = JsonDocument::parse(text, "moves.json");
  return moveFromJson(document.root(), "folder");
}

std::string written(const MoveSpec& move) {
  JsonWriter json;
  moveToJson(move, json, [](const std::filesystem::path& p) { return p.lexically_relative("folder").generic_string(); });
  return json.text();
}

TEST(MoveIo, EveryOperationReadsBackAsItWasWritten) {
  for (const char* text :
       {R"({"op": "targets", "file": "pairs.csv"})",
        R"({"op": "targets", "points": [[1,2,3,4,5,6], [0,0,0,1,0,0,0.5]], "directions": [[0,0,0,1,0,0,1,0.25,0]], "pins": [[7,8,9]]})",
        R"({"op": "magnet", "centre": [1,2,3], "radius": 0.5, "by": [0,0,1]})",
        R"({"op": "magnet", "centre": [1,2,3], "radius": 0.5, "towards": [0,0,1], "strength": -0.5, "profile": "linear"})",
        R"({"op": "suction", "centre": [1,2,3], "axis": [0,0,2], "radius": 0.5, "depth": 2, "by": [1,0,0], "turn_deg": 30})",
        R"({"op": "suction", "centre": [1,2,3], "axis": [0,0,2], "radius": 0.5})",
        R"({"op": "press", "point": [0,0,1], "normal": [0,0,-1]})", R"({"op": "press", "tool": "ball.obj"})"}) {
    const MoveSpec move = parse(text);
    EXPECT_EQ(written(parse(written(move))), written(move)) << text;
  }
  const auto magnet = std::get<Magnet>(parse(R"({"op": "magnet", "centre": [1,2,3], "radius": 0.5, "by": [0,0,1], "profile": "flat"})"));
  EXPECT_EQ(magnet.centre, Vec3(1, 2, 3));
  EXPECT_EQ(magnet.by, Vec3(0, 0, 1));
  EXPECT_EQ(magnet.profile, Profile::Flat);
  EXPECT_FALSE(magnet.towards);
  const auto cup = std::get<SuctionCup>(parse(R"({"op": "suction", "centre": [0,0,0], "axis": [0,1,0], "radius": 2, "turn_deg": 90})"));
  EXPECT_NEAR(cup.turn, std::numbers::pi / 2, 1e-15);
  EXPECT_FALSE(cup.depth);
  EXPECT_EQ(std::get<PressFile>(parse(R"({"op": "press", "tool": "ball.obj"})")).path, std::filesystem::path("folder") / "ball.obj");
  EXPECT_EQ(std::get<Targets>(parse(R"({"op": "targets", "points": [[1,2,3,4,5,6,0.5]]})")).points.at(0).weight, 0.5);
}

TEST(MoveIo, MistakesAreNamed) {
  for (const char* text :
       {R"({"op": "magnt"})", R"({"op": "magnet", "centre": [0,0,0], "radius": 0, "by": [0,0,1]})",
        R"({"op": "magnet", "centre": [0,0,0], "radius": 1, "by": [0,0,1], "towards": [0,0,0]})",
        R"({"op": "magnet", "centre": [0,0,0], "radius": 1, "by": [0,0,1], "strength": 1})",
        R"({"op": "magnet", "centre": [0,0,0], "radius": 1, "by": [0,0,1], "colour": 1})",
        R"({"op": "targets"})", R"({"op": "targets", "points": []})", R"({"op": "targets", "points": [[1,2,3]]})",
        R"({"op": "targets", "points": [[1,2,3,4,5,6,0]]})", R"({"op": "targets", "directions": [[1,2,3,0,0,0,1,1,1]]})",
        R"({"op": "targets", "file": "a", "points": []})", R"({"op": "suction", "centre": [0,0,0], "axis": [0,0,0], "radius": 1})",
        R"({"op": "press"})", R"({"op": "press", "point": [0,0,0], "normal": [0,0,0]})", R"({"op": "press", "tool": "a", "point": [0,0,0]})", R"([])"})
    EXPECT_THROW(parse(text), IoError) << text;
}

TEST(MoveIo, FilesAreReadWhenTheMoveIsLoaded) {
  const auto folder = std::filesystem::temp_directory_path() / "fielddeform_move_io_test";
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "pairs.csv") << "1,9,8,7\n";
  mesh::writeMesh(test::cube(), folder / "cube.obj");
  const std::vector<Vec3> vertices{Vec3(0, 0, 0), Vec3(1, 2, 3)};
  const Move targets = loadMove(TargetsFile{folder / "pairs.csv"}, vertices);
  EXPECT_EQ(std::get<Targets>(targets).points.at(0).rest, vertices[1]);
  const Move press = loadMove(PressFile{folder / "cube.obj"}, vertices);
  EXPECT_EQ(std::get<Press>(press).tool.contact(Vec3(0.5, 0.5, 0.9)).depth, Vec3(0, 0, 1).z() - 0.9);
  EXPECT_EQ(std::get<Press>(loadMove(PressPlane{Vec3(0, 0, 1), Vec3(0, 0, -1)}, vertices)).tool.contact(Vec3(0, 0, 2)).depth, 1);
  EXPECT_EQ(std::get<Magnet>(loadMove(Magnet{.radius = 3}, vertices)).radius, 3);
  EXPECT_THROW(loadMove(PressFile{folder / "none.obj"}, vertices), IoError);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace fielddeform::map
