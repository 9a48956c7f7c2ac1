#include <fielddeform/core/angle.h>
#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/error.h>
#include <fielddeform/core/random.h>
#include <fielddeform/skeleton/io.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>

namespace fielddeform::skeleton {
namespace {

Skeleton parse(std::string text) { return parseSkeleton(std::move(text), "s"); }

std::string messageOf(const std::string& text) {
  try {
    parse(text);
  } catch (const IoError& e) {
    return e.what();
  }
  return "accepted";
}

void expectContains(const std::string& text, const std::string& part) {
  EXPECT_NE(messageOf(text).find(part), std::string::npos) << messageOf(text) << "\n  lacks: " << part;
}

std::string inFile(const std::string& primitive) {
  std::string text = R"({"format": "fielddeform-skeleton", "version": 1, "primitives": [)";
  return text.append("\n").append(primitive).append("]}");
}

void expectSame(const Skeleton& a, const Skeleton& b) {
  ASSERT_EQ(a.primitives.size(), b.primitives.size());
  for (std::size_t i = 0; i < a.primitives.size(); ++i) {
    const Primitive &p = a.primitives[i], &q = b.primitives[i];
    EXPECT_EQ(p.name, q.name);
    EXPECT_EQ(p.type, q.type);
    EXPECT_EQ(p.closed, q.closed);
    EXPECT_EQ(p.points, q.points);
    EXPECT_EQ(p.faces, q.faces);
    EXPECT_EQ(p.radius, q.radius);
    EXPECT_EQ(p.pointRadius, q.pointRadius);
    EXPECT_EQ(p.roll, q.roll);
    EXPECT_EQ(p.weight, q.weight);
    EXPECT_EQ(p.potential, q.potential);
    ASSERT_EQ(p.rotation.has_value(), q.rotation.has_value());
    if (p.rotation) {
      EXPECT_EQ(p.rotation->coeffs(), q.rotation->coeffs());
    }
  }
  EXPECT_EQ(a.extras, b.extras);
}

const char* const kExample = R"({"format": "fielddeform-skeleton", "version": 1, "primitives": [
  {"name": "spine", "type": "polyline", "closed": false, "points": [[0,0,0],[0,1,0]], "radius": 0.5, "point_radius": [0.5,0.4], "roll_deg": [0,90], "weight": 1.0, "potential": "exponential"},
  {"name": "tip", "type": "points", "points": [[0,2,0]], "radius": 0.3, "rotation": [1,0,0,0]},
  {"name": "shell", "type": "mesh", "closed": true, "points": [[0,0,0],[1,0,0],[0,1,0],[0,0,1]],
   "faces": [[0,2,1],[0,1,3],[1,2,3],[0,3,2]], "radius": 0.2}], "extras": {"by": ["someone", 1.50, {"any": null}]}})";

TEST(SkeletonJson, ReadsTheDocumentedExample) {
  const Skeleton s = parse(kExample);
  ASSERT_EQ(s.primitives.size(), 3u);
  EXPECT_EQ(s.primitives[0].roll[1], kPi / 2);
  EXPECT_EQ(s.primitives[0].potential, Potential::Exponential);
  EXPECT_EQ(s.primitives[1].rotation->w(), 1);
  EXPECT_TRUE(s.primitives[2].closed);
  EXPECT_EQ(s.primitives[2].faces[3], (std::vector<Index>{0, 3, 2}));
  EXPECT_EQ(s.extras, R"({"by": ["someone", 1.50, {"any": null}]})");
  EXPECT_NO_THROW(validate(s));
}

TEST(SkeletonJson, WritingAndReadingKeepsEveryBit) {
  Skeleton s = parse(kExample);
  Primitive& p = s.primitives[0];
  p.points.clear(), p.pointRadius.clear(), p.roll.clear();
  for (std::uint64_t i = 0; i < 500; ++i) {
    p.points.push_back(Vec3(uniform01(1, i), 1e-300 * uniform01(2, i), -1e8 * uniform01(3, i)));
    p.pointRadius.push_back(1e-9 + uniform01(4, i));
    p.roll.push_back(radiansFromDegrees(720 * uniform01(5, i) - 360));
  }
  p.points[7] = Vec3(-0.0, 1, 2);
  s.primitives[1].rotation = Quat(0.3, -0.4, 0.5, 0.2).normalized();
  s.primitives[1].weight = 0.1;
  s.primitives[2].name = "sch\u00e4del \"1\"\n";
  const std::string text = formatSkeleton(s, FileFormat::Json);
  const Skeleton back = parse(text);
  expectSame(s, back);
  EXPECT_TRUE(std::signbit(back.primitives[0].points[7].x()));
  EXPECT_EQ(formatSkeleton(back, FileFormat::Json), text);
}

TEST(SkeletonJson, MistakesGetPointerLineAndSuggestion) {
  expectContains(inFile(R"({"name": "a", "type": "polyline", "points": [[0,0,0],[1,1,1]], "raduis": 1})"),
                 "s:2: /primitives/0/raduis: unknown key, expected");
  expectContains(inFile(R"({"name": "a", "type": "polyline", "points": [[0,0,0],[1,1,1]], "raduis": 1})"), "did you mean \"radius\"?");
  expectContains(inFile(R"({"name": "a", "type": "polylin", "points": [[0,0,0],[1,1,1]]})"), "did you mean \"polyline\"?");
  expectContains(inFile("{\"name\": \"a\", \"type\": \"polyline\", \"points\": [[0,0,0],\n[1,1]]}"), "s:3: /primitives/0/points/1: [1,1], expected three numbers");
  expectContains(inFile(R"({"name": "a", "type": "polyline", "points": [[0,0,0]]})"), "/primitives/0/points: 1 points, expected at least 2");
  expectContains(inFile(R"({"name": "a", "type": "polyline", "closed": true, "points": [[0,0,0],[0,0,1]]})"), "at least 3");
  expectContains(inFile(R"({"name": "a", "type": "polyline", "points": [[0,0,0],[1,1,1]], "radius": 0})"), "/primitives/0/radius: 0, expected a number > 0");
  expectContains(inFile(R"({"name": "a", "type": "polyline", "points": [[0,0,0],[1,1,1]], "point_radius": [1]})"), "point_radius: 1 elements, expected 2");
  expectContains(inFile(R"({"name": "a", "type": "polyline", "points": [[0,0,0],[1,1,1]], "roll_deg": [1,2,3]})"), "roll_deg: 3 elements, expected 2");
  expectContains(inFile(R"({"name": "a", "type": "polyline", "points": [[0,0,0],[1,1,1]], "weight": -1})"), "weight");
  expectContains(inFile(R"({"name": "a", "type": "polyline", "points": [[0,0,0],[1,1,1]], "rotation": [1,0,0,0]})"), "only points");
  expectContains(inFile(R"({"name": "a", "type": "points", "points": [[0,0,0]], "rotation": [1,1,0,0]})"), "length 1.414");
  expectContains(inFile(R"({"name": "a", "type": "points", "points": [[0,0,0]], "closed": true})"), "points cannot be closed");
  expectContains(inFile(R"({"name": "a", "type": "points", "points": [[0,0,0]], "roll_deg": [1]})"), "only a polyline");
  expectContains(inFile(R"({"name": "a", "type": "points", "points": [[0,0,0]], "faces": [[0,0,0]]})"), "only a mesh");
  expectContains(inFile(R"({"name": "a", "type": "mesh", "points": [[0,0,0],[1,0,0],[0,1,0]], "faces": [[0,1,3]]})"), "/primitives/0/faces/0/2: 3, expected a whole number from 0 to 2");
  expectContains(inFile(R"({"name": "a", "type": "mesh", "points": [[0,0,0],[1,0,0],[0,1,0]], "faces": [[0,1]]})"), "/faces/0: 2 corners");
  expectContains(inFile(R"({"name": "a", "type": "mesh", "points": [[0,0,0],[1,0,0],[0,1,0]]})"), "no key \"faces\"");
  expectContains(inFile(R"({"name": "", "type": "points", "points": [[0,0,0]]})"), "/primitives/0/name");
  expectContains(inFile(R"({"name": "a", "type": "points", "points": [[0,0,0]]}, {"name": "a", "type": "points", "points": [[0,0,0]]})"), "/primitives/1/name");
  expectContains(inFile(""), "no primitives");
  expectContains(R"({"format": "fielddeform-scene", "version": 1, "primitives": []})", "/format");
  expectContains(R"({"format": "fielddeform-skeleton", "version": 2, "primitives": []})", "newer program");
  expectContains(R"({"format": "fielddeform-skeleton", "version": 1, "primitives": [], "primitives": []})", "second time");
  expectContains(R"({"format": "fielddeform-skeleton", "version": 1,})", "s:1:");
  expectContains(R"({"format": "fielddeform-skeleton", "version": 1, "primitives": [], "extra": {}})", "did you mean \"extras\"?");
  expectContains("", "is empty");
}

TEST(SkeletonJson, ExtrasMustBeAnObject) {
  Skeleton s = parse(kExample);
  for (const char* bad : {"[1]", "{", "{\"a\": 1} x", "3"}) {
    s.extras = bad;
    EXPECT_THROW(formatSkeleton(s, FileFormat::Json), std::invalid_argument) << bad;
  }
}

TEST(SkeletonObj, ObjectsBecomePrimitives) {
  const Skeleton s = parse(
      "# drawn\nmtllib a.mtl\no my spine\nv 0 0 0\nv 0 0 1 1.0\nv +0 1e0 2\nl 1 2 3\no tips\r\nv 5 5 5\r\nv 6 6 6\r\np 5 4\r\n"
      "o ring\nv 0 0 0\nv 1 0 0\nv 0 1 0\nl -3 -2 -1 -3\no solid\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\ns off\n"
      "f 9/1 11 10\nf 9 10 12\nf 10//1 11 \\\n12/1/1\nf 9 12 11\no sheet\nv 9 9 9\nf 9 10 13\n");
  ASSERT_EQ(s.primitives.size(), 5u);
  EXPECT_EQ(s.primitives[0].name, "my spine");
  EXPECT_EQ(s.primitives[0].type, PrimitiveType::Polyline);
  EXPECT_FALSE(s.primitives[0].closed);
  EXPECT_EQ(s.primitives[0].points, (std::vector<Vec3>{{0, 0, 0}, {0, 0, 1}, {0, 1, 2}}));
  EXPECT_EQ(s.primitives[1].type, PrimitiveType::Points);
  EXPECT_EQ(s.primitives[1].points, (std::vector<Vec3>{{6, 6, 6}, {5, 5, 5}}));
  EXPECT_TRUE(s.primitives[2].closed);
  EXPECT_EQ(s.primitives[2].points.size(), 3u);
  EXPECT_EQ(s.primitives[3].type, PrimitiveType::Mesh);
  EXPECT_TRUE(s.primitives[3].closed);
  EXPECT_EQ(s.primitives[3].faces[2], (std::vector<Index>{1, 2, 3}));
  // Vertices of another object are copied.
  EXPECT_FALSE(s.primitives[4].closed);
  EXPECT_EQ(s.primitives[4].points, (std::vector<Vec3>{{0, 0, 0}, {1, 0, 0}, {9, 9, 9}}));
}

TEST(SkeletonObj, EdgesChainInAnyOrder) {
  const std::string vertices = "o a\nv 0 0 0\nv 1 0 0\nv 2 0 0\nv 3 0 0\n";
  const auto xs = [&](const std::string& lines) {
    std::string all;
    for (const Primitive& p : parse(vertices + lines).primitives) {
      all.append(p.name).append(p.closed ? "o" : "");
      for (const Vec3& x : p.points) all.append(1, ' ').append(std::to_string(static_cast<int>(x.x())));
      all += ';';
    }
    return all;
  };
  EXPECT_EQ(xs("l 1 2\nl 2 3\nl 3 4\n"), "a 0 1 2 3;");
  EXPECT_EQ(xs("l 4 3\nl 1 2\nl 3 2\n"), "a 0 1 2 3;");
  EXPECT_EQ(xs("l 1 2 3\nl 3 4\n"), "a 0 1 2 3;");
  EXPECT_EQ(xs("l 4 3 2 1\n"), "a 3 2 1 0;");
  EXPECT_EQ(xs("l 2 1\nl 3 4\n"), "a 1 0;a.2 2 3;");
  EXPECT_EQ(xs("l 3 4\nl 4 1\nl 1 3\n"), "ao 0 2 3;");
  EXPECT_EQ(xs("l 3 1 4 3\n"), "ao 2 0 3;");
}

TEST(SkeletonObj, VerticesAloneArePoints) {
  EXPECT_EQ(parse("o a\nv 1 2 3\nv 4 5 6\n").primitives[0].points.size(), 2u);
  EXPECT_EQ(parse("v 1 2 3\n").primitives[0].type, PrimitiveType::Points);
  // Vertices listed before the objects that use them are no object of their own.
  EXPECT_EQ(parse("v 1 2 3\nv 4 5 6\no a\nl 1 2\n").primitives.size(), 1u);
}

TEST(SkeletonObj, MistakesNameTheLine) {
  expectContains("o a\nv 0 0 0\nv 0 0 1\nl 1 3\n", "s:4: vertex index \"3\"");
  expectContains("o a\nv 0 0 0\nl 1 0\n", "s:3: vertex index \"0\"");
  expectContains("o a\nv 0 0 0\nl 1 -2\n", "vertex index \"-2\"");
  expectContains("o a\nv 0 0\n", "s:2: vertex with 2 coordinates");
  expectContains("o a\nv 0 0 nan\n", "coordinate \"nan\"");
  expectContains("o a\nv 0 0 1e999\n", "coordinate");
  expectContains("o a\nv 0 0 1x\n", "coordinate");
  expectContains("o a\nv 0 0 0\nv 1 0 0\nl 1\n", "s:4: \"l\" with 1 vertices");
  expectContains("o a\nv 0 0 0\nv 1 0 0\nv 2 0 0\nl 1 2 3\np 1\n", "s:6: object \"a\": a \"p\" after a \"l\"");
  expectContains("o a\nv 0 0 0\nv 1 0 0\nv 2 0 0\nv 3 0 0\nl 1 2\nl 1 3\nl 1 4\n", "s:8: object \"a\": vertex 1 joins 3 lines");
  expectContains("o a\nv 0 0 0\nv 1 0 0\nl 1 1\n", "to itself");
  expectContains("o a\nv 0 0 0\nv 1 0 0\nl 1 2 1\n", "second time");
  expectContains("o a\nv 0 0 0\np 1 1\n", "second time");
  expectContains("o a\no b\nv 0 0 0\np 1\n", "s:1: object \"a\": no vertices");
  expectContains("o a\nv 0 0 0\no b\np 1\n", "its vertices belong to another object");
  expectContains("o a\nv 0 0 0\np 1\no a\nv 0 0 0\np 2\n", "s:4: object name \"a\" a second time");
  expectContains("o\nv 0 0 0\np 1\n", "object without a name");
  expectContains("o a\nv 0 0 0\nf 1 1 1\n", "less than 3 vertices");
  expectContains("ply\nformat ascii 1.0\n", "s:1: statement \"ply\"");
  expectContains("# nothing\n", "no points, lines or faces");
}

TEST(SkeletonObj, WritingAndReadingKeepsShapes) {
  Skeleton s = parse(kExample);
  for (Primitive& p : s.primitives) {
    p.radius.reset(), p.potential.reset(), p.rotation.reset(), p.pointRadius.clear(), p.roll.clear();
    for (std::size_t i = 0; i < p.points.size(); ++i) p.points[i] += Vec3(uniform01(1, i), 1e-20, 0.1);
  }
  s.extras.clear();
  Primitive ring = s.primitives[2];
  ring.name = "ring";
  ring.type = PrimitiveType::Polyline;
  ring.faces.clear();
  s.primitives.push_back(ring);
  expectSame(s, parse(formatSkeleton(s, FileFormat::Obj)));
}

TEST(SkeletonFiles, ExtensionDecidesOnWritingContentOnReading) {
  const Skeleton s = parse(kExample);
  const auto folder = std::filesystem::temp_directory_path() / "fielddeform_skeleton_io";
  std::filesystem::create_directories(folder);
  writeSkeleton(s, folder / "a.json");
  expectSame(readSkeleton(folder / "a.json"), s);
  writeSkeleton(s, folder / "a.OBJ");
  EXPECT_TRUE(readTextFile(folder / "a.OBJ").starts_with("#"));
  EXPECT_EQ(readSkeleton(folder / "a.OBJ").primitives.size(), 3u);
  EXPECT_THROW(readSkeleton(folder / "absent.json"), IoError);
  EXPECT_THROW(readSkeleton(folder), IoError);
  std::filesystem::remove_all(folder);
}

TEST(SkeletonFiles, EveryPrefixIsRefusedOrValid) {
  for (const FileFormat format : {FileFormat::Json, FileFormat::Obj}) {
    const std::string text = formatSkeleton(parse(kExample), format);
    for (std::size_t n = 0; n < text.size(); ++n) {
      try {
        validate(parse(text.substr(0, n)));
      } catch (const IoError&) {
      }
    }
  }
}

TEST(SkeletonFiles, ClosedMeshIsTwoOppositeFacesAnEdge) {
  using Faces = std::vector<std::vector<Index>>;
  EXPECT_TRUE(boundsSolid(Faces{{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}}));
  EXPECT_FALSE(boundsSolid(Faces{{0, 1, 2}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}}));  // one face turned
  EXPECT_FALSE(boundsSolid(Faces{{0, 2, 1}, {0, 1, 3}, {1, 2, 3}}));
  EXPECT_FALSE(boundsSolid(Faces{{0, 0, 1}, {1, 0, 0}}));
  EXPECT_FALSE(boundsSolid(Faces{}));
}

TEST(Angle, DegreesReadBackAndRoundNumbersStay) {
  for (const double d : {0.0, 1.0, 30.0, 45.0, 90.0, -180.0, 270.0, 12.5, 0.1, 720.0}) EXPECT_EQ(degreesFromRadians(radiansFromDegrees(d)), d);
  for (std::uint64_t i = 0; i < 2000; ++i) {
    const double d = 1000 * (uniform01(9, i) - 0.5), r = radiansFromDegrees(d);
    EXPECT_EQ(radiansFromDegrees(degreesFromRadians(r)), r);
  }
}

TEST(SkeletonObjNames, ThatAreNotUtf8AreRefused) {
  // Found by fuzzing: written as JSON, two such names became the same one.
  EXPECT_THROW(parseSkeleton("o ti\xB9\xBB\nv 0 0 0\nv 1 0 0\nl 1 2\n", "a.obj"), IoError);
  EXPECT_EQ(parseSkeleton("o \xC3\xA9paule\nv 0 0 0\nv 1 0 0\nl 1 2\n", "a.obj").primitives[0].name, "\xC3\xA9paule");
}

}  // namespace
}  // namespace fielddeform::skeleton
