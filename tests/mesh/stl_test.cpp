#include <cmath>
#include <limits>

#include "io_support.h"

namespace fielddeform::mesh {
namespace {

const std::string kAscii =
    "solid two words\n  facet normal 0 0 1\n    outer loop\n      vertex 0 0 0\n      vertex 1 0 0\n      vertex 0 1 "
    "0\n"
    "    endloop\n  endfacet\n  facet normal 0 0 0\n    outer loop\n      vertex 1 0 0\n      vertex 1 1 0.25\n"
    "      vertex 0 1 -0\n    endloop\n  endfacet\nendsolid two words\nsolid\nendsolid\n";

// Two facets that share an edge; one zero of the shared vertex has the other sign. `start` is the header's text.
std::string binary(std::string start) {
  start.resize(80, ' ');
  std::string s = start + bytesOf(std::uint32_t{2});
  const float facets[2][12] = {{0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0},
                               {0.6f, 0, 0.8f, 1, -0.0f, 0, 1, 1, 0.25f, 0, 1, 0}};
  for (int f = 0; f < 2; ++f) {
    for (const float x : facets[f]) s += bytesOf(x);
    s += bytesOf(std::uint16_t(0x8001 + f));
  }
  return s;
}

TEST(Stl, AsciiComesBackByteForByte) {
  EXPECT_EQ(roundTrip(kAscii, "t.stl"), kAscii);
  const Mesh mesh = parse(kAscii, "t.stl");
  EXPECT_EQ(mesh.vertexCount(), 6u);
  EXPECT_EQ(mesh.faceCount(), 2u);
}

TEST(Stl, BinaryComesBackByteForByteWeldedOrNotEvenIfItsHeaderSaysSolid) {
  for (const char* header : {"made by a scanner", "solid body", "solid facet normal"}) {
    const std::string file = binary(header);
    ReadReport report;
    const Mesh plain = parse(file, "t.stl", {}, &report);
    EXPECT_EQ(report.encoding, "binary little endian");
    EXPECT_EQ(plain.vertexCount(), 6u);
    EXPECT_EQ(plain.find(Element::Face, "stl_attribute")->get(1), 0x8002);
    EXPECT_EQ(meshBytes(plain, Format::Stl), file);
    const Mesh welded = parse(file, "t.stl", {{}, Weld::Exact}, &report);
    EXPECT_EQ(welded.vertexCount(), 4u);
    EXPECT_EQ(report.weldedCorners, 2u);
    EXPECT_EQ(welded.corners(), (std::vector<Index>{0, 1, 2, 1, 3, 2}));
    EXPECT_EQ(meshBytes(welded, Format::Stl), file);
  }
}

TEST(Stl, IsRecognisedByContentWhateverItsName) {
  EXPECT_EQ(parse(kAscii, "t.dat").faceCount(), 2u);
  EXPECT_EQ(parse(binary("solid"), "t.dat").faceCount(), 2u);
}

TEST(Stl, NormalsAreRecomputedOnlyWhereFacetsMoved) {
  Mesh mesh = parse(binary("x"), "t.stl", {{}, Weld::Exact});
  mesh.mutablePositions()[3] = Vec3(1, 1, 0);  // in the second facet alone
  const Mesh again = parse(meshBytes(mesh, Format::Stl), "t.stl");
  const Attribute* n = again.find(Element::Face, "normal");
  EXPECT_EQ(n->get(0, 2), 1);
  EXPECT_EQ(Vec3(n->get(1, 0), n->get(1, 1), n->get(1, 2)), Vec3(0, 0, 1));
  EXPECT_EQ(again.find(Element::Face, "stl_attribute")->get(1), 0x8002);
}

TEST(Stl, DegenerateFacetsHaveNoNormal) {
  const Mesh mesh({Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(2, 0, 0), Vec3(1e-200, 0, 0), Vec3(0, 1e-200, 0)},
                  {0, 1, 2, 1, 1, 2, 0, 3, 4});
  const Mesh again = parse(meshBytes(mesh, Format::Stl), "t.stl");
  const Attribute* n = again.find(Element::Face, "normal");
  for (int f = 0; f < 2; ++f)
    for (int k = 0; k < 3; ++k) EXPECT_EQ(n->get(f, k), 0);
  EXPECT_EQ(n->get(2, 2), 1);  // tiny is not degenerate
}

TEST(Stl, ChildrenInheritTheirFacetsWordsAndSolids) {
  const Mesh mesh = parse(kAscii, "t.stl");
  Mesh refined(mesh.positions(), {0, 1, 2, 1, 0, 2, 3, 4, 5});
  refined.setLayout(mesh.layout()->refined(std::vector<Index>{0, 0, 1}, 6));
  const std::string written = meshBytes(refined, Format::Stl);
  EXPECT_NE(written.find("endsolid two words\nsolid\nendsolid\n"), std::string::npos);
  EXPECT_EQ(parse(written, "t.stl").faceCount(), 3u);
}

TEST(Stl, BytesBehindTheLastFacetAreKept) {
  const std::string file = binary("scanner") + "extra";
  ReadReport report;
  const Mesh mesh = parse(file, "t.stl", {}, &report);
  EXPECT_EQ(report.trailingBytes, 5u);
  EXPECT_EQ(meshBytes(mesh, Format::Stl), file);
}

TEST(Stl, BrokenFilesAreRefused) {
  const std::string file = binary("scanner");
  for (std::size_t n = 0; n < file.size(); ++n) EXPECT_THROW((void)parse(file.substr(0, n), "t.stl"), IoError) << n;
  EXPECT_EQ(errorOf(file.substr(0, 100), "t.stl"),
            "t.stl: byte 80: header: 2 facets but 16 bytes left, expected 100 bytes");
  for (std::size_t n = 0; n < kAscii.size() - 26; ++n)
    EXPECT_THROW((void)parse(kAscii.substr(0, n), "t.stl"), IoError) << n;
  EXPECT_EQ(errorOf("solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0\nvertex 1 1 1\n", "t.stl"),
            "t.stl:5: vertex 0: 'vertex', expected a number");
  EXPECT_EQ(errorOf("solid a\nfacet normal 0 0 1\nouter loops\n", "t.stl"),
            "t.stl:3: facet 0: 'loops', expected 'loop'");
  std::string bad = file;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(bad.data() + 84 + 12, &nan, 4);
  EXPECT_EQ(errorOf(bad, "t.stl"),
            "t.stl: byte 96: vertex 0: a coordinate that is not finite, expected finite coordinates");
  ReadReport report;
  const Mesh kept = parse(bad, "t.stl", {InvalidPoints::Keep, Weld::Exact}, &report);
  EXPECT_EQ(report.invalidPoints, 1u);
  EXPECT_EQ(meshBytes(kept, Format::Stl), bad);
}

TEST(Stl, WhatItCannotHoldIsSaid) {
  Mesh quad({Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(1, 1, 0), Vec3(0, 1, 0.1), Vec3(5, 5, 5)}, {0, 1, 2, 3, 0, 1},
            {0, 4, 6});
  WriteReport report;
  const Mesh again = parse(meshBytes(quad, Format::Stl, {}, &report), "t.stl");
  EXPECT_EQ(again.faceCount(), 2u);
  EXPECT_EQ(report.dropped,
            (std::vector<std::string>{"1 isolated vertex", "1 polygon, cut into triangles",
                                      "1 face of fewer than 3 corners", "digits beyond single precision"}));
  quad.mutablePositions()[0][0] = 1e39;
  EXPECT_THROW((void)meshBytes(quad, Format::Stl), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::mesh
