#pragma once

#include <fielddeform/core/types.h>

#include <cstddef>

/// The inner loops over rows of a dense basis or form, in the processor's best vector instructions with the same bytes in all:
/// sums run in four fixed lanes.
namespace fielddeform::volume::detail {

inline constexpr std::size_t kLanes = 4;
inline std::size_t padded(std::size_t n) { return (n + kLanes - 1) / kLanes * kLanes; }

/// out_r = row r times (x, y, z).
/// @param rows     #R by stride, stride a multiple of kLanes
/// @param columns  x, y, z, stride numbers each
void dot3Rows(const double* rows, std::size_t stride, std::size_t count, const double* columns, Vec3* out);

/// sums += row r of `rows` times g_r, coordinate by coordinate, in the order of r.
/// @param index  row of each r, or null: r itself    @param sums  x, y, z, stride numbers each
void addRows(const double* rows, std::size_t stride, const Index* index, std::size_t count, const Vec3* g, double* sums);

/// w += a ^ b: a_j b_k - a_k b_j for j < k < n, in lexicographic order of (j, k).
void addWedge(const double* a, const double* b, std::size_t n, double* w);

}  // namespace fielddeform::volume::detail
