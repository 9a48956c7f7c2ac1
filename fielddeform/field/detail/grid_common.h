#pragma once

#include <fielddeform/field/detail/blocks.h>
#include <fielddeform/field/distance.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

/// What the grid of one primitive and that of the whole field share.
namespace fielddeform::field::detail {

inline constexpr double kGridNear = 0.1;       ///< nearer than this share of the radius, or than so many voxels, the field is exact
inline constexpr double kGridNearVoxels = 3;
inline constexpr double kGridMixed = 1.5;      ///< up to this multiple of it the two are mixed
inline constexpr double kGridBorder = 3.5;     ///< voxels beyond the radius: as far as the quadratic stencil of a point reaches
inline constexpr double kGridMargin = 3;       ///< voxels around a vertex, where the grid follows a mesh: the quadratic stencil and one to spare
inline constexpr double kGridFloat = 0x1p-24;  ///< rounding of a sample

/// Memory that the grids of one field may take together.
class GridBudget {
 public:
  explicit GridBudget(const GridOptions& options) : options_(options), left_(options.maxMegabytes - options.takenMegabytes) {}
  BlockBudget forBlocks(std::string what) const;
  /// The exact size of a grid, before it is made. @throw std::invalid_argument if it is too large
  void require(const std::vector<Cell>& corners, double voxel, const std::string& what) const;
  void take(double megabytes) { left_ -= megabytes; }

 private:
  GridOptions options_;
  double left_;
};

/// Greatest of the differences at the centres of some thousand cells: always the same ones.
/// @param difference  nothing where the grid is not used
double measureError(const Lattice& lattice, const std::vector<Cell>& corners,
                    const std::function<std::optional<double>(const Vec3&)>& difference);

}  // namespace fielddeform::field::detail
