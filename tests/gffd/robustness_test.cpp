// Skeletons as users make them by accident: whatever comes in, every vertex ends finite and with one status.
#include <fielddeform/core/random.h>
#include <gtest/gtest.h>
#include <tests/gffd/gffd_testing.h>

namespace fielddeform::gffd::tests {
namespace {

using skeleton::Primitive;
using skeleton::PrimitiveType;
using skeleton::Skeleton;

class Random {
 public:
  explicit Random(std::uint64_t seed) : seed_(seed) {}
  double operator()(double low, double high) { return low + (high - low) * uniform01(seed_, next_++); }
  std::size_t below(std::size_t n) { return splitmix64(seed_, next_++) % n; }
  Vec3 point(double size) { return {(*this)(-size, size), (*this)(-size, size), (*this)(-size, size)}; }

 private:
  std::uint64_t seed_, next_ = 0;
};

Primitive somePrimitive(Random& random, const std::string& name) {
  Primitive p;
  p.name = name;
  p.type = static_cast<PrimitiveType>(random.below(3));
  const std::size_t n = 3 + random.below(6);
  const bool straight = random.below(2) == 0, coincident = random.below(6) == 0;
  const Vec3 at = random.point(.5), along = random.point(1);
  for (std::size_t i = 0; i < n; ++i)
    p.points.push_back(coincident ? at : straight ? Vec3(at + along * (static_cast<double>(i / 2) / static_cast<double>(n))) : random.point(1));
  if (p.type == PrimitiveType::Polyline) p.closed = random.below(3) == 0;
  if (p.type == PrimitiveType::Mesh)
    for (Index i = 2; i < n; ++i) p.faces.push_back({0, i - 1, i});
  p.radius = std::exp(random(-4, 1));
  if (random.below(3) == 0)
    for (std::size_t i = 0; i < n; ++i) p.pointRadius.push_back(std::exp(random(-3, 1)));
  if (p.type == PrimitiveType::Polyline && random.below(3) == 0)
    for (std::size_t i = 0; i < n; ++i) p.roll.push_back(random(-7, 7));
  p.weight = random.below(5) == 0 ? 0 : random(.1, 3);
  return p;
}

Skeleton posedFrom(Random& random, Skeleton s) {
  for (Primitive& p : s.primitives) {
    const double size = std::exp(random(-6, 2));
    const std::size_t how = random.below(5);
    for (Vec3& x : p.points)
      x = how == 0 ? p.points[0] : how == 1 ? Vec3(-x) : how == 2 ? Vec3(x * size) : Vec3(x + random.point(size));
  }
  if (random.below(4) == 0) s.primitives.push_back(somePrimitive(random, "added"));
  if (s.primitives.size() > 1 && random.below(4) == 0) s.primitives.erase(s.primitives.begin());
  return s;
}

void checkSeeds(std::uint64_t first, std::uint64_t last) {
  const mesh::Mesh mesh = fielddeform::tests::makeCapsule({.around = 12, .along = 14});
  for (std::uint64_t seed = first; seed < last; ++seed) {
    Random random(seed);
    Skeleton rest;
    for (std::size_t i = 0; i <= random.below(3); ++i) rest.primitives.push_back(somePrimitive(random, std::string(1, static_cast<char>(97 + i))));
    const Skeleton posed = posedFrom(random, rest);
    Options options;
    options.predictor = static_cast<Predictor>(random.below(5));
    options.strictValue = random.below(5) == 0;
    options.retry = random.below(2) == 0;
    options.falloff = static_cast<Falloff>(random.below(3));
    options.field.potential = static_cast<skeleton::Potential>(random.below(4));
    SCOPED_TRACE(seed);
    Deformed d = [&] {
      try {
        return track(mesh, rest, posed, options);
      } catch (const std::invalid_argument& e) {
        // The warp needs corresponding points; nothing else may be refused here.
        EXPECT_EQ(options.predictor, Predictor::Warp) << e.what();
        options.predictor = Predictor::Mls;
        return track(mesh, rest, posed, options);
      }
    }();
    const StatusCounts n = countStatuses(d.status);
    EXPECT_EQ(n[0] + n[1] + n[2] + n[3], mesh.vertexCount());
    EXPECT_EQ(n[4], 0u);
    for (std::size_t i = 0; i < mesh.vertexCount(); ++i) {
      ASSERT_TRUE(d.position[i].allFinite()) << i;
      ASSERT_TRUE(d.residual[i] >= 0) << i;
      if (d.status[i] == Status::Fixed) {
        ASSERT_EQ(d.position[i], mesh.positions()[i]);
      }
    }
  }
}

TEST(GffdRobustness, RandomSkeletonPairsEndWithFiniteVerticesAndOneStatusEach) { checkSeeds(0, 25); }
TEST(GffdRobustnessSlow, ManyRandomSkeletonPairsEndWithFiniteVerticesAndOneStatusEach) { checkSeeds(25, 300); }

TEST(GffdRobustness, AMeshOnItsSkeletonAndAnEmptyMeshAreFine) {
  Primitive p;
  p.name = "line";
  p.points = fielddeform::tests::verticalLine(5, 2);
  Skeleton rest{{p}, {}}, posed = rest;
  posed.primitives[0].points.back() += Vec3(.5, 0, 0);
  const mesh::Mesh on({{0, 0, 0}, {0, 0, .5}, {0, 0, -1}}, {0, 1, 2});
  const Deformed d = track(on, rest, posed);
  for (const Vec3& x : d.position) EXPECT_TRUE(x.allFinite());
  EXPECT_TRUE(track({}, rest, posed).position.empty());
}

}  // namespace
}  // namespace fielddeform::gffd::tests
