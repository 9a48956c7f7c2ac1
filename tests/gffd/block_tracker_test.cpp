// Blocks of vertices against the same vertices one by one: every byte.
#include <fielddeform/core/detail/simd.h>
#include <fielddeform/core/parallel.h>
#include <fielddeform/core/random.h>
#include <fielddeform/gffd/detail/block_tracker.h>
#include <gtest/gtest.h>
#include <tests/gffd/gffd_testing.h>

#include <algorithm>

namespace fielddeform::gffd::tests {
namespace {

using detail::Stage;
using detail::Tracked;
using fielddeform::tests::bendMap;
using fielddeform::tests::makeCapsule;
using fielddeform::tests::verticalLine;

skeleton::Primitive shell(const char* name, int around, int along, double radius) {
  const mesh::Mesh inner = makeCapsule({.radius = 0.12, .around = around, .along = along, .bump = 0});
  skeleton::Primitive p;
  p.name = name;
  p.type = skeleton::PrimitiveType::Mesh;
  p.points = inner.positions();
  p.radius = radius;
  for (std::size_t f = 0; f < inner.faceCount(); ++f) p.faces.emplace_back(inner.face(f).begin(), inner.face(f).end());
  return p;
}

struct Edit {
  const char* name;
  skeleton::Skeleton rest, posed;
};

Edit bent(const char* name, std::vector<skeleton::Primitive> primitives) {
  Edit e{name, {primitives, {}}, {primitives, {}}};
  for (auto& p : e.posed.primitives) p.points = bendMap(p.points, 1.2);
  return e;
}

// Shells coarse and fine, a solid, a radius a point; a shell with a line and points; a line alone; edited radii.
std::vector<Edit> edits() {
  std::vector<Edit> all;
  all.push_back(bent("coarse", {shell("shell", 8, 7, 0.5)}));
  all.push_back(bent("fine", {shell("shell", 40, 60, 0.5)}));
  auto solid = shell("solid", 12, 15, 0.5), radii = shell("radii", 12, 15, 0.5);
  solid.closed = true;
  for (std::size_t i = 0; i < radii.points.size(); ++i) radii.pointRadius.push_back(0.35 + 0.2 * uniform01(5, i));
  all.push_back(bent("solid", {solid}));
  all.push_back(bent("radii", {radii}));
  skeleton::Primitive line, dots;
  line.name = "line";
  line.points = verticalLine(30, 2, 0.2);
  line.radius = 0.4;
  dots.name = "dots";
  dots.type = skeleton::PrimitiveType::Points;
  dots.points = {{0.1, 0.3, 0.2}, {0.1, -0.3, -0.2}};
  dots.radius = 0.3;
  all.push_back(bent("mixed", {shell("shell", 12, 15, 0.3), line, dots}));
  all.push_back(bent("line", {line}));
  auto grown = bent("grown", {shell("shell", 12, 15, 0.5)});
  grown.posed.primitives[0].radius = 0.65;
  all.push_back(grown);
  return all;
}

struct Results {
  std::vector<Vec3> position, safe;
  std::vector<Status> status;
  std::vector<float> residual;
  bool operator==(const Results& o) const {
    return position == o.position && safe == o.safe && status == o.status && residual == o.residual;
  }
};

Results sized(std::size_t n) { return {std::vector<Vec3>(n, Vec3::Zero()), std::vector<Vec3>(n, Vec3::Zero()), std::vector<Status>(n), std::vector<float>(n)}; }

Results together(const Stage& stage, const detail::GffdBinding& binding) {
  Results r = sized(binding.size());
  Progress silent;
  detail::trackByBlocks(stage, binding, {.position = r.position, .safe = r.safe, .status = r.status, .residual = r.residual}, silent);
  return r;
}

Results oneByOne(const Stage& stage, const detail::GffdBinding& binding) {
  Results r = sized(binding.size());
  for (std::size_t i = 0; i < binding.size(); ++i) {
    if (!binding.movable(i)) continue;
    const Tracked t = stage.track(binding.rest[i], binding.value(i));
    r.position[i] = t.position;
    r.safe[i] = t.safe;
    r.status[i] = t.status;
    r.residual[i] = static_cast<float>(t.residual);
  }
  return r;
}

// In an order that scatters neighbours, with points beyond all radii and some that are not finite.
std::vector<Vec3> scattered() {
  std::vector<Vec3> points = makeCapsule({.radius = 0.3, .around = 60, .along = 60}).positions();
  for (std::uint64_t i = points.size(); i > 1; --i) std::swap(points[i - 1], points[splitmix64(3, i) % i]);
  points.resize(1200);
  points[7] = Vec3(5, 5, 5);
  points[8][1] = std::numeric_limits<double>::quiet_NaN();
  return points;
}

TEST(BlockTracker, TracksEveryVertexToTheByteAsOneByOne) {
  const std::vector<Vec3> points = scattered();
  for (const Edit& e : edits())
    for (const Falloff falloff : {Falloff::Off, Falloff::On}) {
      const Options options{.predictor = Predictor::Axial, .falloff = falloff};
      const auto pair = skeleton::pairSkeletons(e.rest, e.posed);
      const auto embedding = detail::makeEmbedding(pair, options.field);
      const Stage stage(*embedding, pair, options);
      ASSERT_TRUE(stage.axial() && embedding->cells);
      const auto binding = detail::bindPoints(embedding, points);
      const Results expected = oneByOne(stage, *binding);
      EXPECT_TRUE(together(stage, *binding) == expected) << e.name;
      std::size_t met = 0;
      for (std::size_t i = 0; i < points.size(); ++i)
        if (binding->movable(i) && expected.status[i] == Status::Converged) {
          ++met;
          ASSERT_LE(expected.residual[i], 1.0001e-4 * stage.radius());  // a float's rounding
        }
      EXPECT_GT(met, points.size() / 3) << e.name;
    }
}

TEST(BlockTracker, EveryInstructionSetAndThreadCountWritesTheSameBytes) {
  using fielddeform::detail::SimdLevel;
  const std::vector<Vec3> points = scattered();
  const Edit e = edits()[0];
  const auto pair = skeleton::pairSkeletons(e.rest, e.posed);
  const Options options{.predictor = Predictor::Axial, .falloff = Falloff::Off};
  const auto embedding = detail::makeEmbedding(pair, options.field);
  const Stage stage(*embedding, pair, options);
  const auto binding = detail::bindPoints(embedding, points);
  const Results first = together(stage, *binding);
  for (const SimdLevel level : {SimdLevel::Baseline, SimdLevel::Avx2, SimdLevel::Avx512}) {
    if (level > fielddeform::detail::supportedSimdLevel()) continue;
    const fielddeform::detail::SimdLimit limit(level);
    EXPECT_TRUE(together(stage, *binding) == first) << toString(level);
  }
  for (const int threads : {1, 2, 7}) {
    const ThreadLimit limit(threads);
    EXPECT_TRUE(together(stage, *binding) == first) << threads;
  }
}

TEST(BlockTracker, MapsWithBlocksLeaveFixedAndInvalidPointsAsTheyWere) {
  const std::vector<Vec3> points = scattered();
  const Edit e = edits()[0];
  ResolvedOptions resolved;
  resolved.options = {.predictor = Predictor::Axial, .evaluation = Evaluation::Exact, .falloff = Falloff::Off};
  resolved.skeletons = skeleton::pairSkeletons(e.rest, e.posed);
  const GffdMap map(resolved);
  Results r = sized(points.size());
  Progress silent;
  const auto counts = map.applyCounted(*map.bind(points), {.position = r.position, .safe = r.safe, .status = r.status, .residual = r.residual}, silent);
  EXPECT_EQ(counts.exact, map.countMovable(*map.bind(points)));
  EXPECT_EQ(r.status[7], Status::Fixed);
  EXPECT_EQ(r.position[7], points[7]);
  EXPECT_EQ(r.status[8], Status::Invalid);
  EXPECT_TRUE(std::isnan(r.position[8][1]));
}

// With a grid the corrections of a mesh's field go by blocks too.
TEST(BlockTracker, ResidualsAreKeptWhereAGridPredicts) {
  const mesh::Mesh mesh = makeCapsule({.around = 60, .along = 60});
  const Edit e = edits()[1];
  const GffdMap map(resolve({.predictor = Predictor::Mls, .evaluation = Evaluation::Grid, .falloff = Falloff::Off}, mesh,
                            skeleton::pairSkeletons(e.rest, e.posed)));
  ASSERT_TRUE(map.usesGrid());
  Results r = sized(mesh.vertexCount());
  Progress silent;
  map.applyCounted(*map.bind(mesh.positions()), {.position = r.position, .safe = r.safe, .status = r.status, .residual = r.residual}, silent);
  EXPECT_GT(countStatuses(r.status)[static_cast<std::size_t>(Status::Converged)], mesh.vertexCount() * 99 / 100);
}

}  // namespace
}  // namespace fielddeform::gffd::tests
