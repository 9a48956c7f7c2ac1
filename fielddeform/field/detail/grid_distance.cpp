// A primitive's distance sampled in a sparse grid. The samples are exact; what is between them is interpolated, but near
// the primitive, where the distance has a cusp, the exact distance takes over.
#include <fielddeform/field/detail/distance_source.h>
#include <fielddeform/field/detail/vdb_grid.h>
#include <fielddeform/field/detail/voxel_distances.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

namespace fielddeform::field::detail {
namespace {

// The distance to points, lines and planes has second derivatives of at most 1 / d across two directions, and trilinear
// interpolation errs by at most h^2 / 8 times their sum.
double smoothError(double voxel, double near) {
  return voxel * voxel / (4 * (near - std::numbers::sqrt3 * voxel));
}

// The voxel whose smoothError() at `near` is `error`.
double voxelFor(double error, double near) {
  const double b = 2 * std::numbers::sqrt3 * error;
  return std::sqrt(b * b + 4 * error * near) - b;
}

class GridDistance final : public DistanceSource {
 public:
  GridDistance(const PrimitiveDistance& distance, const std::string& name, const GridOptions& options, Points around,
               GridBudget& budget, DistanceReport& report)
      : distance_(distance), sampling_(options.sampling), radius_(distance.greatestRadius()) {
    const double least = distance.leastRadius();
    lattice_.voxel = options.voxel.value_or(voxelFor(options.tolerance * least, kGridNear * least));
    // In units of the samples: with a radius per point they are larger than the distance by up to this.
    const double excess = radius_ / least, near = std::max(kGridNear * least, kGridNearVoxels * lattice_.voxel);
    near_ = near * excess;
    reach_ = radius_ + kGridBorder * lattice_.voxel;
    lattice_.origin = distance.bounds().center();
    const std::string what = fmt::format("the distance grid of \"{}\"", name);
    const std::vector<Cell> corners = cover(around, budget.forBlocks(what));
    budget.require(corners, lattice_.voxel, what);
    grid_ = std::make_unique<VdbGrid>(lattice_, corners, static_cast<float>(radius_));
    fill(corners);
    budget.take(grid_->megabytes());
    report.kind = Distance::Grid;
    report.voxel = lattice_.voxel;
    report.voxels = grid_->voxelCount();
    report.megabytes = grid_->megabytes();
    report.exactWithin = near;
    const double rounding = kGridFloat * radius_;
    if (!distance.hasPointRadius()) report.smoothError = smoothError(lattice_.voxel, near_) + rounding;
    report.kinkError = std::numbers::sqrt3 / 2 * lattice_.voxel * excess + rounding;
    report.measuredError = measureError(lattice_, corners, [this](const Vec3& p) { return errorAt(p); });
  }

  std::optional<Relative> at(const Vec3& point) const override {
    Relative sampled;
    bool within = true;
    if (!grid_->sample(point, sampling_, sampled.value, sampled.gradient, &within) || !within) return std::nullopt;
    const double d = std::abs(sampled.value);  // about the distance: at most, with a radius per point
    sampled.value /= radius_;
    sampled.gradient /= radius_;
    if (d >= kGridMixed * near_) return sampled;
    if (d <= near_) return std::nullopt;
    const auto hit = distance_.closest(point);
    if (!hit) return std::nullopt;
    const double unit = (sampled.value < 0 ? -1 : 1) * radius_ / ((kGridMixed - 1) * near_);
    return mix(exactRelative(distance_, *hit), sampled, (d - near_) / ((kGridMixed - 1) * near_), unit * sampled.gradient);
  }

 private:
  // Where the grid alone counts.
  std::optional<double> errorAt(const Vec3& point) const {
    const auto sampled = at(point);
    const auto hit = distance_.closest(point);
    if (!sampled || !hit || std::abs(hit->distance) < kGridMixed * near_) return std::nullopt;
    return radius_ * std::abs(sampled->value - hit->distance / distance_.radiusAt(*hit));
  }

  std::vector<Cell> cover(Points around, const BlockBudget& budget) const {
    Box box = distance_.bounds();
    box.min().array() -= reach_;
    box.max().array() += reach_;
    // Deep inside a solid the exact distance does.
    const auto reaches = [&](const Vec3& centre, double radius) { return distance_.reaches(centre, reach_ + radius); };
    return around.empty() ? coverBlocks(lattice_, box, budget, reaches)
                          : coverPoints(lattice_, around, kGridMargin, budget, reaches);
  }

  // Voxels out of reach are switched off: the exact distance answers there, and need not be found here.
  void fill(const std::vector<Cell>& corners) {
    voxelDistances(distance_, lattice_, corners, reach_, [&](std::size_t block, std::size_t first, std::span<const VoxelHit> hits) {
      float* out = grid_->values(block);
      for (std::size_t i = 0; i < hits.size(); ++i) {
        const std::size_t j = nearOrder(first + i);
        if (hits[i].element == kNoIndex) grid_->switchOff(block, j);
        else out[j] = static_cast<float>(hits[i].distance / distance_.radiusAt(hits[i].element, hits[i].weight) * radius_);
      }
    });
  }

  const PrimitiveDistance& distance_;
  Sampling sampling_;
  double radius_;  // the samples are d / r times this
  double near_ = 0;
  double reach_ = 0;  // world, of a voxel that counts
  Lattice lattice_;
  std::unique_ptr<VdbGrid> grid_;
};

}  // namespace

std::unique_ptr<DistanceSource> makeGridDistance(const PrimitiveDistance& distance, const std::string& name,
                                                 const GridOptions& options, Points around, GridBudget& budget,
                                                 DistanceReport& report) {
  return std::make_unique<GridDistance>(distance, name, options, around, budget, report);
}

}  // namespace fielddeform::field::detail
