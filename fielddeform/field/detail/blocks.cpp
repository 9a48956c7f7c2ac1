#include <fielddeform/core/parallel.h>
#include <fielddeform/field/detail/blocks.h>
#include <fielddeform/field/distance.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace fielddeform::field::detail {
namespace {

constexpr double kMostSide = 1 << 29;  // points: sums of two coordinates stay within 32 bits

[[noreturn]] void refuseMegabytes(const BlockBudget& budget, double voxel, double megabytes) {
  const bool shared = budget.limit > budget.megabytes;
  throw GridMemoryError(fmt::format("{} needs about {:.4g} MB with voxels of {:.4g}, must be <= {:.4g} MB{}: a larger voxel or "
                                    "tolerance, or more memory",
                                    budget.what, megabytes, voxel, budget.megabytes,
                                    shared ? fmt::format(", what other grids left of {:.4g} MB", budget.limit) : ""));
}

[[noreturn]] void refuse(const BlockBudget& budget, double voxel, double blocks) {
  refuseMegabytes(budget, voxel, blocks * budget.bytesEach * 1e-6);
}

// Corners of the nodes of side `side` points that reach, of those given.
std::vector<Cell> keep(const std::vector<Cell>& nodes, const Lattice& lattice, double side,
                       const std::function<bool(const Vec3&, double)>& reaches) {
  std::vector<char> kept(nodes.size(), 0);
  const double half = 0.5 * (side - 1), radius = std::numbers::sqrt3 * half * lattice.voxel;
  parallelFor(nodes.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      kept[i] = reaches(lattice.point(nodes[i]) + Vec3::Constant(half * lattice.voxel), radius);
  });
  std::vector<Cell> out;
  for (std::size_t i = 0; i < nodes.size(); ++i)
    if (kept[i]) out.push_back(nodes[i]);
  return out;
}

}  // namespace

std::vector<Cell> coverBlocks(const Lattice& lattice, const Box& box, const BlockBudget& budget,
                              const std::function<bool(const Vec3&, double)>& reaches) {
  const double most = budget.megabytes * 1e6 / budget.bytesEach;
  const Vec3 low = lattice.local(box.min()), high = lattice.local(box.max());
  const double widest = std::max({-low.minCoeff(), high.maxCoeff(), 0.0});
  if (!(widest < kMostSide / 2)) refuse(budget, lattice.voxel, std::pow(widest / kSide, 3));
  std::int32_t side = kSide;
  while (side < 2 * widest) side *= 2;
  // Eight nodes around the origin, then halves.
  std::vector<Cell> nodes;
  for (std::int32_t j = 0; j < 8; ++j) nodes.push_back({j & 4 ? 0 : -side, j & 2 ? 0 : -side, j & 1 ? 0 : -side});
  for (;; side /= 2) {
    nodes = keep(nodes, lattice, side, reaches);
    if (static_cast<double>(nodes.size()) > most)
      refuse(budget, lattice.voxel, static_cast<double>(nodes.size()) * std::pow(side / kSide, 3));
    if (side == kSide) break;
    std::vector<Cell> halves;
    halves.reserve(8 * nodes.size());
    for (const Cell& n : nodes)
      for (std::int32_t j = 0; j < 8; ++j)
        halves.push_back({n[0] + (j & 4 ? side / 2 : 0), n[1] + (j & 2 ? side / 2 : 0), n[2] + (j & 1 ? side / 2 : 0)});
    nodes = std::move(halves);
  }
  std::sort(nodes.begin(), nodes.end());
  return nodes;
}

void requireBudget(const BlockBudget& budget, double voxel, double megabytes) {
  if (megabytes > budget.megabytes) refuseMegabytes(budget, voxel, megabytes);
}

namespace {

void sortUnique(std::vector<Cell>& cells) {
  std::sort(cells.begin(), cells.end());
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
}

std::int32_t cornerOf(double coordinate) { return static_cast<std::int32_t>(std::floor(coordinate / kSide)) * kSide; }

}  // namespace

std::vector<Cell> coverPoints(const Lattice& lattice, Points points, double margin, const BlockBudget& budget,
                              const std::function<bool(const Vec3&, double)>& reaches) {
  constexpr std::size_t kMany = 1 << 22;  // listed before duplicates are dropped
  std::vector<Cell> nodes;
  std::size_t limit = kMany;
  Cell lastLow{1, 1, 1}, lastHigh{1, 1, 1};  // no corner
  for (const Vec3& p : points) {
    const Vec3 u = lattice.local(p);
    if (!u.allFinite() || !(u.cwiseAbs().maxCoeff() < kMostSide / 2)) continue;
    Cell low, high;
    for (int k = 0; k < 3; ++k) {
      low[static_cast<std::size_t>(k)] = cornerOf(u[k] - margin);
      high[static_cast<std::size_t>(k)] = cornerOf(u[k] + margin);
    }
    if (low == lastLow && high == lastHigh) continue;  // a mesh's vertices often lie beside the last ones
    lastLow = low;
    lastHigh = high;
    for (std::int32_t x = low[0]; x <= high[0]; x += kSide)
      for (std::int32_t y = low[1]; y <= high[1]; y += kSide)
        for (std::int32_t z = low[2]; z <= high[2]; z += kSide) nodes.push_back({x, y, z});
    if (nodes.size() < limit) continue;
    sortUnique(nodes);
    limit = std::max(kMany, 2 * nodes.size());
  }
  sortUnique(nodes);
  nodes = keep(nodes, lattice, kSide, reaches);
  if (static_cast<double>(nodes.size()) > budget.megabytes * 1e6 / budget.bytesEach)
    refuse(budget, lattice.voxel, static_cast<double>(nodes.size()));
  return nodes;
}

}  // namespace fielddeform::field::detail
