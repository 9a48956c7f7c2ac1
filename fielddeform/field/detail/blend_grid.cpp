// The blended pseudo-distance in one grid. D = (R/k) E^-1(S) has a cusp on every primitive, kinks where the closest point
// jumps or another primitive begins to count, and is smooth elsewhere.
#include <fielddeform/core/parallel.h>
#include <fielddeform/field/detail/blend_grid.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace fielddeform::field::detail {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kMostBlocks = 32;  // along the longest side, to find how many primitives meet

}  // namespace

BlendGrid::BlendGrid(BlendSource source, const GridOptions& options, Points around, GridBudget& budget, DistanceReport& report)
    : source_(std::move(source)), sampling_(options.sampling), least_(kInfinity) {
  Box box;
  for (const auto& part : source_.parts) {
    least_ = std::min(least_, part.distance->leastRadius());
    greatest_ = std::max(greatest_, part.distance->greatestRadius());
    pointRadius_ = pointRadius_ || part.distance->hasPointRadius();
    box.extend(part.distance->bounds());
  }
  lattice_.origin = box.center();
  chooseVoxel(options);
  const double more = greatest_ + kGridBorder * lattice_.voxel;
  box.min().array() -= more;
  box.max().array() += more;
  const auto reach = [this](const Vec3& centre, double radius) { return reaches(centre, radius); };
  const std::string what = "the distance grid of the whole field";
  const BlockBudget blocks = budget.forBlocks(what);
  const std::vector<Cell> corners = around.empty() ? coverBlocks(lattice_, box, blocks, reach)
                                                   : coverPoints(lattice_, around, kGridMargin, blocks, reach);
  budget.require(corners, lattice_.voxel, what);
  grid_ = std::make_unique<VdbGrid>(lattice_, corners, static_cast<float>(source_.reference));
  fill(corners);
  budget.take(grid_->megabytes());
  describe(report);
  report.measuredError = measureError(lattice_, corners, [this](const Vec3& p) -> std::optional<double> {
    const auto sample = at(p);
    if (!sample || sample->share < 1) return std::nullopt;
    return std::abs(sample->blend.value - source_.value(p));
  });
}

// The greatest weight that meets in one place: an upper bound from blocks half a radius wide.
double BlendGrid::overlap() const {
  const auto meeting = [this](const Vec3& centre, double radius) {
    double sum = 0;
    for (const auto& part : source_.parts) {
      const auto hit = part.distance->closest(centre, part.distance->greatestRadius() + radius);
      if (hit && hit->distance <= part.distance->greatestRadius() + radius) sum += part.weight;
    }
    return sum;
  };
  Box box;
  for (const auto& part : source_.parts) box.extend(part.distance->bounds());
  box.min().array() -= greatest_;
  box.max().array() += greatest_;
  const double side = std::max(0.5 * least_, box.sizes().maxCoeff() / kMostBlocks), radius = 0.5 * std::numbers::sqrt3 * side;
  std::array<std::size_t, 3> count{};
  for (int k = 0; k < 3; ++k) count[static_cast<std::size_t>(k)] = 1 + static_cast<std::size_t>(box.sizes()[k] / side);
  return deterministicReduce(
      count[0] * count[1] * count[2], 256, 0.0,
      [&](std::size_t begin, std::size_t end) {
        double most = 0;
        for (std::size_t i = begin; i < end; ++i) {
          const std::size_t x = i / (count[1] * count[2]), y = i / count[2] % count[1], z = i % count[2];
          const Vec3 cell(static_cast<double>(x), static_cast<double>(y), static_cast<double>(z));
          most = std::max(most, meeting(box.min() + side * (cell + Vec3::Constant(0.5)), radius));
        }
        return most;
      },
      [](double a, double b) { return std::max(a, b); });
}

// With E = exp(-x) - exp(-k) and p_i = w_i exp(-x_i) / (S + exp(-k)) the slope of D is (R/k) sum p_i grad x_i, P = sum p_i is at
// most max(1, sum of the weights that meet), and D's second derivatives along the axes add up to at most
//   (R/k) [ sum p_i k/r_i 2/d_i + max(1, P - 1) sum p_i (k/r_i)^2 ],
// the second sum absent where D is one primitive's distance. Trilinear interpolation errs by h^2 / 8 times that.
double BlendGrid::smoothError(double voxel) const {
  const double near = std::max(kGridNear * least_, kGridNearVoxels * voxel) - std::numbers::sqrt3 * voxel;
  double bend = 2 * steepness_ / (least_ * near);
  if (!alone_) bend += std::max(1.0, steepness_ - 1) * steepness_ * source_.sharpness / (least_ * least_);
  return voxel * voxel / 8 * source_.reference * bend;
}

void BlendGrid::chooseVoxel(const GridOptions& options) {
  if (source_.parts.size() == 1) {
    steepness_ = std::max(1.0, source_.parts[0].weight);
    alone_ = source_.parts[0].weight == 1;
  } else {
    steepness_ = std::max(1.0, overlap());
  }
  if (options.voxel) {
    lattice_.voxel = *options.voxel;
  } else {
    // smoothError() grows with the voxel: bisection.
    const double wanted = options.tolerance * source_.reference;
    double low = 0, high = 0.25 * least_;
    if (smoothError(high) <= wanted) low = high;
    for (int i = 0; i < 60 && low < high; ++i) {
      const double middle = 0.5 * (low + high);
      (smoothError(middle) <= wanted ? low : high) = middle;
    }
    lattice_.voxel = low;
  }
  near_ = std::max(kGridNear * least_, kGridNearVoxels * lattice_.voxel);
}

bool BlendGrid::reaches(const Vec3& centre, double radius) const {
  for (const auto& part : source_.parts) {
    const double reach = part.distance->greatestRadius() + kGridBorder * lattice_.voxel;
    if (part.distance->reaches(centre, reach + radius)) return true;  // deep inside a solid the exact field does
  }
  return false;
}

BlendGrid::Near BlendGrid::nearest(const Vec3& point, double bound) const {
  Near near{bound, Vec3::Zero()};
  for (const auto& part : source_.parts) {
    const auto hit = part.distance->closest(point, near.distance, {kNoIndex, false});
    if (hit && hit->distance < near.distance) near = {hit->distance, hit->direction};
  }
  return near;
}

void BlendGrid::fill(const std::vector<Cell>& corners) {
  parallelFor(corners.size(), 16, [&](std::size_t begin, std::size_t end) {
    SearchHints blended, marks(source_.parts.size());
    for (std::size_t b = begin; b < end; ++b)
      for (std::size_t first = 0; first < kBlockSize; first += kCube) fillCube(b, corners[b], first, blended, marks);
  });
}

void BlendGrid::fillCube(std::size_t block, const Cell& corner, std::size_t first, SearchHints& blended, SearchHints& marks) {
  // A cell with a point nearer than kGridMixed * near_ has all its corners, and a stencil's, nearer than this.
  const double marked = kGridMixed * near_ + 2 * std::numbers::sqrt3 * lattice_.voxel;
  std::array<Vec3, kCube> points;
  std::array<double, kCube> value;
  std::array<PrimitiveHit, kCube> hits;
  for (std::size_t i = 0; i < kCube; ++i) points[i] = lattice_.point(pointOf(corner, nearOrder(first + i)));
  source_.values(points, value, blended);
  float* out = grid_->values(block);
  for (std::size_t i = 0; i < kCube; ++i) out[nearOrder(first + i)] = static_cast<float>(std::min(value[i], 1e30));
  for (std::size_t k = 0; k < source_.parts.size(); ++k) {
    source_.parts[k].distance->closestWithin(points, marked, hits, marks[k]);
    for (std::size_t i = 0; i < kCube; ++i)
      if (hits[i].element != kNoIndex && std::abs(hits[i].distance) < marked) grid_->switchOff(block, nearOrder(first + i));
  }
}

void BlendGrid::describe(DistanceReport& report) const {
  report.kind = Distance::Grid;
  report.voxel = lattice_.voxel;
  report.voxels = grid_->voxelCount();
  report.megabytes = grid_->megabytes();
  report.exactWithin = near_;
  if (!source_.exponential || pointRadius_) return;
  const double rounding = kGridFloat * source_.reference;
  report.smoothError = smoothError(lattice_.voxel) + rounding;
  report.kinkError = std::numbers::sqrt3 / 2 * lattice_.voxel * steepness_ * source_.reference / least_ + rounding;
}

std::optional<BlendGrid::Sample> BlendGrid::at(const Vec3& point) const {
  Sample s;
  bool clear = true;
  if (!grid_->sample(point, sampling_, s.blend.value, s.blend.gradient, &clear)) return std::nullopt;
  if (clear) return s;
  const Near near = nearest(point, kGridMixed * near_);
  if (near.distance <= near_) return std::nullopt;
  const double unit = 1 / ((kGridMixed - 1) * near_);
  s.share = (near.distance - near_) * unit;
  s.shareGradient = unit * near.direction;
  return s;
}

}  // namespace fielddeform::field::detail
