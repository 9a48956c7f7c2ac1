#include <fielddeform/core/error.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/mesh/measures.h>
#include <fielddeform/volume/detail/index_lists.h>
#include <fielddeform/volume/surface_volume.h>
#include <gtest/gtest.h>

#include "tests/support/shapes.h"
#include "tests/volume/volume_testing.h"

namespace fielddeform::volume {
namespace {

using test::cube, test::sphere, test::together, test::noise;

TEST(SurfaceVolume, AgreesWithTheMeshsOwnAndWithTheClosedForm) {
  const mesh::Mesh box = cube(), ball = sphere(40, 20);
  EXPECT_DOUBLE_EQ(SurfaceVolume(box.positions(), box.triangles()).value(box.positions()), 1);
  const SurfaceVolume volume(ball.positions(), ball.triangles());
  EXPECT_NEAR(volume.value(ball.positions()), *mesh::volume(ball, ball.positions()).value, 1e-14);
}

TEST(SurfaceVolume, DoesNotLoseDigitsFarFromTheOrigin) {
  const mesh::Mesh ball = sphere(40, 20);
  const auto far = test::moved(ball, [](const Vec3& p) { return Vec3(p + Vec3(1e4, -2e4, 5e3)); });
  // The coordinates themselves carry 2e-12 (1e4 sizes away); the volume must not be worse than a few of those.
  const double here = SurfaceVolume(ball.positions(), ball.triangles()).value(ball.positions());
  EXPECT_NEAR(SurfaceVolume(far, ball.triangles()).value(far) / here, 1, 1e-11);
}

TEST(SurfaceVolume, DerivativesAgreeWithCentralDifferences) {
  const mesh::Mesh two = together(sphere(9, 6), cube());
  std::vector<Index> region(two.triangles().size() / 3, 1);
  std::fill(region.end() - 12, region.end(), 0);
  const SurfaceVolume volume(two.positions(), two.triangles(), region);
  ASSERT_EQ(volume.regionCount(), 2u);
  const auto x = test::added(two.positions(), noise(1, two.vertexCount()), 0.1), p = noise(2, two.vertexCount());
  const std::vector<double> weight{0.7, -1.3};
  std::vector<Vec3> g(x.size()), plus(x.size()), minus(x.size()), hp(x.size());
  volume.gradient(x, weight, g);
  const double h = 1e-5;
  const auto ahead = volume.values(test::added(x, p, h)), behind = volume.values(test::added(x, p, -h));
  const double difference = (0.7 * (ahead[0] - behind[0]) - 1.3 * (ahead[1] - behind[1])) / (2 * h);
  EXPECT_NEAR(test::dot(g, p), difference, 1e-8);  // h^2 of a cubic's third derivative, 1e-10, and rounding / h
  volume.gradient(test::added(x, p, h), weight, plus);
  volume.gradient(test::added(x, p, -h), weight, minus);
  volume.hessianTimes(x, p, weight, hp);
  for (std::size_t v = 0; v < x.size(); ++v) EXPECT_LT((hp[v] - (plus[v] - minus[v]) / (2 * h)).norm(), 1e-9);
}

TEST(SurfaceVolume, IsACubicAlongALine) {
  const mesh::Mesh ball = sphere(12, 7);
  const SurfaceVolume volume(ball.positions(), ball.triangles());
  const auto d = noise(3, ball.vertexCount());
  const auto c = volume.alongLine(ball.positions(), d);
  for (const double t : {0.0, 0.3, -1.0, 2.0})
    EXPECT_NEAR(volume.value(test::added(ball.positions(), d, t)), c[0] + t * (c[1] + t * (c[2] + t * c[3])), 1e-12);
}

TEST(SurfaceVolume, NamesTheBoundaryEdges) {
  const mesh::Mesh box = cube();
  const auto all = box.triangles();
  const std::vector<Index> open(all.begin() + 3, all.end());
  const auto message = [&](const std::vector<Index>& t) {
    try {
      SurfaceVolume(box.positions(), t);
    } catch (const InfeasibleError& e) {
      return std::string(e.what());
    }
    return std::string("accepted");
  };
  EXPECT_NE(message(open).find("3 boundary edges"), std::string::npos) << message(open);
  std::vector<Index> turned = box.triangles();
  std::swap(turned[0], turned[1]);
  EXPECT_NE(message(turned).find("turned against each other"), std::string::npos) << message(turned);
  EXPECT_NE(message({}).find("no triangles"), std::string::npos) << message({});
  EXPECT_THROW(SurfaceVolume(box.positions(), {0, 1}), std::invalid_argument);
  EXPECT_THROW(SurfaceVolume(box.positions(), {0, 1, 99}), std::invalid_argument);
}

TEST(SurfaceVolume, RegionsAreClosedEachOnItsOwn) {
  const mesh::Mesh two = together(sphere(9, 6), cube());
  std::vector<Index> region(two.triangles().size() / 3, 1);
  std::fill(region.end() - 11, region.end(), 0);  // one of the cube's triangles is the sphere's
  EXPECT_THROW(SurfaceVolume(two.positions(), two.triangles(), region), InfeasibleError);
  std::fill(region.end() - 12, region.end(), kNoIndex);  // and an open region that nobody asks for does no harm
  std::fill(region.begin(), region.end() - 12, 0);
  auto triangles = two.triangles();
  std::swap(triangles[triangles.size() - 1], triangles[triangles.size() - 2]);
  EXPECT_EQ(SurfaceVolume(two.positions(), triangles, region).regionCount(), 1u);
}

TEST(SurfaceVolume, FixedRimsGiveTheChangesOfTheClosedSolid) {
  const mesh::Mesh ball = sphere(16, 9);
  // The faces above z = .3 are cut off; those vertices that stay on the rim do not move.
  std::vector<Index> kept;
  const auto all = ball.triangles();
  for (std::size_t t = 0; t < all.size(); t += 3)
    if ((ball.positions()[all[t]] + ball.positions()[all[t + 1]] + ball.positions()[all[t + 2]]).z() < 0.9)
      kept.insert(kept.end(), all.begin() + static_cast<std::ptrdiff_t>(t), all.begin() + static_cast<std::ptrdiff_t>(t) + 3);
  const SurfaceVolume closed(ball.positions(), all), open(ball.positions(), kept, {}, Rims::Fixed);
  ASSERT_FALSE(open.rimVertices().empty());
  std::vector<bool> moves(ball.vertexCount(), false);
  for (const Index v : kept) moves[v] = true;
  for (const Index v : open.rimVertices()) moves[v] = false;
  auto d = noise(4, ball.vertexCount());
  for (std::size_t v = 0; v < d.size(); ++v)
    if (!moves[v]) d[v].setZero();
  const auto x = test::added(ball.positions(), d, 0.2);
  EXPECT_NEAR(open.value(x) - open.value(ball.positions()), closed.value(x) - closed.value(ball.positions()), 1e-14);
}

TEST(SurfaceVolume, SameBitsOnAnyNumberOfThreads) {
  const mesh::Mesh ball = sphere(200, 100);
  const SurfaceVolume volume(ball.positions(), ball.triangles());
  std::vector<double> value;
  for (const int threads : {1, 2, 7}) {
    const ThreadLimit limit(threads);
    value.push_back(volume.value(ball.positions()));
  }
  EXPECT_EQ(value[0], value[1]);
  EXPECT_EQ(value[0], value[2]);
}

// More items than one chunk holds.
TEST(IndexLists, AreInTheOrderOfPuttingOnAnyNumberOfThreads) {
  constexpr std::size_t kKeys = 1000, kCount = 400'000;
  std::vector<std::vector<Index>> expected(kKeys);
  const auto each = [](std::size_t begin, std::size_t end, auto&& put) {
    for (std::size_t i = begin; i < end; ++i) put(static_cast<Index>(i * i % 997), static_cast<Index>(i));
  };
  each(0, kCount, [&](Index key, Index item) { expected[key].push_back(item); });
  for (const int threads : {1, 2, 7}) {
    const ThreadLimit limit(threads);
    const detail::IndexLists lists = detail::makeIndexLists(kKeys, kCount, each);
    for (std::size_t k = 0; k < kKeys; ++k)
      ASSERT_TRUE(std::equal(lists[k].begin(), lists[k].end(), expected[k].begin(), expected[k].end())) << "key " << k;
  }
}

}  // namespace
}  // namespace fielddeform::volume
