#include <fielddeform/core/parallel.h>
#include <fielddeform/solid/solid_map.h>
#include <gtest/gtest.h>
#include <tests/solid/solids.h>

#include <limits>

namespace fielddeform::solid {
namespace {

/// A row of solids bent by 120 degrees.
Object bentRow() {
  Object object = test::row();
  for (Vec3& p : object.points) {
    const double a = p.x() * .7, r = 1.2 + p.z();
    p = Vec3(r * std::sin(a), p.y(), r * std::cos(a));
  }
  return object;
}

std::vector<Vec3> shaken(const Object& object, double size) {
  std::vector<Vec3> out = object.points;
  for (std::size_t i = 0; i < out.size(); ++i) out[i] += size * test::randomPoint(2, i);
  return out;
}

TEST(SolidMap, FindsEveryPointInsideABentObject) {
  const Object object = bentRow();
  const SolidMap map(object, object.points);
  for (std::uint64_t k = 0; k < 300; ++k) {
    const std::size_t s = k % 3;
    const Vec3 u = .5 * (test::randomPoint(7, k) + Vec3::Ones());
    const Vec3 x = evaluate(object, s, u);
    const SolidMap::Place place = map.locate(x);
    ASSERT_TRUE(place.found && place.inside);
    EXPECT_EQ(place.solid, s);
    EXPECT_LT((place.uvw - u).norm(), 1e-10);  // the image's 1e-13 of the size, times the inverse's slope
  }
  EXPECT_FALSE(map.locate(Vec3(100, 0, 0)).found);
}

TEST(SolidMap, UneditedObjectsKeepEveryBitAndAffineOnesMapAffinely) {
  const Object object = bentRow();
  const std::vector<Vec3> points = test::cloud(3, 200);
  Progress silent;
  std::vector<Vec3> out(points.size());
  std::vector<Status> status(points.size());
  const SolidMap same(object, object.points);
  same.apply(*same.bind(points), {.position = out, .safe = {}, .status = status, .residual = {}}, silent);
  EXPECT_EQ(out, points);
  EXPECT_EQ(countStatuses(status)[0], points.size());
  Mat3 a;
  a << 1.3, .2, 0, -.1, .8, .4, .3, 0, 1.1;
  std::vector<Vec3> posed;
  for (const Vec3& p : object.points) posed.push_back(a * p + Vec3(1, 2, 3));
  const SolidMap affine(object, posed);
  const auto binding = affine.bind(points);
  affine.apply(*binding, {.position = out, .safe = {}, .status = status, .residual = {}}, silent);
  std::vector<Mat3> j(points.size());
  affine.jacobians(*binding, j);
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!SolidMap::place(*binding, i).found) continue;
    EXPECT_LT((out[i] - (a * points[i] + Vec3(1, 2, 3))).norm(), 1e-11);
    EXPECT_LT((j[i] - a).norm(), 1e-10);
  }
}

TEST(SolidMap, RidesWithItsSolidAndHasItsDerivatives) {
  const Object object = bentRow();
  const std::vector<Vec3> posed = shaken(object, .1);
  Object after = object;
  after.points = posed;
  const SolidMap map(object, posed);
  Progress silent;
  const double h = 1e-5;
  for (std::uint64_t k = 0; k < 40; ++k) {
    // Also a little beyond the outer sides, v and w.
    const Vec3 u = Vec3(.1, -.1, -.1) + .5 * (test::randomPoint(8, k) + Vec3::Ones()).cwiseProduct(Vec3(.8, 1.2, 1.2));
    const Vec3 x = evaluate(object, 1, u);
    std::vector<Vec3> around{x};
    for (int c = 0; c < 3; ++c) around.push_back(x + h * Vec3::Unit(c)), around.push_back(x - h * Vec3::Unit(c));
    std::vector<Vec3> out(around.size());
    const auto binding = map.bind(around);
    map.apply(*binding, {.position = out, .safe = {}, .status = {}, .residual = {}}, silent);
    EXPECT_LT((out[0] - evaluate(after, 1, u)).norm(), 1e-11);
    std::vector<Mat3> j(around.size());
    map.jacobians(*binding, j);
    if ((u - u.cwiseMax(0).cwiseMin(1)).cwiseAbs().maxCoeff() > 0 && (u.cwiseAbs().minCoeff() < 1e-3 || (u - Vec3::Ones()).cwiseAbs().minCoeff() < 1e-3)) continue;
    for (int c = 0; c < 3; ++c)
      EXPECT_LT((j[0].col(c) - (out[static_cast<std::size_t>(2 * c + 1)] - out[static_cast<std::size_t>(2 * c + 2)]) / (2 * h)).norm(), 1e-7);
  }
}

TEST(SolidMap, IsALinearMap) {
  const Object object = bentRow();
  const SolidMap map(object, shaken(object, .1));
  const std::vector<Vec3> points = test::cloud(4, 60), nodes = test::cloud(5, object.points.size());
  const auto binding = map.bind(points);
  const map::SparseRows rows = map.basis(*binding);
  std::vector<Vec3> out(points.size()), gathered(nodes.size()), byRows(nodes.size(), Vec3::Zero());
  map.combine(*binding, nodes, out);
  map.gather(*binding, points, gathered);
  for (std::size_t p = 0; p < points.size(); ++p) {
    Vec3 sum = Vec3::Zero();
    for (std::size_t k = rows.start[p]; k < rows.start[p + 1]; ++k) {
      sum += rows.value[k] * nodes[rows.column[k]];
      byRows[rows.column[k]] += rows.value[k] * points[p];
    }
    EXPECT_LT((sum - out[p]).norm(), 1e-13);
  }
  for (std::size_t i = 0; i < nodes.size(); ++i) EXPECT_LT((byRows[i] - gathered[i]).norm(), 1e-12);
  EXPECT_EQ(map.withDisplacements(nodes)->displacements()[3], nodes[3]);
}

TEST(SolidMap, LeavesWhatIsFarOrNoNumberAndDoesNotDependOnThreads) {
  const Object object = bentRow();
  const SolidMap map(object, shaken(object, .1));
  std::vector<Vec3> points = test::cloud(6, 500);
  points.push_back(Vec3(50, 0, 0));
  points.push_back(Vec3::Constant(std::numeric_limits<double>::quiet_NaN()));
  Progress silent;
  std::vector<std::vector<Vec3>> out;
  std::vector<Status> status(points.size());
  for (const int threads : {1, 6}) {
    const ThreadLimit limit(threads);
    out.emplace_back(points.size());
    map.apply(*map.bind(points), {.position = out.back(), .safe = {}, .status = status, .residual = {}}, silent);
    out.back().pop_back();
  }
  EXPECT_EQ(out[0], out[1]);
  EXPECT_EQ(status[500], Status::Fixed);
  EXPECT_EQ(status[501], Status::Invalid);
}

}  // namespace
}  // namespace fielddeform::solid
