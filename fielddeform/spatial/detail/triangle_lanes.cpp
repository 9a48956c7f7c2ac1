#include <fielddeform/core/detail/simd.h>
#include <fielddeform/spatial/detail/simplex_inline.h>
#include <fielddeform/spatial/detail/triangle_lanes.h>

#include <algorithm>
#include <limits>

namespace fielddeform::spatial::detail {
namespace {

struct WithinTask {
  std::span<const LinearBound> bounds;
  const LaneQueries& queries;
  std::size_t at;
  const GroupHits& hits;
  std::uint16_t* which;
};

struct BoxTask {
  const LeafBox* leaves;
  std::span<std::uint16_t> which;
  const LaneQueries& queries;
  std::size_t at;
  const GroupHits& hits;
};

struct TryTask {
  const TriangleTest* tests;
  std::span<const std::uint16_t> which;
  const LaneQueries& queries;
  std::size_t at;
  GroupHits& hits;
};

#define FIELDDEFORM_LEVEL_SOURCE <fielddeform/spatial/detail/triangle_lanes_level.h>
#include <fielddeform/core/detail/each_level.h>

FIELDDEFORM_BY_LEVEL(runWithin, const WithinTask, within)
FIELDDEFORM_BY_LEVEL(runInBoxes, const BoxTask, inBoxes)
FIELDDEFORM_BY_LEVEL(runTryAll, const TryTask, tryAll)

void store(const Vec3& from, double* to) {
  for (int k = 0; k < 3; ++k) to[k] = from[k];
}

}  // namespace

TriangleTest makeTest(const Vec3& a, const Vec3& b, const Vec3& c, Index element) noexcept {
  TriangleTest t{};
  const Vec3 ab = b - a, ac = c - a, bc = c - b, n = ab.cross(ac);
  store(a, t.a);
  store(b, t.b);
  store(c, t.c);
  store(ab, t.ab);
  store(ac, t.ac);
  store(bc, t.bc);
  store(n, t.n);
  t.ab2 = square(ab);
  t.ac2 = square(ac);
  t.bc2 = square(bc);
  t.element = static_cast<double>(element);
  const double n2 = square(n);
  t.inverse = 1 / n2;
  t.thin = !(n2 > kThin * t.ab2 * t.ac2);
  t.plane = n2 > kFlat * t.ab2 * t.ac2 && n2 > 0;
  if (!t.plane || !t.thin) return t;
  t.swap = t.ac2 > t.ab2;
  const Vec3 &e = t.swap ? ac : ab, &f = t.swap ? ab : ac;
  t.along2 = square(e);
  t.share = dot(e, f) / t.along2;
  const Vec3 across = f - t.share * e;
  t.across2 = square(across);
  t.refined = t.across2 > 0;
  store(e, t.along);
  store(across, t.across);
  return t;
}

GroupHits::GroupHits() noexcept {
  for (double* lanes : {square, element, test}) std::fill_n(lanes, kGroup, std::numeric_limits<double>::infinity());
  for (double* lanes : {x, y, z, u, v, w}) std::fill_n(lanes, kGroup, 0.0);
}

std::size_t boundsWithin(std::span<const LinearBound> bounds, const LaneQueries& queries, std::size_t at, const GroupHits& hits, std::uint16_t* which) {
  return runWithin({bounds, queries, at, hits, which});
}

std::size_t boxesWithin(const LeafBox* leaves, std::span<std::uint16_t> which, const LaneQueries& queries, std::size_t at, const GroupHits& hits) {
  return runInBoxes({leaves, which, queries, at, hits});
}

void tryTriangles(const TriangleTest* tests, std::span<const std::uint16_t> which, const LaneQueries& queries, std::size_t at, GroupHits& hits) {
  runTryAll({tests, which, queries, at, hits});
}

}  // namespace fielddeform::spatial::detail
