// The three distances under the same tracker: how far the result moves from the exact one.
#include <fielddeform/core/random.h>
#include <fielddeform/map/rbf_warp.h>
#include <gtest/gtest.h>
#include <tests/gffd/gffd_testing.h>

namespace fielddeform::gffd::tests {
namespace {

std::vector<Vec3> someOf(const mesh::Mesh& mesh, std::size_t step) {
  std::vector<Vec3> out;
  for (std::size_t i = 0; i < mesh.vertexCount(); i += step) out.push_back(mesh.positions()[i]);
  return out;
}

std::vector<Vec3> posedBy(const fielddeform::tests::Case& c, const std::vector<Vec3>& points, Options options) {
  options.falloff = Falloff::Off;
  options.tolerance = 1e-10;
  options.predictor = Predictor::Axial;
  const GffdMap map(resolve(options, {points, {}}, skeleton::pairSkeletons(c.rest, c.posed)));
  std::vector<Vec3> out(points.size());
  Progress silent;
  map.apply(*map.bind(points), {.position = out, .safe = {}, .status = {}, .residual = {}}, silent);
  return out;
}

double rms(Points a, Points b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]).squaredNorm();
  return std::sqrt(sum / static_cast<double>(a.size()));
}

Options withDistance(field::Distance kind, double voxel = 0.1) {
  Options o;
  o.field.distance.kind = kind;
  o.field.distance.grid.voxel = voxel;
  return o;
}

TEST(Distances, AGridsResultConvergesToTheExactOneWithTheSquareOfTheVoxel) {
  if (!field::gridsAvailable()) GTEST_SKIP() << "built without OpenVDB";
  for (const char* name : {"bend90", "bend180"}) {
    const auto c = fielddeform::tests::makeCase(name);
    const std::vector<Vec3> points = someOf(c.mesh, 30);
    const std::vector<Vec3> exact = posedBy(c, points, {});
    std::vector<double> errors;
    for (const double voxel : {0.04, 0.02, 0.01}) errors.push_back(rms(posedBy(c, points, withDistance(field::Distance::Grid, voxel)), exact));
    // 4 in the limit: what is exact near the skeleton is wider with large voxels, and spares them their largest errors.
    EXPECT_GT(errors[0] / errors[1], 3) << name;
    EXPECT_GT(errors[1] / errors[2], 3) << name;
    EXPECT_LT(errors[2], 1e-4) << name;
  }
}

TEST(Distances, OnAStraightSkeletonAGridsErrorCancels) {
  if (!field::gridsAvailable()) GTEST_SKIP() << "built without OpenVDB";
  // Rest and posed line have the same cross-section and the same voxels across it.
  const auto c = fielddeform::tests::makeCase("stretch2");
  const std::vector<Vec3> points = someOf(c.mesh, 12);
  EXPECT_LT(rms(posedBy(c, points, withDistance(field::Distance::Grid, 0.04)), posedBy(c, points, {})), 1e-9);
}

TEST(Distances, AVariationalResultIsNearTheExactOne) {
  for (const char* name : {"bend90", "stretch2"}) {
    const auto c = fielddeform::tests::makeCase(name);
    const std::vector<Vec3> points = someOf(c.mesh, 12);
    const std::vector<Vec3> exact = posedBy(c, points, {});
    EXPECT_LT(rms(posedBy(c, points, withDistance(field::Distance::Variational)), exact), 0.02) << name;
  }
}

TEST(Distances, RigidEditsStayRigidAndUneditedOnesExact) {
  const auto c = fielddeform::tests::makeCase("rottrans");
  for (const field::Distance kind : {field::Distance::Variational, field::Distance::Grid}) {
    if (kind == field::Distance::Grid && !field::gridsAvailable()) continue;
    const std::vector<Vec3> points = someOf(c.mesh, 40);
    std::vector<Vec3> ideal;
    for (std::size_t i = 0; i < c.ideal.size(); i += 40) ideal.push_back(c.ideal[i]);
    const Options o = withDistance(kind);
    EXPECT_LT(greatestDistance(posedBy(c, points, o), ideal), 2e-9);
    auto still = c;
    still.posed = c.rest;
    EXPECT_TRUE(posedBy(still, points, o) == points);
    const mesh::Mesh cloud(points, {});
    const Deformed d = track(cloud, c.rest, c.posed, o);
    for (const Status s : d.status) EXPECT_TRUE(s == Status::Converged || s == Status::Fixed);
  }
}

TEST(Warp, TakesTheUsersPairs) {
  const auto c = fielddeform::tests::makeCase("bend90");
  Options o;
  o.predictor = Predictor::Warp;
  o.corrector = false;  // eq (5) alone
  for (std::uint64_t i = 0; i < 30; ++i) {
    const Vec3 p(uniform01(1, 3 * i) - 0.5, uniform01(1, 3 * i + 1) - 0.5, 2 * uniform01(1, 3 * i + 2) - 1);
    o.warpPairs.emplace_back(p, p + Vec3(0.2 * p.z(), 0, 0.1));
  }
  const std::vector<Vec3> points = someOf(c.mesh, 50);
  const GffdMap map(resolve(o, {points, {}}, skeleton::pairSkeletons(c.rest, c.posed)));
  std::vector<Vec3> out(points.size());
  Progress silent;
  map.apply(*map.bind(points), {.position = out, .safe = {}, .status = {}, .residual = {}}, silent);
  // A shear is linear, and what is linear the warp meets everywhere.
  for (std::size_t i = 0; i < points.size(); ++i)
    EXPECT_LT((out[i] - (points[i] + Vec3(0.2 * points[i].z(), 0, 0.1))).norm(), 1e-9);
  o.warpPairs[3].second.x() = std::nan("");
  EXPECT_THROW(resolve(o, c.mesh, skeleton::pairSkeletons(c.rest, c.posed)), std::invalid_argument);
}

TEST(Warp, ManyPairsAreMetToTheTolerance) {
  std::vector<Vec3> rest, posed;
  for (std::uint64_t i = 0; i < 3000; ++i) {
    const Vec3 p(uniform01(2, 3 * i), uniform01(2, 3 * i + 1), uniform01(2, 3 * i + 2));
    rest.push_back(p);
    posed.push_back(p + 0.2 * Vec3(std::sin(3 * p.y()), p.x() * p.x(), std::cos(2 * p.z())));
  }
  const map::RbfWarp warp(rest, posed);
  EXPECT_EQ(warp.report().distinct, 3000u);
  for (std::size_t i = 0; i < rest.size(); i += 7) EXPECT_LT((warp.position(rest[i]) - posed[i]).norm(), 1e-6 * std::sqrt(3.0));
  const double h = 1e-6;
  for (std::size_t i = 0; i < 20; ++i) {
    const Vec3 p = 0.9 * rest[i];
    const Mat3 j = warp.jacobian(p);
    for (int k = 0; k < 3; ++k) {
      const Vec3 central = (warp.position(p + h * Vec3::Unit(k)) - warp.position(p - h * Vec3::Unit(k))) / (2 * h);
      EXPECT_LT((central - j.col(k)).norm(), 1e-6);
    }
  }
}

}  // namespace
}  // namespace fielddeform::gffd::tests
