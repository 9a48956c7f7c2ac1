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

std::vector<Vec3> posedBy(const fielddeform::tests::Case& c, const std::vector<Vec3>& points, Options options, double tolerance = 1e-10) {
  options.falloff = Falloff::Off;
  options.tolerance = tolerance;
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

skeleton::Skeleton twoOf(const skeleton::Skeleton& s, const Vec3& aside) {
  skeleton::Skeleton two = s;
  two.primitives.push_back(s.primitives[0]);
  two.primitives[1].name = "second";
  for (Vec3& p : two.primitives[1].points) p += aside;
  return two;
}

// Where only the grid counts for voxels of up to a tenth of the radius 0.8, and away from the ends of a line along z.
std::vector<Vec3> shellPoints() {
  std::vector<Vec3> points;
  for (std::uint64_t i = 0; points.size() < 400; ++i) {
    const Vec3 p(1.4 * uniform01(3, 3 * i) - 0.7, 1.4 * uniform01(3, 3 * i + 1) - 0.7, 1.6 * uniform01(3, 3 * i + 2) - 0.8);
    const double d = std::hypot(p.x(), p.y());
    if (d > 0.42 && d < 0.66) points.push_back(p);
  }
  return points;
}

std::vector<double> errorsOf(const skeleton::Skeleton& rest, const skeleton::Skeleton& posed, const std::vector<Vec3>& points, const std::vector<Vec3>& wanted,
                             field::Sampling sampling) {
  const fielddeform::tests::Case c{"", {}, rest, posed, {}};
  std::vector<double> errors;
  for (const double voxel : {0.08, 0.04, 0.02}) {
    Options o = withDistance(field::Distance::Grid, voxel);
    o.field.distance.grid.sampling = sampling;
    errors.push_back(rms(posedBy(c, points, o, 1e-12), wanted));
  }
  return errors;
}

// A line is turned and stretched: both distances are smooth, and lie differently in their grids. The result is known in closed form.
TEST(Distances, OrderInTheVoxelIsTwoTrilinearAndThreeQuadraticOnATurnedAndStretchedLine) {
  if (!field::gridsAvailable()) GTEST_SKIP() << "built without OpenVDB";
  const Mat3 turn = Eigen::AngleAxisd(0.8, Vec3(1, 2, 0).normalized()).toRotationMatrix();  // no spin: none is to be told from a line
  const std::vector<Vec3> points = shellPoints();
  std::vector<Vec3> line, image, wanted;
  for (int i = -10; i <= 10; ++i) line.push_back(Vec3(0, 0, 0.2 * i)), image.push_back(turn * Vec3(0.1, 0, 0.26 * i));
  for (const Vec3& p : points) wanted.push_back(turn * Vec3(p.x() + 0.1, p.y(), 1.3 * p.z()));
  for (const field::Sampling sampling : {field::Sampling::Trilinear, field::Sampling::Quadratic}) {
    const std::vector<double> e = errorsOf(lineSkeleton(line, 0.8), lineSkeleton(image, 0.8), points, wanted, sampling);
    const double limit = sampling == field::Sampling::Quadratic ? 8 : 4;
    EXPECT_GT(e[0] / e[1], 0.85 * limit) << toString(sampling);
    EXPECT_GT(e[1] / e[2], 0.85 * limit) << toString(sampling);
    EXPECT_LT(e[2], sampling == field::Sampling::Quadratic ? 1e-5 : 2e-4);
  }
}

// A bent line is a polyline, whose distance has kinks within the bend: there the error is of first order, in proportion to the corners' angles.
TEST(Distances, OnABendTheFloorOfTheErrorIsTheCornersOfThePolyline) {
  if (!field::gridsAvailable()) GTEST_SKIP() << "built without OpenVDB";
  const std::vector<Vec3> points = shellPoints();
  std::vector<std::vector<double>> e;
  for (const int n : {40, 1280}) {
    std::vector<Vec3> line, arc;
    const double angle = 0.9, radius = 3 / angle;
    for (int i = 0; i <= n; ++i) {
      const double z = 3.0 * i / n - 1.5, a = angle * z / 3;
      line.push_back(Vec3(0, 0, z));
      arc.push_back(Vec3(radius * (1 - std::cos(a)), 0, radius * std::sin(a)));
    }
    const skeleton::Skeleton rest = lineSkeleton(line, 0.8), posed = lineSkeleton(arc, 0.8);
    const std::vector<Vec3> exact = posedBy({"", {}, rest, posed, {}}, points, {}, 1e-12);
    e.push_back(errorsOf(rest, posed, points, exact, field::Sampling::Quadratic));
  }
  EXPECT_GT(e[0][2] / e[1][2], 10);  // 32 times the angle
  EXPECT_LT(e[0][1] / e[0][2], 4);
  // 8 in the limit: the third order comes out above the floor.
  EXPECT_GT(e[1][0] / e[1][1], 6);
  EXPECT_GT(e[1][1] / e[1][2], 6);
}

TEST(Distances, AGridOfTheBlendConvergesToo) {
  if (!field::gridsAvailable()) GTEST_SKIP() << "built without OpenVDB";
  auto c = fielddeform::tests::makeCase("bend90");
  c.rest = twoOf(c.rest, Vec3(0.1, 0.05, 0));
  c.posed = twoOf(c.posed, Vec3(0.1, 0.05, 0));
  const std::vector<Vec3> points = someOf(c.mesh, 30);
  const std::vector<Vec3> exact = posedBy(c, points, {});
  std::vector<double> errors;
  for (const double voxel : {0.04, 0.02, 0.01}) {
    Options o = withDistance(field::Distance::Grid, voxel);
    o.field.distance.grid.of = field::GridOf::Blend;
    errors.push_back(rms(posedBy(c, points, o), exact));
  }
  // The closest frame jumps between the two lines: there the blend has a kink, and the error is of first order.
  EXPECT_GT(errors[0] / errors[1], 2);
  EXPECT_GT(errors[1] / errors[2], 2);
  EXPECT_LT(errors[2], 3e-4);
}

// Grids near the vertices hold the samples of grids wherever the skeleton reaches: the tracker asks for little else.
TEST(Distances, GridsNearTheMeshGiveTheSameWithLessMemory) {
  if (!field::gridsAvailable()) GTEST_SKIP() << "built without OpenVDB";
  const auto c = fielddeform::tests::makeCase("bend90");
  for (const field::GridOf of : {field::GridOf::Primitives, field::GridOf::Blend}) {
    std::vector<Vec3> position[2];
    double megabytes[2] = {0, 0};
    for (const auto around : {field::GridAround::Mesh, field::GridAround::Influence}) {
      Options o = withDistance(field::Distance::Grid, 0.02);
      o.field.distance.grid.of = of;
      o.field.distance.grid.around = around;
      const Deformed d = track(c.mesh, c.rest, c.posed, o);
      position[static_cast<int>(around)] = d.position;
      const auto reports = d.map.distanceReports();
      ASSERT_EQ(reports.size(), 2u);
      EXPECT_EQ(reports[0].pose, "rest");
      EXPECT_EQ(reports[1].pose, "posed");
      EXPECT_EQ(reports[0].primitive, of == field::GridOf::Blend ? "" : c.rest.primitives[0].name);
      for (const auto& r : reports) {
        EXPECT_GT(r.report.voxels, 0u);
        megabytes[static_cast<int>(around)] += r.report.megabytes;
      }
    }
    EXPECT_LT(megabytes[0], 0.6 * megabytes[1]);
    // Where a step of the corrector left the grid it met the exact field, which differs by the grid's error.
    EXPECT_LT(rms(position[0], position[1]), 1e-6);
  }
}

TEST(Distances, MemoryIsCountedOverTheFieldsOfAMap) {
  if (!field::gridsAvailable()) GTEST_SKIP() << "built without OpenVDB";
  const auto c = fielddeform::tests::makeCase("bend90");
  Options o = withDistance(field::Distance::Grid, 0.02);
  const Deformed d = track(c.mesh, c.rest, c.posed, o);
  double rest = 0, all = 0;
  for (const auto& r : d.map.distanceReports()) {
    all += r.report.megabytes;
    if (r.pose == "rest") rest += r.report.megabytes;
  }
  o.field.distance.grid.maxMegabytes = 0.5 * (rest + all);  // enough for the field at rest alone
  try {
    track(c.mesh, c.rest, c.posed, o);
    FAIL();
  } catch (const std::invalid_argument& problem) {
    EXPECT_NE(std::string(problem.what()).find("what other grids left of"), std::string::npos) << problem.what();
  }
}

// A retry's grids are made while those of the first attempt live.
TEST(Distances, ARetryWithoutMemoryForItsGridsIsNotMadeAndSaid) {
  if (!field::gridsAvailable()) GTEST_SKIP() << "built without OpenVDB";
  const auto c = fielddeform::tests::makeCase("branch");
  Options o = withDistance(field::Distance::Grid, 0.04);
  o.predictor = Predictor::Mls;
  o.guard = false;
  const Deformed retried = track(c.mesh, c.rest, c.posed, o);
  ASSERT_NE(retried.retry.find("in 2 substeps with"), std::string::npos) << retried.retry;
  o.retry = false;
  const Deformed once = track(c.mesh, c.rest, c.posed, o);
  ASSERT_GT(once.folds, 0u);
  double all = 0;
  for (const auto& r : once.map.distanceReports()) all += r.report.megabytes;
  EXPECT_GT(once.map.posedMegabytes(), 0.1 * all);
  EXPECT_LT(once.map.posedMegabytes(), all);
  o.retry = true;
  o.field.distance.grid.maxMegabytes = 1.1 * all;
  const Deformed held = track(c.mesh, c.rest, c.posed, o);
  EXPECT_NE(held.retry.find("not 2 substeps ("), std::string::npos) << held.retry;
  EXPECT_NE(held.retry.find("what other grids left of"), std::string::npos) << held.retry;
  EXPECT_EQ(held.position, once.position);
  EXPECT_THROW(once.map.withSubsteps(2, 1e6), field::GridMemoryError);
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
