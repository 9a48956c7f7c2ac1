#pragma once

#include <fielddeform/core/types.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace fielddeform::numeric::detail {

/// Points sorted into cubic cells, to find those within a distance. Order and answers depend on the points alone.
class CellList {
 public:
  /// @param reach  the greatest distance that will be asked for, > 0
  CellList(Points points, double reach);

  std::size_t size() const noexcept { return points_.size(); }
  const Vec3& point(std::size_t i) const noexcept { return points_[i]; }
  Index original(std::size_t i) const noexcept { return original_[i]; }  ///< number among the points given

  /// Calls f(i, q - point(i), squared distance) for the points nearer to q than `distance` <= reach, always in one order.
  template <class F>
  void forEachNear(const Vec3& q, double distance, F&& f) const {
    std::int64_t low[3], high[3];
    for (int k = 0; k < 3; ++k) {
      const double u = (q[k] - low_[k]) / cell_, reach = distance / cell_;
      if (!(u + reach >= 0) || !(u - reach <= static_cast<double>(count_[k]))) return;
      low[k] = std::max<std::int64_t>(0, static_cast<std::int64_t>(std::floor(u - reach)));
      high[k] = std::min<std::int64_t>(count_[k] - 1, static_cast<std::int64_t>(std::floor(u + reach)));
    }
    const double bound = distance * distance;
    for (std::int64_t x = low[0]; x <= high[0]; ++x)
      for (std::int64_t y = low[1]; y <= high[1]; ++y) {
        const std::size_t row = static_cast<std::size_t>((x * count_[1] + y) * count_[2]);
        const Index end = begin_[row + static_cast<std::size_t>(high[2]) + 1];
        for (Index i = begin_[row + static_cast<std::size_t>(low[2])]; i < end; ++i) {
          const Vec3 offset = q - points_[i];
          const double r2 = offset.squaredNorm();
          if (r2 < bound) f(i, offset, r2);
        }
      }
  }

 private:
  Vec3 low_ = Vec3::Zero();
  double cell_ = 1;
  std::int64_t count_[3] = {1, 1, 1};
  std::vector<Index> begin_;  // of each cell, z fastest; one more at the end
  std::vector<Vec3> points_;
  std::vector<Index> original_;
};

/// For every point the first point within `distance` of it that stands for itself: its own number, or that of an
/// earlier one.
std::vector<Index> mergeNear(Points points, double distance);

/// `chosen` and, in their order, all further points that are at least `spacing` from every one chosen before.
std::vector<Index> thin(Points points, double spacing, std::vector<Index> chosen);

}  // namespace fielddeform::numeric::detail
