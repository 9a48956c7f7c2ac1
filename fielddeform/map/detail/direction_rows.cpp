#include <fielddeform/map/detail/direction_rows.h>

#include <Eigen/LU>
#include <algorithm>

namespace fielddeform::map::detail {

SparseRows directionRows(const Lattice& lattice, Points points, Points directions) {
  const Mat3 toBox = lattice.box.axes.inverse();
  SparseRows rows;
  rows.columns = lattice.nodeCount();
  for (std::size_t p = 0; p < points.size(); ++p) {
    const Vec3 u = toBox * (points[p] - lattice.box.origin), along = toBox * directions[p];
    std::array<AxisBasis::Values, 3> at;
    bool moved = true;
    for (int a = 0; a < 3; ++a) {
      const double inside = std::clamp(u[a], 0.0, 1.0);
      moved = moved && (inside == u[a] || lattice.outside == Outside::Extend);
      at[a] = lattice.axis[a].evaluate(inside);
      // Outside, the functions go on along their tangents.
      for (std::size_t k = 0; k < at[a].weight.size(); ++k) at[a].weight[k] += at[a].slope[k] * (u[a] - inside);
    }
    for (std::size_t k = 0; moved && k < at[2].weight.size(); ++k)
      for (std::size_t j = 0; j < at[1].weight.size(); ++j)
        for (std::size_t i = 0; i < at[0].weight.size(); ++i) {
          const double x = at[0].weight[i], y = at[1].weight[j], z = at[2].weight[k];
          const double slope =
              along[0] * at[0].slope[i] * y * z + along[1] * x * at[1].slope[j] * z + along[2] * x * y * at[2].slope[k];
          if (slope == 0) continue;
          rows.column.push_back(lattice.index(at[0].first + static_cast<int>(i), at[1].first + static_cast<int>(j),
                                              at[2].first + static_cast<int>(k)));
          rows.value.push_back(slope);
        }
    rows.start.push_back(rows.column.size());
  }
  return rows;
}

}  // namespace fielddeform::map::detail
