#include <fielddeform/map/linear_map.h>

namespace fielddeform::map {

SparseRows LinearMap::basisAt(const Binding& binding, std::span<const Index> points) const {
  const SparseRows all = basis(binding);
  SparseRows rows;
  rows.columns = all.columns;
  for (const Index p : points) {
    for (std::size_t k = all.start[p]; k < all.start[p + 1]; ++k) {
      rows.column.push_back(all.column[k]);
      rows.value.push_back(all.value[k]);
    }
    rows.start.push_back(rows.column.size());
  }
  return rows;
}

}  // namespace fielddeform::map
