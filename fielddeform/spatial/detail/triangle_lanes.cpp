#include <fielddeform/core/detail/simd.h>
#include <fielddeform/spatial/detail/simplex_inline.h>
#include <fielddeform/spatial/detail/triangle_lanes.h>

#include <algorithm>
#include <limits>
#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace fielddeform::spatial::detail {
namespace {

using fielddeform::detail::SimdLevel, fielddeform::detail::simdLevel;

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
  const WithinTask task{bounds, queries, at, hits, which};
  switch (simdLevel()) {
    case SimdLevel::Avx512: return avx512::within(task);
    case SimdLevel::Avx2: return avx2::within(task);
    case SimdLevel::Baseline: break;
  }
  return baseline::within(task);
}

std::size_t boxesWithin(const LeafBox* leaves, std::span<std::uint16_t> which, const LaneQueries& queries, std::size_t at, const GroupHits& hits) {
  const BoxTask task{leaves, which, queries, at, hits};
  switch (simdLevel()) {
    case SimdLevel::Avx512: return avx512::inBoxes(task);
    case SimdLevel::Avx2: return avx2::inBoxes(task);
    case SimdLevel::Baseline: break;
  }
  return baseline::inBoxes(task);
}

void tryTriangles(const TriangleTest* tests, std::span<const std::uint16_t> which, const LaneQueries& queries, std::size_t at, GroupHits& hits) {
  const TryTask task{tests, which, queries, at, hits};
  switch (simdLevel()) {
    case SimdLevel::Avx512: return avx512::tryAll(task);
    case SimdLevel::Avx2: return avx2::tryAll(task);
    case SimdLevel::Baseline: return baseline::tryAll(task);
  }
}

}  // namespace fielddeform::spatial::detail
