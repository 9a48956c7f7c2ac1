#include <fielddeform/core/parallel.h>
#include <fielddeform/core/random.h>
#include <fielddeform/field/detail/grid_common.h>
#include <fielddeform/field/detail/vdb_grid.h>

#include <algorithm>

namespace fielddeform::field::detail {

BlockBudget GridBudget::forBlocks(std::string what) const {
  return {std::max(left_, 0.0), VdbGrid::kBytesEach, std::move(what), options_.maxMegabytes};
}

void GridBudget::require(const std::vector<Cell>& corners, double voxel, const std::string& what) const {
  requireBudget(forBlocks(what), voxel, VdbGrid::megabytesOf(corners));
}

double measureError(const Lattice& lattice, const std::vector<Cell>& corners,
                    const std::function<std::optional<double>(const Vec3&)>& difference) {
  constexpr std::size_t kCells = 4096;
  if (corners.empty()) return 0;
  return deterministicReduce(
      kCells, 64, 0.0,
      [&](std::size_t begin, std::size_t end) {
        double greatest = 0;
        for (std::size_t i = begin; i < end; ++i) {
          const std::uint64_t hash = splitmix64(17, i);
          const Cell& corner = corners[i * corners.size() / kCells];
          const Vec3 p = lattice.point(pointOf(corner, hash % kBlockSize)) + Vec3::Constant(0.5 * lattice.voxel);
          if (const auto d = difference(p)) greatest = std::max(greatest, *d);
        }
        return greatest;
      },
      [](double a, double b) { return std::max(a, b); });
}

}  // namespace fielddeform::field::detail
