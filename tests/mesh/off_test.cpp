#include "io_support.h"

namespace fielddeform::mesh {
namespace {

const std::string kOff =
    "# before\nOFF\n# a square and a triangle\n5 3 6\n0 0 0\n1 0 0\n# middle\n1 1 0\n0 1 0\n0.5 0.5 1e-07\n"
    "4 0 1 2 3 255 0 0\n# faces\n3 0 1 4 0.5 0.5 0.5 1\n3 1 2 4\n# after\n";

TEST(Off, ComesBackByteForByte) {
  EXPECT_EQ(roundTrip(kOff, "t.off"), kOff);
  const Mesh mesh = parse(kOff, "t.off");
  EXPECT_EQ(mesh.vertexCount(), 5u);
  EXPECT_EQ(mesh.faceCount(), 3u);
  EXPECT_EQ(mesh.face(0).size(), 4u);
}

TEST(Off, EveryHeaderOfThreeDimensionsIsRead) {
  const std::string rest = " 1 0 0\n1 2 3";
  EXPECT_EQ(roundTrip("OFF" + rest + "\n", "t.off"), "OFF" + rest + "\n");
  EXPECT_EQ(roundTrip("1 0 0\n1 2 3\n", "t.off"), "1 0 0\n1 2 3\n");
  EXPECT_EQ(roundTrip("NOFF" + rest + " 0 0 1\n", "t.off"), "NOFF" + rest + " 0 0 1\n");
  EXPECT_EQ(roundTrip("COFF" + rest + " 255 0 7 9\n", "t.off"), "COFF" + rest + " 255 0 7 9\n");
  EXPECT_EQ(roundTrip("OFF" + rest + " 255 0 7\n", "t.off"), "OFF" + rest + " 255 0 7\n");  // colours without a C
  const std::string all = "STCNOFF" + rest + " 0 0 1 0.25 0.5 1 0.75 0\n";
  EXPECT_EQ(roundTrip(all, "t.off"), all);
  const Mesh mesh = parse(all, "t.off");
  EXPECT_EQ(mesh.find(Element::Vertex, "normal")->get(0, 2), 1);
  EXPECT_EQ(mesh.find(Element::Vertex, "color")->get(0, 1), 0.5);
  EXPECT_EQ(mesh.find(Element::Vertex, "uv")->get(0, 0), 0.75);
  EXPECT_EQ(parse("COFF\n1 0 0\n1 2 3 255 0 7\n", "t.off").find(Element::Vertex, "color")->type(), ScalarType::UInt8);
}

TEST(Off, ErrorsNameLineElementFoundAndExpected) {
  EXPECT_EQ(errorOf("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "t.off"),
            "t.off:6: face 0: vertex 3, expected less than 3");
  EXPECT_EQ(errorOf("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1\n", "t.off"),
            "t.off:6: face 0: end of line, expected 3 vertex indices");
  EXPECT_EQ(errorOf("OFF\n3 0 0\n0 0 0\n1 0\n0 1 0 \n", "t.off"), "t.off:4: vertex 1: 2 numbers, expected 3");
  EXPECT_EQ(errorOf("OFF\n1 0 0\n0 0 0\n1 0 0\n", "t.off"), "t.off:4: after the last face: '1', expected end of file");
  EXPECT_EQ(errorOf("OFF\n1 0 0\n0 0 nan\n", "t.off"),
            "t.off:3: vertex 0: a coordinate that is not finite, expected finite coordinates");
  EXPECT_EQ(errorOf("OFF BINARY\n", "t.off"),
            "t.off:1: header: 'BINARY', expected a text file (binary OFF is not supported)");
  EXPECT_EQ(errorOf("4OFF\n1 0 0\n", "t.off"), "t.off:1: header: '4OFF', expected points in three dimensions");
  EXPECT_NE(errorOf("OFF\n4000000000 0 0\n0 0 0\n", "t.off").find("t.off:2: header"), std::string::npos);
  EXPECT_NE(errorOf("OFF\n1 99999999999 0\n0 0 0\n", "t.off").find("t.off:2: header"), std::string::npos);
  EXPECT_NE(errorOf("", "t.off"), "");
  for (std::size_t n = 0; n < kOff.size() - 12; ++n) {  // the last face's last number may be cut short unseen
    EXPECT_THROW((void)parse(kOff.substr(0, n), "t.off"), IoError) << n;
  }
}

TEST(Off, ChildrenKeepTheColourOfTheirFace) {
  const Mesh mesh = parse("OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 7\n3 0 2 1 9\n", "t.off");
  Mesh refined(mesh.positions(), {0, 1, 2, 1, 2, 0, 0, 2, 1});
  refined.setLayout(mesh.layout()->refined(std::vector<Index>{0, 1, 1}, 3));
  EXPECT_EQ(meshBytes(refined, Format::Off), "OFF\n3 3 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 7\n3 1 2 0 9\n3 0 2 1 9\n");
}

TEST(Convert, OffTakesColoursAndPolygonsAndSaysTheRest) {
  Mesh mesh({Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(1, 1, 0), Vec3(0, 1, 0)}, {0, 1, 2, 3}, {0, 4});
  mesh.attributes().push_back({"color", Element::Vertex, 3, {}, std::vector<std::uint8_t>(12, 5), {}, {}});
  mesh.attributes().push_back({"mass", Element::Face, 1, {}, std::vector<float>(1, 5), {}, {}});
  WriteReport report;
  EXPECT_EQ(meshBytes(mesh, Format::Off, {}, &report),
            "COFF\n4 1 0\n0 0 0 5 5 5\n1 0 0 5 5 5\n1 1 0 5 5 5\n0 1 0 5 5 5\n4 0 1 2 3\n");
  EXPECT_EQ(report.dropped, (std::vector<std::string>{"1 attribute: mass"}));
}

}  // namespace
}  // namespace fielddeform::mesh
