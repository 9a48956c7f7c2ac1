// A primitive's distance sampled in a sparse grid. The samples are exact; what is between them is interpolated, but near
// the primitive, where the distance has a cusp, the exact distance takes over.
#include <fielddeform/core/parallel.h>
#include <fielddeform/field/detail/distance_source.h>
#include <fielddeform/field/detail/vdb_grid.h>
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
    if (!grid_->sample(point, sampling_, sampled.value, sampled.gradient)) return std::nullopt;
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
    const double reach = radius_ + kGridBorder * lattice_.voxel;
    Box box = distance_.bounds();
    box.min().array() -= reach;
    box.max().array() += reach;
    const auto reaches = [&](const Vec3& centre, double radius) {
      // Deep inside a solid the exact distance does.
      const auto hit = distance_.closest(centre);
      return hit && std::abs(hit->distance) <= reach + radius;
    };
    return around.empty() ? coverBlocks(lattice_, box, budget, reaches)
                          : coverPoints(lattice_, around, kGridMargin, budget, reaches);
  }

  void fill(const std::vector<Cell>& corners) {
    parallelFor(corners.size(), 4, [&](std::size_t begin, std::size_t end) {
      for (std::size_t b = begin; b < end; ++b) fillBlock(corners[b], grid_->values(b));
    });
  }

  void fillBlock(const Cell& corner, float* out) const {
    ClosestHint hint;
    Vec3 last = Vec3::Zero();
    double depth = 0;  // of the last point: within it no surface is crossed
    bool inside = false;
    for (std::size_t j = 0; j < kBlockSize; ++j) {
      const Vec3 p = lattice_.point(pointOf(corner, j));
      hint.inside.reset();
      if (distance_.isWatertight() && (p - last).norm() < 0.999 * depth) hint.inside = inside;
      const auto hit = distance_.closest(p, std::numeric_limits<double>::infinity(), hint);
      if (!hit) {  // coordinates beyond the doubles
        out[j] = std::numeric_limits<float>::max();
        continue;
      }
      out[j] = static_cast<float>(hit->distance / distance_.radiusAt(*hit) * radius_);
      hint.element = hit->element;
      inside = hit->distance < 0;
      depth = std::abs(hit->distance);
      last = p;
    }
  }

  const PrimitiveDistance& distance_;
  Sampling sampling_;
  double radius_;  // the samples are d / r times this
  double near_ = 0;
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
