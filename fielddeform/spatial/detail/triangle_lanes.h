#pragma once

#include <fielddeform/core/types.h>

#include <cstddef>

/// onTriangle() for many queries at once in the best vector instructions that the processor has, with the same bits.
namespace fielddeform::spatial::detail {

inline constexpr std::size_t kBlock = 64;  ///< queries at once

/// All of a triangle that does not depend on the query.
struct TriangleTest {
  double a[3], b[3], c[3], ab[3], ac[3], bc[3], n[3];
  double ab2, ac2, bc2, inverse;  // inverse: 1 / |n|^2
  double along[3], across[3], along2, across2, share;  // thin: as refineProjection()
  bool plane, thin, swap, refined;
  double element;   // its index
  double least;     // no query is nearer than the root of least + offset . (query - centre); rounding allowed for
  double offset[3];
};

/// A triangle of which `least` and `offset` are left open.
TriangleTest makeTest(const Vec3& a, const Vec3& b, const Vec3& c, Index element) noexcept;

/// Queries; those from the count on to the next multiple of eight hold anything finite.
struct LaneQueries {
  alignas(64) double x[kBlock], y[kBlock], z[kBlock];
  Vec3 centre;
};

/// The nearest of the tested triangles to each; of equally near ones the one of the lowest index.
struct LaneHits {
  alignas(64) double square[kBlock], element[kBlock], x[kBlock], y[kBlock], z[kBlock], u[kBlock], v[kBlock], w[kBlock];
};

/// @param tests  at least one; the sooner the near ones come, the fewer are tried
void nearestTriangles(const TriangleTest* tests, std::size_t testCount, const LaneQueries& queries, std::size_t count, LaneHits& hits);

}  // namespace fielddeform::spatial::detail
