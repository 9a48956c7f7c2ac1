#include <bit>
#include <cmath>
#include <limits>

#include "io_support.h"

namespace fielddeform::mesh {
namespace {

const std::string kAsciiTetrahedron =
    "ply\nformat ascii 1.0\ncomment made by hand\nobj_info scale 1\nelement vertex 4\nproperty float x\n"
    "property float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
    "property int16 label\nelement face 4\ncomment in between\nproperty list uchar int vertex_indices\n"
    "property float quality\nend_header\n"
    "0 0 0 255 0 0 -3\n1 0 0 0 255 0 4\n0 1 0 0 0 255 5\n0 0 0.1 1 2 3 6\n"
    "3 0 2 1 0.5\n3 0 1 3 1\n3 1 2 3 1e-10\n3 2 0 3 2\n";

// A file with every kind of property, in either byte order.
std::string binarySample(bool big) {
  std::string s =
      "ply\nformat binary_" + std::string(big ? "big" : "little") +
      "_endian 1.0\ncomment   spaces  kept \nelement vertex 3\nproperty double x\nproperty uint8 flag\n"
      "property double y\nproperty double z\nproperty float32 nx\nproperty float32 ny\nproperty float32 nz\n"
      "property list uchar short history\nelement camera 2\nproperty float fov\nproperty list uchar uint ids\n"
      "element face 2\nproperty int material\nproperty list ushort uint vertex_index\nend_header\n";
  for (int v = 0; v < 3; ++v) {
    s += bytesOf(v * 1.1, big) + bytesOf(std::uint8_t(200 + v), big) + bytesOf(v * v * 0.7, big) + bytesOf(-2.5, big);
    for (int k = 0; k < 3; ++k) s += bytesOf(k == 2 ? 1.0f : 0.0f, big);
    s += bytesOf(std::uint8_t(v), big);
    for (int k = 0; k < v; ++k) s += bytesOf(std::int16_t(-k - 1), big);
  }
  for (int c = 0; c < 2; ++c) s += bytesOf(0.5f, big) + bytesOf(std::uint8_t(1), big) + bytesOf(77u, big);
  for (int f = 0; f < 2; ++f) {
    s += bytesOf(9 - f, big) + bytesOf(std::uint16_t(3 + f), big);
    for (int k = 0; k < 3 + f; ++k) s += bytesOf(std::uint32_t((k + f) % 3), big);
  }
  return s;
}

TEST(Ply, AsciiComesBackByteForByte) { EXPECT_EQ(roundTrip(kAsciiTetrahedron, "t.ply"), kAsciiTetrahedron); }

TEST(Ply, AsciiGivesTypedAttributesUnderTheirNames) {
  ReadReport report;
  const Mesh mesh = parse(kAsciiTetrahedron, "t.ply", {}, &report);
  EXPECT_EQ(report.encoding, "ascii");
  EXPECT_EQ(mesh.vertexCount(), 4u);
  EXPECT_EQ(mesh.faceCount(), 4u);
  EXPECT_TRUE(mesh.allTriangles());
  EXPECT_EQ(mesh.positions()[3], Vec3(0, 0, 0.1));  // all digits, although "float"
  EXPECT_EQ(mesh.positionType(), ScalarType::Float32);
  const Attribute* color = mesh.find(Element::Vertex, "color");
  ASSERT_TRUE(color);
  EXPECT_EQ(color->width, 3);
  EXPECT_EQ(color->type(), ScalarType::UInt8);
  EXPECT_EQ(color->get(2, 2), 255);
  EXPECT_EQ(mesh.find(Element::Vertex, "label")->get(0), -3);
  EXPECT_EQ(mesh.find(Element::Vertex, "label")->onSplit, Interpolation::Nearest);
  EXPECT_EQ(mesh.find(Element::Face, "quality")->get(2), 1e-10f);
}

TEST(Ply, BothEndiansComeBackByteForByteWithUnknownElementsAndLists) {
  for (const bool big : {false, true}) {
    const std::string file = binarySample(big);
    const Mesh mesh = parse(file, "t.ply");
    EXPECT_EQ(mesh.positions()[2], Vec3(2.2, 2.8, -2.5));
    EXPECT_EQ(mesh.find(Element::Vertex, "flag")->get(1), 201);
    EXPECT_EQ(mesh.find(Element::Vertex, "normal")->onSplit, Interpolation::Direction);
    const Attribute* history = mesh.find(Element::Vertex, "history");
    EXPECT_EQ(history->listOffsets, (std::vector<Index>{0, 0, 1, 3}));
    EXPECT_EQ(history->get(2), -2);
    EXPECT_EQ(mesh.face(1).size(), 4u);
    EXPECT_EQ(mesh.find(Element::Face, "material")->get(1), 8);
    EXPECT_EQ(roundTrip(file, "t.ply"), file);
  }
  expectSame(parse(binarySample(false), "t.ply"), parse(binarySample(true), "t.ply"));
}

TEST(Ply, EveryScalarTypeNameIsRead) {
  const char* names[][2] = {{"char", "int8"}, {"uchar", "uint8"}, {"short", "int16"},   {"ushort", "uint16"},
                            {"int", "int32"}, {"uint", "uint32"}, {"float", "float32"}, {"double", "float64"}};
  for (int t = 0; t < 8; ++t)
    for (const char* name : names[t]) {
      const std::string file = "ply\nformat ascii 1.0\nelement vertex 1\nproperty " + std::string(name) +
                               " x\nproperty " + name + " y\nproperty " + name + " z\nproperty " + name +
                               " extra\nend_header\n1 2 3 100\n";
      const Mesh mesh = parse(file, "t.ply");
      EXPECT_EQ(mesh.positions()[0], Vec3(1, 2, 3));
      EXPECT_EQ(mesh.find(Element::Vertex, "extra")->type(), static_cast<ScalarType>(t));
      EXPECT_EQ(roundTrip(file, "t.ply"), file);
    }
}

std::string stripFile(const std::string& strips, const std::string& count = "1") {
  return "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
         "element tristrips " +
         count +
         "\nproperty list int int vertex_indices\nend_header\n"
         "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n1 2 0\n" +
         strips + "\n";
}

TEST(Ply, StripsTurnEveryOtherTriangleAndRestartAtMinusOne) {
  const Mesh mesh = parse(stripFile("9 0 1 2 3 -1 2 3 4 5"), "t.ply");
  ASSERT_EQ(mesh.faceCount(), 4u);
  // All face up: a strip's triangles keep one orientation.
  for (std::size_t f = 0; f < 4; ++f) {
    const auto c = mesh.face(f);
    const Vec3 a = mesh.positions()[c[0]], b = mesh.positions()[c[1]], d = mesh.positions()[c[2]];
    EXPECT_GT((b - a).cross(d - a).z(), 0) << f;
  }
  EXPECT_EQ(std::vector<Index>(mesh.face(2).begin(), mesh.face(2).end()), (std::vector<Index>{2, 3, 4}));
}

TEST(Ply, StripsComeBackUnlessTheFacesChanged) {
  const std::string file = stripFile("9 0 1 2 3 -1 2 3 4 5");
  EXPECT_EQ(roundTrip(file, "t.ply"), file);
  const Mesh mesh = parse(file, "t.ply");
  Mesh fewer(mesh.positions(), {0, 1, 2});
  fewer.setPositionType(mesh.positionType());
  fewer.setLayout(mesh.layout());
  const std::string written = meshBytes(fewer, Format::Ply);
  EXPECT_EQ(written.find("tristrips"), std::string::npos);
  EXPECT_NE(written.find("element face 1\nproperty list uchar int vertex_indices\nend_header\n"), std::string::npos);
  EXPECT_EQ(parse(written, "t.ply").corners(), fewer.corners());
}

TEST(Ply, FacesMayComeBeforeVertices) {
  const std::string file =
      "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_indices\nelement vertex 3\n"
      "property float x\nproperty float y\nproperty float z\nend_header\n3 0 1 2\n0 0 0\n1 0 0\n0 1 0\n";
  EXPECT_EQ(parse(file, "t.ply").faceCount(), 1u);
  EXPECT_EQ(roundTrip(file, "t.ply"), file);
}

TEST(Ply, PointCloudsAndEmptyMeshesAreMeshes) {
  const std::string points =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 "
      "3\n";
  EXPECT_EQ(roundTrip(points, "t.ply"), points);
  const std::string none =
      "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
  EXPECT_EQ(parse(none, "t.ply").vertexCount(), 0u);
  EXPECT_EQ(roundTrip(none, "t.ply"), none);
}

TEST(Ply, DefectsAreKeptAndCounted) {
  const std::string file =
      "ply\nformat ascii 1.0\nelement vertex 5\nproperty double x\nproperty double y\nproperty double z\nelement face "
      "5\n"
      "property list uchar int vertex_indices\nend_header\n0 0 0\n0 0 0\n1 0 0\n0 1 0\n9 9 9\n"
      "3 0 2 3\n3 0 2 3\n3 2 2 3\n2 0 1\n1 3\n";
  ReadReport report;
  const Mesh mesh = parse(file, "t.ply", {}, &report);
  EXPECT_EQ(mesh.vertexCount(), 5u);
  EXPECT_EQ(mesh.faceCount(), 5u);
  EXPECT_EQ(report.repeatedCorners, 1u);
  EXPECT_EQ(report.shortFaces, 2u);
  EXPECT_EQ(roundTrip(file, "t.ply"), file);
}

TEST(Ply, CornerTextureCoordinatesAreLiftedFromTexcoordLists) {
  const std::string file =
      "ply\nformat ascii 1.0\ncomment TextureFile skin.png\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nelement face 1\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\n"
      "property int texnumber\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 0.5 0 0 0.25 0\n";
  const Mesh mesh = parse(file, "t.ply");
  const Attribute* uv = mesh.find(Element::Corner, "uv");
  ASSERT_TRUE(uv);
  EXPECT_EQ(uv->width, 2);
  EXPECT_EQ(uv->get(2, 1), 0.25);
  EXPECT_EQ(roundTrip(file, "t.ply"), file);
}

TEST(Ply, TextureFilesStayValidInAnotherFolder) {
  const Folder folder;
  const auto file = [](const std::string& texture) {
    return "ply\nformat ascii 1.0\ncomment TextureFile " + texture +
           "\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n";
  };
  folder.put("in/my skin.png", "");
  folder.put("in/t.ply", file("my skin.png"));
  (void)writeMesh(readMesh(folder / "in/t.ply"), folder / "out/deep/t.ply");
  EXPECT_EQ(folder.get("out/deep/t.ply"), file("../../in/my skin.png"));
}

TEST(Ply, NonFiniteVerticesAreRefusedByNameOrKeptBitForBit) {
  std::string file =
      "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
      "z\nend_header\n";
  const std::size_t header = file.size();
  for (int i = 0; i < 9; ++i) file += bytesOf(static_cast<float>(i));
  const std::uint32_t signalling = 0xFFA12345u;  // a payload that conversions in hardware would change
  std::memcpy(file.data() + header + 4 * 4, &signalling, 4);
  const std::string error = errorOf(file, "t.ply");
  EXPECT_NE(error.find("vertex 1"), std::string::npos) << error;
  EXPECT_NE(error.find("byte " + std::to_string(header + 12)), std::string::npos) << error;
  ReadReport report;
  const Mesh mesh = parse(file, "t.ply", {InvalidPoints::Keep, {}}, &report);
  EXPECT_EQ(report.invalidPoints, 1u);
  EXPECT_EQ(meshBytes(mesh, Format::Ply), file);
}

TEST(Ply, NonFiniteTextIsRecognised) {
  for (const char* word : {"nan", "inf", "-inf", "1e999"}) {
    const std::string file = std::string(
                                 "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float "
                                 "y\nproperty float z\nend_header\n0 ") +
                             word + " 0\n";
    EXPECT_NE(errorOf(file, "t.ply").find("t.ply:8: vertex 0"), std::string::npos) << errorOf(file, "t.ply");
  }
}

TEST(Ply, BytesAfterTheLastElementOfABinaryFileAreKeptAndCounted) {
  const std::string file = binarySample(false) + "\n\nsignature";
  ReadReport report;
  (void)parse(file, "t.ply", {}, &report);
  EXPECT_EQ(report.trailingBytes, 11u);
  EXPECT_EQ(roundTrip(file, "t.ply"), file);
}

TEST(Ply, EveryPrefixOfAFileIsRefused) {
  for (const std::string& file : {kAsciiTetrahedron, binarySample(false), binarySample(true)})
    for (std::size_t n = 0; n + 1 < file.size(); ++n)  // without its last line end a text file is whole
      EXPECT_THROW((void)parse(file.substr(0, n), "t.ply"), IoError) << n;
}

TEST(Ply, LyingHeadersAreRefusedBeforeMemoryIsTaken) {
  const auto header = [](const std::string& vertices, const std::string& faces) {
    return "ply\nformat binary_little_endian 1.0\nelement vertex " + vertices +
           "\nproperty float x\nproperty float y\nproperty float z\nelement face " + faces +
           "\nproperty list uchar int vertex_indices\nend_header\n" + std::string(64, '\0');
  };
  for (const char* count :
       {"1000", "2000000000", "4294967295", "99999999999999999", "99999999999999999999", "-1", "3.5", "x", ""}) {
    EXPECT_NE(errorOf(header(count, "0"), "t.ply").find("element vertex"), std::string::npos) << count;
    EXPECT_NE(errorOf(header("1", count), "t.ply").find("element face"), std::string::npos) << count;
  }
}

TEST(Ply, ErrorsNameLineElementFoundAndExpected) {
  const std::string start =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face "
      "1\nproperty list uchar int vertex_indices\nend_header\n";
  const std::string vertices = "0 0 0\n1 0 0\n0 1 0\n";
  EXPECT_EQ(errorOf(start + vertices + "3 0 1 3\n", "t.ply"),
            "t.ply:13: face 0, property vertex_indices: vertex 3, expected less than 3");
  EXPECT_EQ(errorOf(start + vertices + "3 0 1 -1\n", "t.ply"),
            "t.ply:13: face 0, property vertex_indices: vertex -1, expected less than 3");
  EXPECT_EQ(errorOf(start + "0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "t.ply"),
            "t.ply:10: vertex 0, property z: end of line, expected a number");
  EXPECT_EQ(errorOf(start + "0 0 0 7\n1 0 0\n0 1 0\n3 0 1 2\n", "t.ply"),
            "t.ply:10: vertex 0: '7', expected end of line");
  EXPECT_EQ(errorOf(start + "0 0 0x\n1 0 0\n0 1 0\n3 0 1 2\n", "t.ply"),
            "t.ply:10: vertex 0, property z: '0x', expected a number");
  EXPECT_EQ(errorOf(start + vertices + "0\n       ", "t.ply"),
            "t.ply:13: face 0, property vertex_indices: a face without corners, expected at least one");
  EXPECT_EQ(errorOf(start + vertices + "3 0 1 2\n3 0 1 2\n", "t.ply"),
            "t.ply:14: after the last element: '3', expected end of file");
  EXPECT_NE(errorOf("ply\nformat ascii 2.0\n", "t.ply").find("t.ply:2: format"), std::string::npos);
  EXPECT_NE(errorOf("ply\nformat ascii 1.0\nelement vertex 0\nend_header\n", "t.ply").find("no scalar property 'x'"),
            std::string::npos);
  EXPECT_NE(errorOf("ply\nformat ascii 1.0\nelement vertex 1\nelement vertex 2\n", "t.ply").find("each element once"),
            std::string::npos);
  EXPECT_NE(errorOf("", "t.ply").find("t.ply:1"), std::string::npos);
}

TEST(Ply, PrecisionDoubleWritesDoublesOfTheSameNumbers) {
  std::string file =
      "ply\nformat binary_big_endian 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float "
      "z\nend_header\n";
  for (const float x : {0.1f, 2.0f, -3.5f}) file += bytesOf(x, true);
  Mesh mesh = parse(file, "t.ply");
  mesh.mutablePositions()[0][1] = 1.0 / 3;
  const std::string written = meshBytes(mesh, Format::Ply, {Precision::Double, {}});
  EXPECT_NE(written.find("property double y"), std::string::npos);
  EXPECT_EQ(parse(written, "t.ply").positions()[0], Vec3(0.1f, 1.0 / 3, -3.5));
  // Kept as floats otherwise.
  EXPECT_EQ(parse(meshBytes(mesh, Format::Ply), "t.ply").positions()[0], Vec3(0.1f, static_cast<float>(1.0 / 3), -3.5));
}

TEST(Ply, CoordinatesThatNoLongerFitTheirTypeGetALargerOne) {
  const std::string file =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty short x\nproperty float y\nproperty double z\nend_header\n7 1 "
      "2\n";
  EXPECT_EQ(roundTrip(file, "t.ply"), file);
  Mesh mesh = parse(file, "t.ply");
  mesh.mutablePositions()[0] = Vec3(0.25, 1e300, 2);
  const std::string written = meshBytes(mesh, Format::Ply);
  EXPECT_EQ(parse(written, "t.ply").positions()[0], Vec3(0.25, 1e300, 2));
  EXPECT_NE(written.find("property double x\nproperty double y\nproperty double z"), std::string::npos);
}

TEST(Ply, TextWithMoreDigitsThanFloatKeepsThem) {
  const std::string file =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float "
      "z\nend_header\n0.12345678912 1 2\n";
  EXPECT_EQ(parse(file, "t.ply").positionType(), ScalarType::Float64);
  EXPECT_EQ(roundTrip(file, "t.ply"), file);
}

TEST(Ply, NewAttributesFollowTheOldPropertiesAndRemovedOnesGo) {
  Mesh mesh = parse(kAsciiTetrahedron, "t.ply");
  mesh.attributes().erase(mesh.attributes().begin() + 1);  // label
  mesh.attributes().push_back(
      {"status", Element::Vertex, 1, Interpolation::Nearest, std::vector<std::uint8_t>{1, 2, 3, 4}, {}, {}});
  mesh.attributes().push_back(
      {"normal", Element::Vertex, 3, Interpolation::Direction, std::vector<float>(12, 0.5f), {}, {}});
  const std::string written = meshBytes(mesh, Format::Ply);
  EXPECT_NE(written.find("property uchar blue\nproperty uchar status\nproperty float nx\nproperty float ny\nproperty "
                         "float nz\nelement face 4\ncomment in between\n"),
            std::string::npos)
      << written;
  const Mesh again = parse(written, "t.ply");
  EXPECT_EQ(again.find(Element::Vertex, "status")->get(3), 4);
  EXPECT_EQ(again.find(Element::Vertex, "label"), nullptr);
  EXPECT_EQ(again.find(Element::Vertex, "normal")->width, 3);
}

TEST(Ply, IndicesGrowWithTheMesh) {
  std::string file =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face "
      "1\nproperty list uchar char vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
  const Mesh mesh = parse(file, "t.ply");
  Mesh larger(std::vector<Vec3>(200, Vec3(1, 2, 3)), {0, 1, 199});
  larger.setPositionType(mesh.positionType());
  larger.setLayout(mesh.layout()->refined(std::vector<Index>{0}, 200));
  const Mesh again = parse(meshBytes(larger, Format::Ply), "t.ply");
  EXPECT_EQ(again.corners(), larger.corners());
}

TEST(Ply, CarriageReturnsInTheHeaderAreKept) {
  std::string file =
      "ply\r\nformat ascii 1.0\r\nelement vertex 1\r\nproperty float x\r\nproperty float y\r\nproperty float "
      "z\r\nend_header\r\n1 2 3\r\n";
  EXPECT_EQ(roundTrip(file, "t.ply"), file);
  std::string old =
      "ply\rformat binary_little_endian 1.0\relement vertex 1\rproperty uchar x\rproperty uchar y\rproperty uchar "
      "z\rend_header\r\n\r\n";
  EXPECT_EQ(parse(old, "t.ply").positions()[0],
            Vec3(10, 13, 10));  // the first byte is data although it looks like a line end
  EXPECT_EQ(roundTrip(old, "t.ply"), old);
}

TEST(Ply, IsRecognisedByContentWhateverItsName) {
  EXPECT_EQ(parse(kAsciiTetrahedron, "t.obj").faceCount(), 4u);
  EXPECT_NE(errorOf("nothing known", "t.xyz").find("neither content nor extension"), std::string::npos);
}

}  // namespace
}  // namespace fielddeform::mesh
