#pragma once

#include <fielddeform/core/types.h>
#include <fielddeform/spatial/detail/oriented_boxes.h>

#include <cstddef>
#include <cstdint>

/// onTriangle() for many queries at once in the best vector instructions that the processor has, with the same bits.
namespace fielddeform::spatial::detail {

inline constexpr std::size_t kBlock = 64;  ///< queries that share a search
inline constexpr std::size_t kGroup = 8;   ///< of them at once

/// No query p is nearer than the root of least + offset . (p - centre) to what this stands for; rounding allowed for.
struct LinearBound {
  double least;
  double offset[3];
};

/// All of a triangle that does not depend on the query.
struct TriangleTest {
  double a[3], b[3], c[3], ab[3], ac[3], bc[3], n[3];
  double ab2, ac2, bc2, inverse;  // inverse: 1 / |n|^2
  double along[3], across[3], along2, across2, share;  // thin: as refineProjection()
  bool plane, thin, swap, refined;
  double element;     // its index
  LinearBound bound;
};

/// A triangle of which the bound is left open.
TriangleTest makeTest(const Vec3& a, const Vec3& b, const Vec3& c, Index element) noexcept;

/// Queries; those from the count on to the next whole group hold anything finite.
struct LaneQueries {
  alignas(64) double x[kBlock], y[kBlock], z[kBlock];
  Vec3 centre;
};

/// The nearest triangle so far to each query of a group, of equally near ones that of the lowest index: squared distance, element
/// and number among the tests (infinite: none), offset, weights.
struct GroupHits {
  alignas(64) double square[kGroup], element[kGroup], test[kGroup], x[kGroup], y[kGroup], z[kGroup], u[kGroup], v[kGroup], w[kGroup];
  GroupHits() noexcept;
};

/// Those of the bounds that leave something nearer, or equally near, to a query of the group that begins at `at`. @return how many
std::size_t boundsWithin(std::span<const LinearBound> bounds, const LaneQueries& queries, std::size_t at, const GroupHits& hits, std::uint16_t* which);

/// A leaf's box, if it has one, and what its distances may err by.
struct LeafBox {
  const OrientedBox* box;
  double slack;
};

/// Those of `which` whose boxes leave something nearer, or equally near, to a query of the group; in place. @return how many
std::size_t boxesWithin(const LeafBox* leaves, std::span<std::uint16_t> which, const LaneQueries& queries, std::size_t at, const GroupHits& hits);

/// Tries the triangles tests[which[...]]; the sooner the near ones come, the fewer are looked at.
void tryTriangles(const TriangleTest* tests, std::span<const std::uint16_t> which, const LaneQueries& queries, std::size_t at, GroupHits& hits);

}  // namespace fielddeform::spatial::detail
