#include <fielddeform/render/detail/framing.h>
#include <gtest/gtest.h>
#include <tests/support/cases.h>

#include <cmath>

namespace fielddeform::render::detail {
namespace {

std::shared_ptr<const mesh::Mesh> box(const Vec3& half, const Vec3& centre = Vec3::Zero()) {
  std::vector<Vec3> points;
  for (int i = 0; i < 8; ++i)
    points.push_back(centre +
                     Vec3(i & 1 ? half.x() : -half.x(), i & 2 ? half.y() : -half.y(), i & 4 ? half.z() : -half.z()));
  return std::make_shared<mesh::Mesh>(points, std::vector<Index>{0, 1, 3, 0, 3, 2, 4, 5, 7, 4, 7, 6});
}

Picture pictureOf(const std::vector<std::shared_ptr<const mesh::Mesh>>& meshes) {
  Picture picture{.width = 400, .height = 300};
  for (const auto& m : meshes) picture.views.push_back({.bodies = {{.mesh = m}}});
  return picture;
}

/// Where a point lies in a view's cell: -1..1 both ways.
Eigen::Vector2d projected(const ViewFrame& f, const Vec3& world) {
  const Eigen::Vector3d p = f.normalised(world) - f.eye.cast<double>();
  const double depth = f.projection == Projection::Perspective ? p.dot(f.forward.cast<double>()) : 1;
  return {p.dot(f.right.cast<double>()) / depth / f.halfWidth, p.dot(f.up.cast<double>()) / depth / f.halfHeight};
}

double farthest(const ViewFrame& f, const mesh::Mesh& m) {
  double most = 0;
  for (const Vec3& p : m.positions()) most = std::max(most, projected(f, p).cwiseAbs().maxCoeff());
  return most;
}

TEST(Framing, FillsTheCellFromAnyDirection) {
  for (const Projection projection : {Projection::Perspective, Projection::Orthographic}) {
    for (int i = 0; i < 40; ++i) {
      const auto m = box(Vec3(1 + i % 3, 1, 0.5), Vec3(100, 0, 0));
      Picture picture = pictureOf({m});
      picture.camera.projection = projection;
      picture.camera.direction = Vec3(std::sin(i * 1.1), std::cos(i * 2.3), std::sin(i * 0.7 + 1));
      // The tightest of width and height touches the margin (of 8 %), nothing sticks out.
      EXPECT_NEAR(farthest(layOutSheet(picture).views[0], *m), 0.92, 1e-4) << i;
    }
  }
}

TEST(Framing, SameScaleShowsSizesSideBySide) {
  Picture picture = pictureOf({box(Vec3(1, 1, 1)), box(Vec3(2, 2, 2), Vec3(50, 60, 70))});
  picture.camera.projection = Projection::Orthographic;
  const Sheet sheet = layOutSheet(picture);
  EXPECT_NEAR(farthest(sheet.views[1], *picture.views[1].bodies[0].mesh) /
                  farthest(sheet.views[0], *picture.views[0].bodies[0].mesh),
              2, 1e-5);
  picture.camera.framing = Framing::Each;
  const Sheet each = layOutSheet(picture);
  EXPECT_NEAR(farthest(each.views[1], *picture.views[1].bodies[0].mesh),
              farthest(each.views[0], *picture.views[0].bodies[0].mesh), 1e-5);
}

TEST(Framing, SameCameraKeepsPlaces) {
  Picture picture = pictureOf({box(Vec3(1, 1, 1)), box(Vec3(1, 1, 1), Vec3(5, 0, 0))});
  picture.camera.framing = Framing::SameCamera;
  const Sheet sheet = layOutSheet(picture);
  const Vec3 probe(1.5, 0.3, -0.2);
  EXPECT_LT((projected(sheet.views[0], probe) - projected(sheet.views[1], probe)).norm(), 1e-6);
  EXPECT_LE(farthest(sheet.views[0], *picture.views[1].bodies[0].mesh), 0.9201);
}

TEST(Framing, LooksAlongTheSmallestExtentFromAbove) {
  const auto forward = [](const Vec3& half) { return layOutSheet(pictureOf({box(half)})).views[0].forward; };
  EXPECT_LT(forward(Vec3(3, 2, 1)).z(), -0.7f);    // thin in z: from the front
  EXPECT_LT(forward(Vec3(1, 2, 3)).x(), -0.7f);    // thin in x: from the side
  EXPECT_LT(forward(Vec3(3, 0.1, 3)).y(), -0.7f);  // a plate: from above
  EXPECT_LT(forward(Vec3(1, 1, 1)).z(), -0.7f);
  for (const Vec3& half : {Vec3(3, 2, 1), Vec3(1, 2, 3), Vec3(1, 5, 1)}) EXPECT_LT(forward(half).y(), 0);
}

TEST(Framing, GivenDirectionUpAzimuthAndElevationAreObeyed) {
  Picture picture = pictureOf({box(Vec3(1, 1, 1))});
  picture.camera.direction = Vec3(0, 1e-200, 0);
  picture.camera.up = Vec3(1e200, 0, 0);
  ViewFrame f = layOutSheet(picture).views[0];
  EXPECT_NEAR((f.forward - Eigen::Vector3f(0, 1, 0)).norm(), 0, 1e-6);
  EXPECT_NEAR((f.up - Eigen::Vector3f(1, 0, 0)).norm(), 0, 1e-6);
  picture.camera.direction = Vec3(0, 0, -1), picture.camera.up = Vec3(0, 1, 0);
  picture.camera.azimuth = M_PI / 2;  // the camera goes to its right: from +z to +x
  EXPECT_NEAR((layOutSheet(picture).views[0].forward - Eigen::Vector3f(-1, 0, 0)).norm(), 0, 1e-6);
  picture.camera.azimuth = 0, picture.camera.elevation = M_PI / 2;  // straight from above: up is where it looked
  f = layOutSheet(picture).views[0];
  EXPECT_NEAR((f.forward - Eigen::Vector3f(0, -1, 0)).norm(), 0, 1e-6);
  EXPECT_NEAR((f.up - Eigen::Vector3f(0, 0, -1)).norm(), 0, 1e-6);
}

TEST(Framing, CellsTileThePictureWithoutOverlap) {
  for (std::size_t n = 1; n <= 9; ++n) {
    Picture picture = pictureOf(std::vector<std::shared_ptr<const mesh::Mesh>>(n, box(Vec3(1, 2, 1))));
    for (View& v : picture.views) v.label = std::string("x");
    picture.views[0].bodies[0].scalars.assign(8, 1.0);
    for (const std::optional<int> height : {std::optional<int>(300), std::optional<int>()}) {
      picture.height = height;
      const Sheet sheet = layOutSheet(picture);
      std::vector<int> covered(static_cast<std::size_t>(sheet.width) * sheet.height, 0);
      const auto cover = [&](const Cell& c) {
        for (int y = c.y; y < c.y + c.height; ++y) {
          for (int x = c.x; x < c.x + c.width; ++x) ++covered.at(static_cast<std::size_t>(y) * sheet.width + x);
        }
      };
      for (const ViewFrame& f : sheet.views) cover(f.cell);
      EXPECT_GT(sheet.legend.width, 0);
      cover(sheet.legend);
      EXPECT_LE(*std::max_element(covered.begin(), covered.end()), 1) << n;
    }
  }
}

TEST(Framing, OnlyWhatIsDrawnCounts) {
  std::vector<Vec3> points{Vec3(0, 0, 0),   Vec3(1, 0, 0),   Vec3(0, 1, 0),
                           Vec3(1e6, 0, 0), Vec3(NAN, 0, 0), Vec3(0, INFINITY, 0)};
  const Body body{.mesh = std::make_shared<mesh::Mesh>(points, std::vector<Index>{0, 1, 2, 0, 1, 4})};
  EXPECT_EQ(drawnVertices(body), (std::vector<Index>{0, 1, 2}));
  const Body cloud{.mesh = std::make_shared<mesh::Mesh>(points, std::vector<Index>{})};
  EXPECT_EQ(drawnVertices(cloud), (std::vector<Index>{0, 1, 2, 3}));
}

}  // namespace
}  // namespace fielddeform::render::detail
