#pragma once

#include <fielddeform/field/detail/distance_source.h>
#include <fielddeform/field/detail/vdb_grid.h>
#include <fielddeform/field/detail/voxel_distances.h>

#include <functional>
#include <memory>
#include <optional>
#include <vector>

namespace fielddeform::field::detail {

/// The blend that is sampled. What it points to outlives the grid.
struct BlendSource {
  struct Part {
    const PrimitiveDistance* distance;
    double weight;                              ///< > 0
  };
  std::vector<Part> parts;                      ///< at least one
  double reference = 1;                         ///< R, world
  double sharpness = 4;                         ///< k
  bool exponential = true;                      ///< every potential: then the errors have bounds
  std::function<double(const Vec3&)> value;     ///< exact D, extended beyond the radii, world; called from many threads
  /// The same of up to kCube points that lie together.
  std::function<void(Points, std::span<double>, SearchHints&)> values;
};

/// The whole blended pseudo-distance D sampled in one sparse grid. The samples are exact; cells that a primitive's cusp may
/// reach are marked, and left to the exact field.
class BlendGrid {
 public:
  /// @param around  keep only voxels near these points; none: wherever a primitive reaches
  /// @throw std::invalid_argument if it would take more than the budget; std::runtime_error in a build without OpenVDB
  BlendGrid(BlendSource source, const GridOptions& options, Points around, GridBudget& budget, DistanceReport& report);

  struct Sample {
    Relative blend;                       ///< D and its gradient, world
    double share = 1;                     ///< from 0 to 1: of the way from the exact field to this one
    Vec3 shareGradient = Vec3::Zero();
  };
  /// Nothing: the exact field is to be taken here.
  std::optional<Sample> at(const Vec3& point) const;

 private:
  struct Near {
    double distance;                      ///< world, unsigned
    Vec3 direction;
  };
  void chooseVoxel(const GridOptions& options);
  double overlap() const;
  bool reaches(const Vec3& centre, double radius) const;
  Near nearest(const Vec3& point, double bound) const;
  void fill(const std::vector<Cell>& corners);
  void fillCube(std::size_t block, const Cell& corner, std::size_t first, SearchHints& blended, SearchHints& marks);
  double smoothError(double voxel) const;
  void describe(DistanceReport& report) const;

  BlendSource source_;
  Sampling sampling_;
  double least_ = 0, greatest_ = 0;       // radii
  double steepness_ = 1;                  // P: the greatest sum of the primitives' shares in the slope of D
  bool alone_ = false;                    // one primitive of weight 1 at every place: D is its distance
  bool pointRadius_ = false;
  double near_ = 0;                       // world: nearer to a primitive the field is exact
  Lattice lattice_;
  std::unique_ptr<VdbGrid> grid_;
};

}  // namespace fielddeform::field::detail
