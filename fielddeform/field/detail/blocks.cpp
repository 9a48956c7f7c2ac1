#include <fielddeform/core/parallel.h>
#include <fielddeform/field/detail/blocks.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace fielddeform::field::detail {
namespace {

constexpr double kMostSide = 1 << 29;  // points: sums of two coordinates stay within 32 bits

[[noreturn]] void refuse(const BlockBudget& budget, double voxel, double blocks) {
  throw std::invalid_argument(fmt::format("{} needs about {:.4g} MB with voxels of {:.4g}, must be <= {:.4g} MB: a larger "
                                          "voxel or tolerance, or more memory",
                                          budget.what, blocks * budget.bytesEach * 1e-6, voxel, budget.megabytes));
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

}  // namespace fielddeform::field::detail
