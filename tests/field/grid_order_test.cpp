// Orders of convergence of grids in the voxel size, against distances in closed form: value and gradient, point, line, plane,
// polyhedron and a blend.
#include <fielddeform/field/field.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <optional>

#include "skeletons.h"

namespace fielddeform::field {
namespace {

using skeleton::Primitive;

struct Exact {
  double value;
  Vec3 gradient;
};

struct Case {
  const char* name;
  std::vector<Primitive> primitives;
  std::function<std::optional<Exact>(const Vec3&)> exact;  // nothing: near a kink, or where the grid is not asked
};

struct Errors {
  double value = 0, gradient = 0;  // root mean squares
  double worst = 0;                // of the value
};

// With R = 1 and voxels of at most 0.1 the grid alone counts from 0.45 on.
constexpr std::size_t kPoints = 250;
constexpr double kFrom = 0.46, kTo = 0.97;

std::optional<Exact> within(double d, const Vec3& gradient, double to = kTo) {
  if (!(std::abs(d) > kFrom && std::abs(d) < to)) return std::nullopt;
  return Exact{d, gradient};
}

const Mat3& turn() {
  static const Mat3 r = Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()).toRotationMatrix();
  return r;
}

// A turned cube of half side 0.5, beside a corner, an edge and a face, away from where these meet.
std::optional<Exact> cubeDistance(const Vec3& point) {
  const Vec3 p = turn().transpose() * point;
  Vec3 offset = Vec3::Zero();
  for (int k = 0; k < 3; ++k) {
    const double beyond = std::abs(p[k]) - 0.5;
    if (std::abs(beyond) < 0.25) return std::nullopt;
    if (beyond > 0) offset[k] = std::copysign(beyond, p[k]);
  }
  const double d = offset.norm();
  return d > 0 ? within(d, turn() * (offset / d)) : std::nullopt;
}

Primitive turnedCube() {
  Primitive p = cube("c", 0.5, 1);
  for (Vec3& x : p.points) x = turn() * x;
  return p;
}

const Vec3 kPoint(0.1, 0.03, -0.05), kA(-0.3, 0, 0.02), kB(0.35, 0.1, 0);

// D = -(R/k) ln(exp(-k d_a) + exp(-k d_b) - exp(-k)), R = 1, where both points reach, and reach every voxel of a stencil.
std::optional<Exact> blendOfTwo(const Vec3& p) {
  const double k = 4, da = (p - kA).norm(), db = (p - kB).norm();
  if (!within(da, p, 0.72) || !within(db, p, 0.72)) return std::nullopt;
  const double ea = std::exp(-k * da), eb = std::exp(-k * db), sum = ea + eb - std::exp(-k);
  return Exact{-std::log(sum) / k, (ea * (p - kA) / da + eb * (p - kB) / db) / sum};
}

std::vector<Case> cases() {
  Primitive plane = patch("m", 1, 1);
  plane.points = {{-4, -4, 0}, {4, -4, 0}, {-4, 4, 0}, {4, 4, 0}};
  for (Vec3& x : plane.points) x = turn() * x;
  return {{"point", {pointSet("p", {kPoint}, 1)}, [](const Vec3& p) { return within((p - kPoint).norm(), (p - kPoint).normalized()); }},
          {"line", {polyline("l", {{0.1, 0.05, -2}, {0.1, 0.05, 2}}, 1)},
           [](const Vec3& p) {
             const Vec3 o(p.x() - 0.1, p.y() - 0.05, 0);
             return within(o.norm(), o.normalized());
           }},
          {"plane", {plane},
           [](const Vec3& p) {
             const double z = turn().col(2).dot(p);
             return within(std::abs(z), std::copysign(1, z) * turn().col(2));
           }},
          {"polyhedron", {turnedCube()}, cubeDistance},
          {"blend", {pointSet("a", {kA}, 1), pointSet("b", {kB}, 1)}, blendOfTwo}};
}

Errors errorsOf(const Case& c, double voxel, Sampling sampling, GridOf of) {
  std::vector<Vec3> points;
  std::vector<Exact> exact;
  for (std::uint64_t i = 0; points.size() < kPoints; ++i) {
    const Vec3 p = randomPoint(41, i, 1.4);
    if (const auto e = c.exact(p)) points.push_back(p), exact.push_back(*e);
  }
  skeleton::Skeleton s;
  s.primitives = c.primitives;
  FieldOptions o;
  o.distance.kind = Distance::Grid;
  o.distance.grid.voxel = voxel;
  o.distance.grid.sampling = sampling;
  o.distance.grid.of = of;
  const Field field(s, o, points);
  const DistanceReport report = of == GridOf::Blend ? *field.blendReport() : field.distanceReport(0);
  Errors e;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const FieldValue v = field.evaluate(points[i]);
    EXPECT_TRUE(v.inside);
    const double off = std::abs(v.pseudoDistance - exact[i].value);
    e.worst = std::max(e.worst, off);
    e.value += off * off;
    e.gradient += (v.gradient - exact[i].gradient).squaredNorm();
  }
  EXPECT_LE(e.worst, *report.smoothError) << c.name;
  e.value = std::sqrt(e.value / kPoints);
  e.gradient = std::sqrt(e.gradient / kPoints);
  return e;
}

class GridOrder : public ::testing::TestWithParam<GridOf> {
  void SetUp() override {
    if (!gridsAvailable()) GTEST_SKIP() << "built without OpenVDB";
  }
};

// Halving the voxel divides the error of the value by 2^order in the limit, and the gradient's by half of that. What is
// asked for leaves a tenth for the next order, at voxels of a tenth of the radius.
TEST_P(GridOrder, IsTwoTrilinearAndThreeQuadraticOneLessForTheGradient) {
  for (const Case& c : cases())
    for (const Sampling sampling : {Sampling::Trilinear, Sampling::Quadratic}) {
      const bool several = c.primitives.size() > 1;
      const double value = sampling == Sampling::Quadratic ? 8 : 4, gradient = value / 2;
      std::vector<Errors> e;
      for (const double voxel : {0.1, 0.05, 0.025}) e.push_back(errorsOf(c, voxel, sampling, GetParam()));
      for (std::size_t i = 0; i + 1 < e.size(); ++i) {
        if (std::string(c.name) == "plane") {  // linear: interpolated exactly, to the rounding of floats
          EXPECT_LT(e[i].worst, 1e-6);
          EXPECT_LT(e[i].gradient, 1e-5);
          continue;
        }
        EXPECT_GT(e[i].value / e[i + 1].value, 0.88 * value) << c.name << several << i << " " << toString(sampling);
        EXPECT_GT(e[i].gradient / e[i + 1].gradient, 0.88 * gradient) << c.name << several << i << " " << toString(sampling);
        EXPECT_LT(e[i].value / e[i + 1].value, 1.5 * value) << c.name;
      }
      // A third order that begins above the second would be of no use.
      EXPECT_LT(e[2].value, sampling == Sampling::Quadratic ? 2e-5 : 4e-4) << c.name;
    }
}

INSTANTIATE_TEST_SUITE_P(Of, GridOrder, ::testing::Values(GridOf::Primitives, GridOf::Blend),
                         [](const auto& of) { return std::string(toString(of.param)); });

}  // namespace
}  // namespace fielddeform::field
