// Distances of whole blocks, by scanning and by searching, against closest points one by one: every bit.
#include <fielddeform/core/parallel.h>
#include <fielddeform/field/detail/normal_regions.h>
#include <fielddeform/field/detail/voxel_distances.h>
#include <gtest/gtest.h>
#include <tests/support/mesh_sphere.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "skeletons.h"

namespace fielddeform::field::detail {
namespace {

using skeleton::Primitive;

constexpr double kAlways = std::numeric_limits<double>::infinity();

// A bumpy sphere, closed: convex and concave, saddles.
Primitive bumpySphere(int rows, double bump) {
  Primitive p = test::meshSphere(rows, [&](double a, double b) { return 0.5 + bump * std::sin(5 * b) * std::sin(4 * a); });
  p.radius = 0.3;
  return p;
}

// What a mesh from elsewhere may bring.
std::vector<Primitive> meshes() {
  Primitive open = bumpySphere(10, 0.05), reversed = bumpySphere(10, 0.05), mixed = bumpySphere(10, 0.05), spiky = bumpySphere(12, 0.4), sheets = cube("sheets", 0.4, 0.3),
            soup = patch("soup", 6, 0.3), thin = bumpySphere(8, 0.05), flat = patch("flat", 1, 0.3), folded = patch("folded", 1, 0.3);
  open.faces.resize(open.faces.size() / 2);
  for (auto& f : reversed.faces) std::reverse(f.begin(), f.end());
  for (std::size_t i = 0; i < mixed.faces.size(); i += 3) std::reverse(mixed.faces[i].begin(), mixed.faces[i].end());
  sheets.closed = false;
  sheets.points.push_back({0.9, 0.1, 0});  // three faces and more at an edge; a vertex of two fans
  sheets.faces.push_back({0, 1, 8});
  sheets.faces.push_back({1, 0, 8});
  sheets.points.push_back({-0.8, -0.7, -0.3});
  sheets.points.push_back({-0.7, -0.9, -0.6});
  sheets.faces.push_back({0, 9, 10});
  Primitive alone = soup;
  alone.points.clear();
  alone.faces.clear();
  for (const auto& f : soup.faces) {  // no edge is shared
    alone.faces.emplace_back();
    for (const Index v : f) alone.faces.back().push_back(static_cast<Index>(alone.points.size())), alone.points.push_back(soup.points[v]);
  }
  thin.points[5] = thin.points[6];  // triangles without area, and an edge without length
  thin.points[20] = 0.5 * (thin.points[21] + thin.points[22]);
  flat.points = {{-0.5, -0.5, 0}, {0.5, -0.5, 0}, {-0.5, 0.5, 0}, {0.5, 0.5, 0}};  // lattice points on it
  folded.points = {{-0.5, 0, 0}, {0, -0.5, 0}, {0, 0.5, 0}, {-0.4, 0.05, 0.02}};    // one edge, two faces on top of each other
  Primitive radii = bumpySphere(9, 0.05);
  giveRadii(radii, 0.2, 0.4);
  return {bumpySphere(12, 0.05), open, reversed, mixed, spiky, sheets, soup, alone, thin, flat, folded, cube("solid", 0.4, 0.3), radii};
}

struct Found {
  std::vector<VoxelHit> hits;
  std::vector<int> times;
};

Found distances(const PrimitiveDistance& d, const Lattice& lattice, const std::vector<Cell>& corners, double reach, double mostSteps) {
  Found found{std::vector<VoxelHit>(corners.size() * kBlockSize), std::vector<int>(corners.size() * kBlockSize)};
  voxelDistances(d, lattice, corners, reach, [&](std::size_t block, std::size_t first, std::span<const VoxelHit> hits) {
    for (std::size_t i = 0; i < hits.size(); ++i) {
      const std::size_t at = block * kBlockSize + nearOrder(first + i);
      found.hits[at] = hits[i];
      ++found.times[at];
    }
  }, mostSteps);
  return found;
}

std::vector<Cell> blocks(int from, int to) {
  std::vector<Cell> corners;
  for (int x = from; x < to; x += kSide)
    for (int y = from; y < to; y += kSide)
      for (int z = from; z < to; z += kSide)
        if ((x / kSide + y / kSide + z / kSide) % 3 != 0) corners.push_back({x, y, z});
  return corners;
}

TEST(VoxelDistances, AreThoseOfClosestPointsOneByOne) {
  const std::vector<Cell> corners = blocks(-16, 16);
  for (const Primitive& p : meshes()) {
    const PrimitiveDistance d(p);
    const Lattice lattice{d.bounds().center() + (p.name == "flat" ? Vec3(0, 0, 0) : Vec3(0.003, 0.001, 0)), 1.0 / 16};
    const double reach = p.name == "alone" ? 0.2 : 0.35;
    const Found scanned = distances(d, lattice, corners, reach, kAlways), searched = distances(d, lattice, corners, reach, 0);
    std::size_t within = 0;
    for (std::size_t i = 0; i < scanned.hits.size(); ++i) {
      const Vec3 x = lattice.point(pointOf(corners[i / kBlockSize], i % kBlockSize));
      const auto expected = d.closest(x);
      const bool near = std::abs(expected->distance) <= reach;
      within += near;
      ASSERT_EQ(scanned.times[i], 1);
      for (const VoxelHit& hit : {scanned.hits[i], searched.hits[i]}) {
        ASSERT_EQ(hit.element != kNoIndex, near) << p.name << ' ' << x.transpose();
        if (!near) continue;
        ASSERT_EQ(hit.distance, expected->distance) << p.name << ' ' << x.transpose();
        ASSERT_EQ(hit.element, expected->element) << p.name << ' ' << x.transpose();
        if (d.hasPointRadius()) {
          ASSERT_EQ(hit.weight, expected->weight);
        }
      }
    }
    EXPECT_GT(within, 500u) << p.name;
  }
}

// A fine mesh is scanned at about a step a voxel and part of the surface; where parts have no pencils, or are few and wide, it is not.
TEST(VoxelDistances, FineMeshesAreScannedOthersSearched) {
  const auto scans = [](const Primitive& p, double voxel) {
    const PrimitiveDistance d(p);
    const double voxels = 4 * std::numbers::pi * 0.25 * 0.6 / (voxel * voxel * voxel);
    return NormalRegions::of(d, {Vec3::Zero(), voxel}, 0.3 / voxel, kMostScanSteps * voxels).has_value();
  };
  EXPECT_TRUE(scans(bumpySphere(40, 0.02), 0.02));
  Primitive alone = bumpySphere(40, 0.02);
  const std::vector<Vec3> points = alone.points;
  alone.points.clear();
  for (auto& f : alone.faces)
    for (Index& v : f) alone.points.push_back(points[v]), v = static_cast<Index>(alone.points.size() - 1);
  EXPECT_FALSE(scans(alone, 0.02));
}

TEST(VoxelDistances, ThreadsAndScaleChangeNothing) {
  Primitive p = bumpySphere(16, 0.08), large = p;
  for (Vec3& x : large.points) x *= 0x1p300;
  *large.radius *= 0x1p300;
  const std::vector<Cell> corners = blocks(-16, 16);
  const PrimitiveDistance d(p), e(large);
  const Found whole = distances(d, {Vec3::Zero(), 0.04}, corners, 0.3, kAlways);
  const ThreadLimit limit(1);
  const Found one = distances(d, {Vec3::Zero(), 0.04}, corners, 0.3, kAlways), scaled = distances(e, {Vec3::Zero(), 0.04 * 0x1p300}, corners, 0.3 * 0x1p300, kAlways);
  for (std::size_t i = 0; i < whole.hits.size(); ++i) {
    ASSERT_EQ(whole.hits[i].distance, one.hits[i].distance);
    ASSERT_EQ(whole.hits[i].distance * 0x1p300, scaled.hits[i].distance);
    ASSERT_EQ(whole.hits[i].element, scaled.hits[i].element);
  }
}

// Coordinates beyond the squares of doubles, and blocks beyond 32 bits of a tile: searched, without a number that is none.
TEST(VoxelDistances, OutOfRangeCoordinatesAreSearched) {
  const PrimitiveDistance d(bumpySphere(8, 0.05));
  for (const double voxel : {1e-9, 1e160}) {
    const Found found = distances(d, {Vec3(0.5, 0, 0), voxel}, {{0, 0, 0}, {1 << 27, 8, -16}}, 0.3, kMostScanSteps);
    for (const VoxelHit& hit : found.hits) EXPECT_TRUE(std::isfinite(hit.distance));
    for (const int times : found.times) EXPECT_EQ(times, 1);
  }
}

}  // namespace
}  // namespace fielddeform::field::detail
