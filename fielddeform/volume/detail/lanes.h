#pragma once

#include <fielddeform/core/types.h>
#include <fielddeform/volume/detail/wedge_plan.h>

#include <cstddef>
#include <vector>

/// The inner loops over rows of a dense basis or form, in the processor's best vector instructions with the same bytes in all:
/// sums run in four fixed lanes.
namespace fielddeform::volume::detail {

inline constexpr std::size_t kLanes = 4;
inline std::size_t padded(std::size_t n) { return (n + kLanes - 1) / kLanes * kLanes; }

/// out_r = base_r + row r times (x, y, z).
/// @param rows     #R by stride, stride a multiple of kLanes
/// @param columns  x, y, z, stride numbers each    @param base #R, or null: without
void dot3Rows(const double* rows, std::size_t stride, std::size_t count, const double* columns, const Vec3* base, Vec3* out);

/// sums += row r of `rows` times g_r, coordinate by coordinate, in the order of r.
/// @param index  row of each r, or null: r itself    @param sums  x, y, z, stride numbers each
void addRows(const double* rows, std::size_t stride, const Index* index, std::size_t count, const Vec3* g, double* sums);

/// Where a ^ b of rows of n numbers goes: for each j its columns k from first(j), a multiple of kLanes at or below j + 1, to the
/// end of the padded row. What stands there for k <= j is of no use.
struct WedgeLayout {
  explicit WedgeLayout(std::size_t nodes);
  static std::size_t first(std::size_t j) { return (j + 1) / kLanes * kLanes; }
  std::size_t at(std::size_t j, std::size_t k) const { return offset[j] + (k - first(j)); }

  std::size_t n, stride, width = 0;  ///< stride: padded(n); width: of a whole product, a multiple of kLanes
  std::vector<std::size_t> offset;   ///< n - 1
};

/// out_r = sum_m (first_m - minus_m) ^ second_m over the products m of owner r, in their order.
/// @param rows  #V by layout.stride, padded with zeros    @param out (end - begin) by width, for the owners begin .. end
void wedgeRows(const WedgeLayout& layout, const WedgePlan& plan, const double* rows, std::size_t begin, std::size_t end, double* out);

/// sums += rows^T products: sums(i, p) += sum_r rows(owner r, i) products(r, p), in the order of r.
/// @param owner #R row numbers    @param products #R by width    @param sums stride by width
void addOuter(const WedgeLayout& layout, const double* rows, const Index* owner, const double* products, std::size_t count, double* sums);

}  // namespace fielddeform::volume::detail
