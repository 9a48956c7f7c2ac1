#include <fielddeform/map/chain.h>
#include <fielddeform/map/rbf_warp.h>
#include <gtest/gtest.h>

#include <limits>

namespace fielddeform::map {
namespace {

const std::vector<Vec3> kCentres{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}};

std::shared_ptr<const RbfWarp> warp(double bulge) {
  std::vector<Vec3> posed = kCentres;
  posed.back() += bulge * Vec3(.3, -.2, .4);
  return std::make_shared<const RbfWarp>(kCentres, posed);
}

std::vector<Vec3> points() { return {{.2, .3, .4}, {-1, 2, .5}, {.9, .8, 1.1}}; }

TEST(Chain, IsTheCompositionOfItsMaps) {
  const auto first = warp(1), second = warp(-.7);
  const Chain chain({first, second});
  const std::vector<Vec3> rest = points();
  std::vector<Vec3> out(rest.size());
  Progress silent;
  chain.apply(*chain.bind(rest), {.position = out, .safe = {}, .status = {}, .residual = {}}, silent);
  for (std::size_t i = 0; i < rest.size(); ++i) EXPECT_EQ(out[i], second->position(first->position(rest[i])));
}

TEST(Chain, MultipliesJacobians) {
  const auto first = warp(1), second = warp(-.7);
  const Chain chain({first, second});
  const std::vector<Vec3> rest = points();
  std::vector<Mat3> out(rest.size());
  chain.jacobians(*chain.bind(rest), out);
  const double h = 1e-6;
  for (std::size_t i = 0; i < rest.size(); ++i)
    for (int c = 0; c < 3; ++c) {
      const Vec3 e = h * Vec3::Unit(c);
      const Vec3 difference = (second->position(first->position(rest[i] + e)) - second->position(first->position(rest[i] - e))) / (2 * h);
      EXPECT_LT((out[i].col(c) - difference).norm(), 1e-8);  // h^2 and rounding / h
    }
}

TEST(Chain, CombinesStatuses) {
  const auto moving = warp(1), still = warp(0);
  const std::vector<Vec3> rest{{.2, .3, .4}, Vec3::Constant(std::numeric_limits<double>::quiet_NaN())};
  Progress silent;
  const auto statuses = [&](const Chain& chain) {
    std::vector<Status> status(rest.size());
    chain.apply(*chain.bind(rest), {.position = {}, .safe = {}, .status = status, .residual = {}}, silent);
    return status;
  };
  EXPECT_EQ(statuses(Chain({moving, still})), (std::vector{Status::Converged, Status::Invalid}));
  EXPECT_EQ(statuses(Chain({still, moving})), (std::vector{Status::Converged, Status::Invalid}));
  EXPECT_EQ(statuses(Chain({still, still})), (std::vector{Status::Fixed, Status::Invalid}));
}

TEST(Chain, RefusesForeignBindingsAndNothing) {
  EXPECT_THROW(Chain({}), std::invalid_argument);
  EXPECT_THROW(Chain({nullptr}), std::invalid_argument);
  const Chain a({warp(1)}), b({warp(1)});
  const std::vector<Vec3> rest = points();
  std::vector<Vec3> out(rest.size());
  Progress silent;
  EXPECT_THROW(b.apply(*a.bind(rest), {.position = out, .safe = {}, .status = {}, .residual = {}}, silent), std::invalid_argument);
}

}  // namespace
}  // namespace fielddeform::map
