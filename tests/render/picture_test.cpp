#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/render/render.h>
#include <gtest/gtest.h>
#include <png.h>
#include <tests/support/cases.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>

namespace fielddeform::render {
namespace {

using MeshPtr = std::shared_ptr<const mesh::Mesh>;

MeshPtr share(mesh::Mesh m) { return std::make_shared<mesh::Mesh>(std::move(m)); }
MeshPtr sphere(double radius = 1) {
  return share(tests::makeCapsule({.length = 0, .radius = radius, .around = 96, .along = 48, .bump = 0}));
}
/// A square of half side `half` in the plane z, facing +z.
mesh::Mesh square(double half, double z) {
  return {{Vec3(-half, -half, z), Vec3(half, -half, z), Vec3(half, half, z), Vec3(-half, half, z)}, {0, 1, 2, 0, 2, 3}};
}

mesh::Attribute colors(mesh::Element on, int width, mesh::AttributeData data) {
  mesh::Attribute a;
  a.name = "color", a.on = on, a.width = width, a.data = std::move(data);
  return a;
}
skeleton::Primitive primitive(skeleton::PrimitiveType type, std::vector<Vec3> points) {
  skeleton::Primitive p;
  p.name = "primitive", p.type = type, p.points = std::move(points);
  return p;
}
Overlay overlay(const skeleton::Primitive& p, double hidden = 0.75) {
  Overlay o{.color = {0.9f, 0, 0}, .hidden = hidden};
  o.skeleton.primitives.push_back(p);
  return o;
}

Picture small(std::vector<Body> bodies) {
  Picture picture{.views = {{.bodies = std::move(bodies)}}, .width = 120, .height = 100};
  picture.camera.direction = Vec3(0, 0, -1);
  picture.camera.projection = Projection::Orthographic;
  picture.quality = {.samples = 2, .ambient = 2, .shadows = 1};
  return picture;
}

Image draw(const Picture& picture) {
  Progress progress;
  return render(picture, progress);
}

using Rgb = std::array<int, 3>;
Rgb at(const Image& image, int x, int y) {
  const auto* p = image.pixel(x, y);
  return {p[0], p[1], p[2]};
}
const Rgb kBackground{246, 246, 247};

int drawnPixels(const Image& image) {
  int count = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) count += at(image, x, y) != kBackground;
  }
  return count;
}

TEST(Render, SphereCoversPiQuartersOfItsBox) {
  Picture picture = small({{.mesh = sphere()}});
  picture.width = 300, picture.height = 300;
  const Image image = draw(picture);
  const double side = 0.92 * 300;  // what an object fills of its cell
  // Pixels that the outline only touches count in full: up to 1.5 % here.
  EXPECT_NEAR(drawnPixels(image) / (side * side), std::numbers::pi / 4, 0.02);
  EXPECT_EQ(at(image, 0, 0), kBackground);
  EXPECT_EQ(at(image, 12 + 20, 12 + 20), kBackground);  // the box's corner
  EXPECT_NE(at(image, 150, 14), kBackground);           // the top of the circle
}

TEST(Render, NearerSurfaceHidesTheFarther) {
  const Body near{.mesh = share(square(0.5, 1)), .color = Color{0.8f, 0.1f, 0.1f}};
  const Body far{.mesh = share(square(1, 0)), .color = Color{0.1f, 0.1f, 0.8f}};
  for (const auto& bodies : {std::vector<Body>{near, far}, std::vector<Body>{far, near}}) {
    Picture picture = small(bodies);
    Image image = draw(picture);
    EXPECT_GT(at(image, 60, 50)[0], 2 * at(image, 60, 50)[2]);
    EXPECT_GT(at(image, 60, 8)[2], 2 * at(image, 60, 8)[0]);  // the rim of the larger square
    picture.camera.direction = Vec3(0, 0, 1);
    image = draw(picture);
    EXPECT_GT(at(image, 60, 50)[2], 2 * at(image, 60, 50)[0]);
  }
}

TEST(Render, VertexColorsOfOneColorLookLikeThatColor) {
  for (const bool integers : {true, false}) {
    mesh::Mesh m = square(1, 0);
    mesh::Attribute color = colors(mesh::Element::Vertex, integers ? 4 : 3, {});
    if (integers) {
      color.data =
          std::vector<std::uint8_t>{51, 102, 204, 255, 51, 102, 204, 255, 51, 102, 204, 255, 51, 102, 204, 255};
    } else {
      color.data = std::vector<float>{0.2f, 0.4f, 0.8f, 0.2f, 0.4f, 0.8f, 0.2f, 0.4f, 0.8f, 0.2f, 0.4f, 0.8f};
    }
    const Image plain = draw(small({{.mesh = share(m), .color = Color{0.2f, 0.4f, 0.8f}}}));
    m.attributes().push_back(color);
    const Image coloured = draw(small({{.mesh = share(m)}}));
    for (std::size_t i = 0; i < plain.rgb.size(); ++i) ASSERT_NEAR(plain.rgb[i], coloured.rgb[i], 1);  // rounding
    EXPECT_NE(at(coloured, 60, 50), kBackground);
  }
}

TEST(Render, ColorsOfFacesAndCornersAreShown) {
  for (const mesh::Element on : {mesh::Element::Face, mesh::Element::Corner}) {
    mesh::Mesh m({Vec3(-1, -1, 0), Vec3(0, -1, 0), Vec3(0, 1, 0), Vec3(-1, 1, 0), Vec3(1, -1, 0), Vec3(1, 1, 0)},
                 {0, 1, 2, 3, 1, 4, 5, 2}, {0, 4, 8});
    mesh::Attribute color = colors(on, 3, std::vector<std::uint8_t>{200, 20, 20, 20, 20, 200});
    if (on == mesh::Element::Corner) color.indices = {0, 0, 0, 0, 1, 1, 1, 1};
    m.attributes().push_back(color);
    const Image image = draw(small({{.mesh = share(m)}}));
    EXPECT_GT(at(image, 40, 50)[0], 2 * at(image, 40, 50)[2]);
    EXPECT_GT(at(image, 80, 50)[2], 2 * at(image, 80, 50)[0]);
  }
}

TEST(Render, ScalarsBecomeColorsWithALegend) {
  mesh::Mesh m = square(1, 0);
  Picture picture = small({{.mesh = share(m), .scalars = {0, 1, 1, 0}}});
  picture.width = 200;
  const Image image = draw(picture);
  // Left is dark violet, right is yellow; the legend's bar has both ends too.
  bool violet = false, yellow = false;  // of the legend's bar
  for (int y = 0; y < 100; ++y) {
    for (int x = 138; x < 200; ++x)
      violet |= at(image, x, y)[2] > 70 && at(image, x, y)[1] < 20,
          yellow |= at(image, x, y)[2] < 60 && at(image, x, y)[0] > 230;
  }
  EXPECT_TRUE(violet);
  EXPECT_TRUE(yellow);
  int left = 200, right = 0;
  for (int x = 0; x < 140; ++x) {
    if (at(image, x, 50) != kBackground) left = std::min(left, x), right = std::max(right, x);
  }
  EXPECT_GT(at(image, left + 3, 50)[2], at(image, left + 3, 50)[1]);
  EXPECT_GT(at(image, right - 3, 50)[1], 2 * at(image, right - 3, 50)[2]);
  picture.views[0].bodies[0].scalars = {NAN, NAN, INFINITY, NAN};  // nothing to show: grey, and no crash
  EXPECT_NO_THROW(draw(picture));
}

TEST(Render, SameBytesOnAnyNumberOfThreads) {
  const auto c = tests::makeCase("bend90");
  Picture picture{.width = 240};
  picture.views.push_back({.bodies = {{.mesh = share(c.mesh)}}, .overlays = {{.skeleton = c.rest}}, .label = "rest"});
  picture.views.push_back({.bodies = {{.mesh = share(c.mesh), .positions = c.ideal}},
                           .overlays = {{.skeleton = c.posed}},
                           .label = "posed"});
  std::vector<std::uint8_t> first;
  for (const int threads : {1, 2, 7}) {
    const ThreadLimit limit(threads);
    const std::vector<std::uint8_t> bytes = encodePng(draw(picture));
    if (first.empty()) first = bytes;
    EXPECT_EQ(bytes, first) << threads;
  }
}

TEST(Render, ScaleOfTheModelDoesNotMatter) {
  const MeshPtr m = share(tests::makeCapsule({.around = 24, .along = 20}));
  const Image image = draw(small({{.mesh = m}}));
  for (const double factor : {1024.0, 0x1p-900, 0x1p1000}) {
    Body body{.mesh = m};
    for (const Vec3& p : m->positions()) body.positions.push_back(factor * p);
    EXPECT_EQ(draw(small({body})).rgb, image.rgb) << factor;
  }
}

TEST(Render, FarFromTheOriginLooksTheSame) {
  const MeshPtr m = share(tests::makeCapsule({.around = 24, .along = 20}));
  Body moved{.mesh = m};
  for (const Vec3& p : m->positions()) moved.positions.push_back(p + Vec3(1e6, -3e6, 2e6));
  const Image a = draw(small({{.mesh = m}})), b = draw(small({moved}));
  int different = 0;
  for (std::size_t i = 0; i < a.rgb.size(); ++i) different += std::abs(a.rgb[i] - b.rgb[i]) > 2;
  // Doubles keep 1e-10 there; only rays that graze an outline may decide otherwise.
  EXPECT_LT(different, 30);
}

TEST(Render, LabelsAreWrittenBelowTheirViews) {
  Picture picture = small({{.mesh = sphere()}});
  const auto inkBelow = [](const Image& image) {
    int count = 0;
    for (int y = 84; y < 100; ++y) {
      for (int x = 0; x < 120; ++x) count += at(image, x, y)[0] < 150;
    }
    return count;
  };
  picture.views[0].label = " ";  // the same room, nothing to read
  EXPECT_EQ(inkBelow(draw(picture)), 0);
  picture.views[0].label = "before 90\xC2\xB0";
  EXPECT_GT(inkBelow(draw(picture)), 30);
}

TEST(Render, SkeletonInsideAnObjectShinesThrough) {
  const auto spine = primitive(skeleton::PrimitiveType::Polyline, {Vec3(-0.5, 0, 0), Vec3(0.5, 0, 0)});
  Picture picture = small({{.mesh = sphere()}});
  const Image without = draw(picture);
  picture.views[0].overlays.push_back(overlay(spine));
  const Image with = draw(picture);
  const auto redness = [&](const Image& i, int x, int y) { return at(i, x, y)[0] - at(i, x, y)[1]; };
  EXPECT_GT(redness(with, 60, 50), redness(without, 60, 50) + 40);
  EXPECT_EQ(at(with, 60, 20), at(without, 60, 20));
  picture.views[0].overlays[0].hidden = 0;
  EXPECT_EQ(draw(picture).rgb, without.rgb);
}

TEST(Render, EveryKindOfPrimitiveIsDrawn) {
  const Vec3 a(-1, 0, 0), b(1, 0, 0), c(0, 1, 0);
  const auto points = primitive(skeleton::PrimitiveType::Points, {a, b, c});
  auto loop = primitive(skeleton::PrimitiveType::Polyline, {a, b, c});
  loop.closed = true;
  auto shell = primitive(skeleton::PrimitiveType::Mesh, {a, b, c});
  shell.faces = {{0, 1, 2}};
  int before = 0;
  for (const auto& p : {points, shell, loop}) {  // ever more ink: dots, thin edges, thick tubes with joints
    Picture picture = small({});
    picture.views[0].overlays.push_back(overlay(p));
    const int drawn = drawnPixels(draw(picture));
    EXPECT_GT(drawn, before);
    before = drawn;
  }
}

TEST(Render, LinesPointsAndEdgesOfAMeshAreDrawn) {
  mesh::Mesh m({Vec3(-1, -1, 0), Vec3(1, 1, 0), Vec3(-1, 1, 0)}, {});
  const int cloud = drawnPixels(draw(small({{.mesh = share(m)}})));
  EXPECT_GT(cloud, 5);
  m.lines().push_back({{0, 1}});
  const int line = drawnPixels(draw(small({{.mesh = share(m)}})));
  EXPECT_GT(line, 60);
  const Image flat = draw(small({{.mesh = share(square(1, 0))}}));
  const Image edged = draw(small({{.mesh = share(square(1, 0)), .edgeWidth = 20}}));
  EXPECT_LT(at(edged, 60, 50)[0], at(flat, 60, 50)[0] - 40);  // the diagonal between the two triangles
}

TEST(Render, OcclusionDarkensAConcaveCorner) {
  // A floor and a wall, seen at 45 degrees: near the joint both see half the sky.
  const mesh::Mesh corner({Vec3(-1, 0, 0), Vec3(1, 0, 0), Vec3(1, 0, 1), Vec3(-1, 0, 1), Vec3(1, 1, 0), Vec3(-1, 1, 0)},
                          {0, 3, 2, 1, 0, 1, 4, 5}, {0, 4, 8});
  Picture picture = small({{.mesh = share(corner)}});
  picture.camera.direction = Vec3(0, -1, -1);
  picture.quality = {.samples = 4, .ambient = 16, .shadows = 0};
  const Image dark = draw(picture);
  picture.quality.ambient = 0;
  const Image plain = draw(picture);
  const auto darker = [&](int y) { return at(plain, 60, y)[0] - at(dark, 60, y)[0]; };
  int rim = 0;
  while (at(plain, 60, rim) == kBackground) ++rim;
  int joint = 0;
  for (int y = 40; y < 60; ++y) joint = std::max(joint, darker(y));  // it lies in the middle
  EXPECT_GT(joint, 15);
  EXPECT_LT(2 * darker(rim + 2), joint);  // the wall's upper end sees nearly all of its half of the sky
}

TEST(Render, DegenerateInputGivesAPictureOfWhatThereIs) {
  const double nan = std::nan(""), inf = INFINITY, huge = 1e308;
  const std::vector<mesh::Mesh> meshes{
      mesh::Mesh(),
      mesh::Mesh({Vec3(5, 6, 7)}, {}),
      mesh::Mesh({Vec3(nan, 0, 0)}, {}),
      mesh::Mesh({Vec3(1, 1, 1), Vec3(1, 1, 1), Vec3(1, 1, 1)}, {0, 1, 2}),
      mesh::Mesh({Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(2, 0, 0)}, {0, 1, 2}),
      mesh::Mesh({Vec3(0, 0, 0), Vec3(0, 0, 1), Vec3(0, 0, 2)}, {0, 1, 2}),
      mesh::Mesh({Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(inf, nan, 0)}, {0, 1, 2, 1, 2, 3}),
      mesh::Mesh({Vec3(-huge, -huge, -huge), Vec3(huge, -huge, huge), Vec3(0, huge, huge)}, {0, 1, 2}),
      mesh::Mesh({Vec3(0, 0, 0), Vec3(5e-324, 0, 0), Vec3(0, 5e-324, 0)}, {0, 1, 2}),
      mesh::Mesh({Vec3(0, 0, 0), Vec3(1, 0, 0)}, {0, 0, 1}, {0, 1, 3}),
  };
  for (const Projection projection : {Projection::Perspective, Projection::Orthographic}) {
    for (const mesh::Mesh& m : meshes) {
      Picture picture = small({{.mesh = share(m), .edgeWidth = 1}});
      picture.camera.projection = projection;
      EXPECT_NO_THROW(draw(picture));
      picture.camera.direction.reset();
      EXPECT_NO_THROW(draw(picture));
    }
  }
  EXPECT_EQ(drawnPixels(draw(small({}))), 0);
  EXPECT_GT(drawnPixels(draw(small({{.mesh = share(meshes[1])}}))), 0);  // one point is a dot
  EXPECT_GT(drawnPixels(draw(small({{.mesh = share(meshes[6])}}))), 1000);
  EXPECT_GT(drawnPixels(draw(small({{.mesh = share(meshes[7])}}))), 100);
  EXPECT_EQ(draw({.width = 50, .height = 40}).rgb.size(), 50u * 40 * 3);  // no view at all
}

TEST(Render, RefusesWrongOptions) {
  const auto refused = [](auto change) {
    Picture picture = small({{.mesh = sphere()}});
    change(picture);
    EXPECT_THROW(draw(picture), std::invalid_argument);
  };
  refused([](Picture& p) { p.width = 0; });
  refused([](Picture& p) { p.height = 100000; });
  refused([](Picture& p) { p.camera.zoom = NAN; });
  refused([](Picture& p) { p.camera.direction = Vec3::Zero(); });
  refused([](Picture& p) { p.camera.up = Vec3(NAN, 1, 0); });
  refused([](Picture& p) { p.quality.samples = 0; });
  refused([](Picture& p) { p.views[0].bodies[0].mesh = nullptr; });
  refused([](Picture& p) { p.views[0].bodies[0].positions.resize(3); });
  refused([](Picture& p) { p.views[0].bodies[0].scalars.resize(3); });
  refused([](Picture& p) { p.views[0].bodies[0].color = Color{2, 0, 0}; });
  refused([](Picture& p) { p.scalars.low = 2, p.scalars.high = 1; });
  refused([](Picture& p) { p.views[0].overlays.push_back(overlay(primitive(skeleton::PrimitiveType::Polyline, {}))); });
}

class Recorder final : public Progress {
 public:
  explicit Recorder(double cancelAt) : cancelAt_(cancelAt) {}
  void advance(double fraction) override {
    last = fraction, monotone &= fraction >= before_, before_ = fraction;
    if (fraction >= cancelAt_) cancel();
  }
  double last = 0;
  bool monotone = true;

 private:
  double cancelAt_, before_ = 0;
};

TEST(Render, ReportsProgressAndCanBeCancelled) {
  Picture picture = small({{.mesh = sphere()}});
  picture.views.push_back(picture.views[0]);
  const ThreadLimit serial(1);  // several threads may report out of order
  Recorder whole(2), half(0.3);
  render(picture, whole);
  EXPECT_EQ(whole.last, 1);
  EXPECT_TRUE(whole.monotone);
  EXPECT_THROW(render(picture, half), Cancelled);
  EXPECT_LT(half.last, 0.5);
}

TEST(Png, HoldsThePicture) {
  Image image{3, 2, {255, 0, 0, 0, 255, 0, 0, 0, 255, 1, 2, 3, 128, 127, 126, 255, 255, 255}};
  const std::vector<std::uint8_t> bytes = encodePng(image);
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  ASSERT_TRUE(png_image_begin_read_from_memory(&png, bytes.data(), bytes.size()));
  EXPECT_EQ(png.width, 3u);
  EXPECT_EQ(png.height, 2u);
  png.format = PNG_FORMAT_RGB;
  std::vector<std::uint8_t> back(18);
  ASSERT_TRUE(png_image_finish_read(&png, nullptr, back.data(), 0, nullptr));
  EXPECT_EQ(back, image.rgb);
}

TEST(Png, IsWrittenOrRefused) {
  const auto folder = std::filesystem::temp_directory_path() / "fielddeform_png_test";
  std::filesystem::create_directories(folder);
  const Image image{1, 1, {9, 9, 9}};
  writePng(image, folder / "a.png");
  EXPECT_EQ(std::filesystem::file_size(folder / "a.png"), encodePng(image).size());
  EXPECT_THROW(writePng(image, folder / "missing" / "a.png"), IoError);
  EXPECT_THROW(writePng({2, 2, {1, 2, 3}}, folder / "b.png"), std::invalid_argument);
  EXPECT_THROW(writePng({}, folder / "b.png"), std::invalid_argument);
  EXPECT_FALSE(std::filesystem::exists(folder / "b.png"));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace fielddeform::render
