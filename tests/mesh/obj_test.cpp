#include <limits>

#include "io_support.h"

namespace fielddeform::mesh {
namespace {

const std::string kScene =
    "# a scene\nmtllib skin.mtl\no body\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\n"
    "g front\nusemtl red\ns 1\nf 1/1/1 2/2/1 3/3/1\nf 2//1 4//1 3//1\n\ns off\nf 1/1 2/2 4 3\n"
    "o tail\nv 0 0 0.5 1 0.5 0\nv 0 0 1e-05\nvp 0.5 0.5\nl 1/1 5/2\nl 5 6\np 1 2\np 6\ncurv 0 1 1 2\nf 5 6 1\n# end\n";

TEST(Obj, ComesBackByteForByteWhenItsNumbersAreShortest) { EXPECT_EQ(roundTrip(kScene, "t.obj"), kScene); }

TEST(Obj, SeamsColoursLinesAndPointsAreRead) {
  const Mesh mesh = parse(kScene, "t.obj");
  EXPECT_EQ(mesh.vertexCount(), 6u);
  EXPECT_EQ(mesh.faceCount(), 4u);
  EXPECT_EQ(mesh.face(2).size(), 4u);
  const Attribute* uv = mesh.find(Element::Corner, "uv");
  ASSERT_TRUE(uv);
  EXPECT_EQ(uv->valueCount(), 3u);
  EXPECT_EQ(uv->indices, (std::vector<Index>{0, 1, 2, kNoIndex, kNoIndex, kNoIndex, 0, 1, kNoIndex, kNoIndex, kNoIndex,
                                             kNoIndex, kNoIndex}));
  EXPECT_EQ(mesh.find(Element::Corner, "normal")->indices[5], 0u);
  const Attribute* color = mesh.find(Element::Vertex, "color");
  EXPECT_EQ(color->get(4, 1), 0.5);
  EXPECT_EQ(color->get(0, 1), 1.0);
  ASSERT_EQ(mesh.lines().size(), 2u);
  EXPECT_EQ(mesh.lines()[0].vertices, (std::vector<Index>{0, 4}));
  EXPECT_EQ(mesh.loosePoints(), (std::vector<Index>{0, 1, 5}));
}

TEST(Obj, IndicesMayCountBackwards) {
  const std::string file =
      "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf -3/-1 -2/-1 -1/-1\nv 0 0 1\nf -4 -1 -2\nl -1 -2\np -1\n";
  const Mesh mesh = parse(file, "t.obj");
  EXPECT_EQ(mesh.corners(), (std::vector<Index>{0, 1, 2, 0, 3, 2}));
  EXPECT_EQ(mesh.lines()[0].vertices, (std::vector<Index>{3, 2}));
  EXPECT_EQ(roundTrip(file, "t.obj"),
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf -3/-1 -2/-1 -1/-1\nv 0 0 1\nf -4 -1 -2\nl 4 3\np 4\n");
}

TEST(Obj, UnusualLayoutsMeanTheSame) {
  const Mesh plain = parse("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "t.obj");
  for (const char* file : {"v  0 0 0 \r\nv\t1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n", "v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r",
                           "  v 0.0 +0 0\nv 1 \\\n0 0\nv 0 1e0 0\nf 1 \\\r\n 2\\\n 3",
                           "v 0 0 0\nv 10e-1 0 0\nv 0 1 0.\nf 1// 2/ 3//\n", "f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n"}) {
    const Mesh mesh = parse(file, "t.obj");
    EXPECT_EQ(mesh.positions(), plain.positions()) << file;
    EXPECT_EQ(mesh.corners(), plain.corners()) << file;
  }
}

TEST(Obj, CommentsBehindNumbersAndContinuedLinesAreKept) {
  const std::string file = "v 0 0 0 # origin\nv 1 0 0\ng a \\\n b\nv 0 1 0\nf 1 2 3\n";
  EXPECT_EQ(roundTrip(file, "t.obj"), "v 0 0 0\n# origin\nv 1 0 0\ng a \\\n b\nv 0 1 0\nf 1 2 3\n");
}

// Found by fuzzing: each writing added one more line end.
TEST(Obj, ALastLineThatWouldGoOnIsStable) {
  const std::string once = roundTrip("v 0 0 0\ng a\\", "t.obj");
  EXPECT_EQ(once, "v 0 0 0\ng a\\\n");
  EXPECT_EQ(roundTrip(once, "t.obj"), once);
}

TEST(Obj, LineEndsAreKept) {
  const std::string file = "# dos\r\nv 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n";
  EXPECT_EQ(roundTrip(file, "t.obj"), file);
}

TEST(Obj, NumbersAreTheNearestDoubles) {
  // Halfway and hard cases, checked against the compiler's own conversion.
  const std::string file =
      "v 0.1 1.7976931348623157e308 4.9e-324\nv 123456789012345678901234567890 0.30000000000000004 9007199254740993\nv "
      "1e-400 -0 2.2250738585072011e-308\n";
  const Mesh mesh = parse(file, "t.obj");
  EXPECT_EQ(mesh.positions()[0], Vec3(0.1, 1.7976931348623157e308, 4.9e-324));
  EXPECT_EQ(mesh.positions()[1], Vec3(123456789012345678901234567890.0, 0.30000000000000004, 9007199254740993.0));
  EXPECT_EQ(mesh.positions()[2], Vec3(0, 0, 2.2250738585072011e-308));
  expectSame(mesh, parse(roundTrip(file, "t.obj"), "t.obj"));
}

// Found by fuzzing: the reader looked one byte behind a last line that has no end.
TEST(Obj, TheLastLineNeedsNoEnd) {
  for (const char* end : {"", "\n", "\r\n", "\r"})
    EXPECT_EQ(parse(std::string("v 0 0 0\nv 1 1 1\np 1") + end, "t.obj").loosePoints().size(), 1u);
  EXPECT_EQ(parse("v 0 0 0", "t.obj").vertexCount(), 1u);
}

TEST(Obj, ErrorsNameLineElementFoundAndExpected) {
  const std::string v = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  EXPECT_EQ(errorOf(v + "f 1 2 4\n", "t.obj"), "t.obj:4: face 0: vertex 4, expected 1 to 3");
  EXPECT_EQ(errorOf(v + "f 1 2 0\n", "t.obj"), "t.obj:4: face 0: vertex 0, expected 1 to 3");
  EXPECT_EQ(errorOf(v + "f 1 2 -4\n", "t.obj"), "t.obj:4: face 0: vertex -4, expected at most 3 back");
  EXPECT_EQ(errorOf(v + "f 1/1 2 3\n", "t.obj"), "t.obj:4: face 0: vt 1, expected 1 to 0");
  EXPECT_EQ(errorOf(v + "f 1 2 x\n", "t.obj"), "t.obj:4: face 0: 'x', expected a vertex index");
  EXPECT_EQ(errorOf(v + "f 1 2 3.5\n", "t.obj"), "t.obj:4: face 0: '.5', expected the next corner or end of line");
  EXPECT_EQ(errorOf(v + "f\n", "t.obj"), "t.obj:4: face 0: no corner, expected at least one");
  EXPECT_EQ(errorOf("v 0 0\n", "t.obj"), "t.obj:1: vertex 0: 2 numbers, expected x y z, x y z w, x y z r g b (a)");
  EXPECT_EQ(errorOf("v 0 zero 0\n", "t.obj"), "t.obj:1: vertex 0: 'zero', expected a number");
  EXPECT_EQ(errorOf("v 0 0 0\nv 0 nan 0\n", "t.obj"),
            "t.obj:2: vertex 1: a coordinate that is not finite, expected finite coordinates");
  EXPECT_EQ(errorOf("", "t.obj"), "t.obj:1: no vertex, expected at least one 'v' statement");
  EXPECT_EQ(errorOf("v 0 0 0\rjunk\nv 1 1 1\n", "t.obj").substr(0, 8), "t.obj:1:");
}

TEST(Obj, NonFiniteVerticesAreKeptOnRequest) {
  ReadReport report;
  const Mesh mesh = parse("v 0 nan 0\nv inf 0 0\nv 1 2 3\n", "t.obj", {InvalidPoints::Keep, {}}, &report);
  EXPECT_EQ(report.invalidPoints, 2u);
  EXPECT_EQ(meshBytes(mesh, Format::Obj), "v 0 nan 0\nv inf 0 0\nv 1 2 3\n");
}

TEST(Obj, ChildrenOfSplitFacesStayInTheirGroups) {
  const std::string file = "v 0 0 0\nv 1 0 0\ng a\nf 1 2 3\nv 0 1 0\ng b\nusemtl m\nf 1 2 3\nf 3 2 1\nl 1 2\n";
  const Mesh mesh = parse(file, "t.obj");
  auto positions = mesh.positions();
  positions.emplace_back(0.5, 0, 0);
  Mesh refined(positions, {0, 3, 2, 3, 1, 2, 0, 1, 2, 2, 1, 3, 2, 3, 0});
  refined.lines() = mesh.lines();
  refined.setLayout(mesh.layout()->refined(std::vector<Index>{0, 0, 1, 2, 2}, 4));
  EXPECT_EQ(
      meshBytes(refined, Format::Obj),
      "v 0 0 0\nv 1 0 0\ng a\nf 1 4 3\nf 4 2 3\nv 0 1 0\nv 0.5 0 0\ng b\nusemtl m\nf 1 2 3\nf 3 2 4\nf 3 4 1\nl 1 2\n");
}

TEST(Obj, MaterialLibrariesStayValidInAnotherFolder) {
  const Folder folder;
  folder.put("in/a.mtl", "");
  folder.put("in/two words.mtl", "");
  const std::string points = "v 0 0 0\n";
  folder.put("in/t.obj", "mtllib a.mtl\nmtllib two words.mtl\nmtllib a.mtl missing.mtl\nmtllib /abs.mtl\n" + points);
  const Mesh mesh = readMesh(folder / "in/t.obj");
  (void)writeMesh(mesh, folder / "out/deep/t.obj");
  EXPECT_EQ(
      folder.get("out/deep/t.obj"),
      "mtllib ../../in/a.mtl\nmtllib ../../in/two words.mtl\nmtllib ../../in/a.mtl missing.mtl\nmtllib /abs.mtl\n" +
          points);
  (void)writeMesh(mesh, folder / "in/u.obj");
  EXPECT_EQ(folder.get("in/u.obj"), folder.get("in/t.obj"));
}

// Found by fuzzing: a name on a second line was never passed.
TEST(Obj, MaterialLibrariesMayGoOnOnTheNextLine) {
  const std::string file = "mtllib a.mtl\\\n b.mtl \\\r\nc.mtl\nv 0 0 0\n";
  EXPECT_EQ(roundTrip(file, "t.obj"), file);
}

TEST(Obj, WritingOverTheInputIsSafeAndAFailedWriteLeavesNothing) {
  const Folder folder;
  folder.put("in/t.obj", kScene);
  (void)writeMesh(readMesh(folder / "in/t.obj"), folder / "in/t.obj");
  EXPECT_EQ(folder.get("in/t.obj"), kScene);
  Mesh broken = readMesh(folder / "in/t.obj");
  broken.attributes().push_back({"short", Element::Vertex, 1, {}, std::vector<float>{1}, {}, {}});
  EXPECT_THROW((void)writeMesh(broken, folder / "out/t.obj"), std::invalid_argument);
  EXPECT_THROW((void)writeMesh(broken, folder / "out/t.unknown"), std::invalid_argument);
  EXPECT_TRUE(std::filesystem::is_empty(folder / "out/deep"));
  EXPECT_FALSE(std::filesystem::exists(folder / "out/t.obj"));
  EXPECT_THROW((void)readMesh(folder / "in"), IoError);
  EXPECT_THROW((void)readMesh(folder / "in/missing.ply"), IoError);
}

TEST(Convert, ObjToPlyKeepsSeamsAndSaysWhatItDrops) {
  const Mesh mesh = parse(kScene, "t.obj");
  WriteReport report;
  const std::string ply = meshBytes(mesh, Format::Ply, {}, &report);
  const Mesh again = parse(ply, "t.ply");
  EXPECT_EQ(again.positions(), mesh.positions());
  EXPECT_EQ(again.corners(), mesh.corners());
  EXPECT_EQ(again.offsets(), mesh.offsets());
  EXPECT_EQ(report.dropped,
            (std::vector<std::string>{"2 comments", "5 group statements (o, g, s)", "2 material statements",
                                      "2 other statements", "2 polylines", "3 loose points"}));
}

TEST(Convert, PlyToObjAndBackKeepsColoursNormalsAndTexture) {
  const std::string file =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float "
      "nx\nproperty float ny\nproperty float nz\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float s\nproperty float t\nproperty "
      "float mass\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
      "0.1 0 0 0 0 1 255 0 51 0 0.5 9\n1 0 0 0 0 1 0 0 0 1 0.5 9\n0 1 0 0 0 1 0 0 0 1 1 9\n3 0 1 2\n";
  const Mesh mesh = parse(file, "t.ply");
  WriteReport report;
  const std::string obj = meshBytes(mesh, Format::Obj, {}, &report);
  EXPECT_EQ(obj,
            "v 0.1 0 0 1 0 0.2\nv 1 0 0 0 0 0\nv 0 1 0 0 0 0\nvt 0 0.5\nvt 1 0.5\nvt 1 1\nvn 0 0 1\nvn 0 0 1\nvn 0 0 "
            "1\nf 1/1/1 2/2/2 3/3/3\n");
  EXPECT_EQ(report.dropped, (std::vector<std::string>{"1 attribute: mass"}));
  const Mesh back = parse(meshBytes(parse(obj, "t.obj"), Format::Ply), "t.ply");
  ASSERT_TRUE(back.find(Element::Vertex, "uv"));
  EXPECT_EQ(back.find(Element::Vertex, "uv")->get(1, 0), 1);
  EXPECT_TRUE(back.find(Element::Vertex, "normal"));
}

}  // namespace
}  // namespace fielddeform::mesh
