#include <fielddeform/core/parallel.h>
#include <fielddeform/gffd/detail/displacement_grid.h>
#include <fielddeform/gffd/detail/grid_kernel.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace fielddeform::gffd::detail {
namespace {

// Nearer than this (in radii) the displacement can have cusps: the cell is checked at nine points, not five.
constexpr double kNear = 0.3;
constexpr std::size_t kFewChecks = 5, kChecks = 9;

// The centre of a cell, then the middles of its eight parts: four that touch by edges only, and the other four.
struct CheckPoints {
  double u[16], v[16], w[16];
  CheckPoints() {
    constexpr int kParts[16] = {0, 0, 3, 5, 6, 1, 2, 4, 7, 0, 0, 0, 0, 0, 0, 0};
    for (std::size_t p = 0; p < 16; ++p) {
      const int part = kParts[p];
      const bool centre = p == 0 || p >= kChecks;
      u[p] = centre ? 0.5 : part & 1 ? 0.75 : 0.25;
      v[p] = centre ? 0.5 : part & 2 ? 0.75 : 0.25;
      w[p] = centre ? 0.5 : part & 4 ? 0.75 : 0.25;
    }
  }
};

struct Interpolated {
  double x[16], y[16], z[16];
};

void put(const Vec3& p, std::size_t k, Block& block) {
  block.x[k] = p[0];
  block.y[k] = p[1];
  block.z[k] = p[2];
}

}  // namespace

DisplacementGrid::DisplacementGrid(const CellFrame& frame, Source source)
    : frame_(frame), source_(std::move(source)), cells_(std::make_shared<const Cells>()) {}

void DisplacementGrid::Cells::polynomial(const CellIndex& cell, double* coefficients) const {
  double* at = coefficients;
  for (const std::uint32_t n : around_[cells_.find(cell)]) {
    const Vec3& d = node_[n];
    *at++ = d[0];
    *at++ = d[1];
    *at++ = d[2];
  }
  cubicFromNodes(coefficients);
}

std::shared_ptr<const DisplacementGrid::Cells> DisplacementGrid::with(std::span<const CellOrder::Run> runs,
                                                                      Progress& progress) const {
  std::shared_ptr<const Cells> known;
  {
    const std::lock_guard lock(mutex_);
    known = cells_;
  }
  const bool complete = std::all_of(runs.begin(), runs.end(), [&](const CellOrder::Run& r) {
    return known->cells_.find(r.cell) != CellTable::kNone;
  });
  if (complete) return known;
  auto cells = std::make_shared<Cells>(*known);
  std::vector<CellIndex> newCells, newNodes;
  const auto firstCell = static_cast<std::uint32_t>(cells->fine_.size()), firstNode = static_cast<std::uint32_t>(cells->node_.size());
  for (const auto& run : runs) {
    const auto next = static_cast<std::uint32_t>(firstCell + newCells.size());
    if (cells->cells_.insert(run.cell, next) != next) continue;
    newCells.push_back(run.cell);
    std::uint32_t* around = cells->around_.emplace_back().data();
    for (int i = -1; i < 3; ++i)
      for (int j = -1; j < 3; ++j)
        for (int k = -1; k < 3; ++k) {
          const CellIndex node{run.cell.x + i, run.cell.y + j, run.cell.z + k};
          const auto number = static_cast<std::uint32_t>(firstNode + newNodes.size());
          *around = cells->nodes_.insert(node, number);
          if (*around++ == number) newNodes.push_back(node);
        }
  }
  cells->node_.resize(firstNode + newNodes.size());
  cells->fine_.resize(firstCell + newCells.size());
  parallelFor(newNodes.size(), kLanes, [&](std::size_t begin, std::size_t end) {
    progress.throwIfCancelled();
    for (std::size_t n = begin; n < end; n += kLanes)
      fill(*cells, std::span(newNodes).subspan(n, std::min(kLanes, end - n)), static_cast<std::uint32_t>(firstNode + n));
  });
  parallelFor(newCells.size(), kLanes, [&](std::size_t begin, std::size_t end) {
    progress.throwIfCancelled();
    for (std::size_t n = begin; n < end; n += kLanes)
      check(*cells, std::span(newCells).subspan(n, std::min(kLanes, end - n)), static_cast<std::uint32_t>(firstCell + n));
  });
  const std::lock_guard lock(mutex_);
  cells_ = cells;
  return cells;
}

void DisplacementGrid::fill(Cells& cells, std::span<const CellIndex> nodes, std::uint32_t first) const {
  Block points{}, displacements;
  for (std::size_t n = 0; n < nodes.size(); ++n) put(frame_.node(nodes[n]), n, points);
  source_.displacements(points, nodes.size(), displacements);
  for (std::size_t n = 0; n < nodes.size(); ++n)
    cells.node_[first + n] = Vec3(displacements.x[n], displacements.y[n], displacements.z[n]);
}

void DisplacementGrid::check(Cells& cells, std::span<const CellIndex> some, std::uint32_t first) const {
  const CheckPoints at;
  Block points{}, exact;
  std::array<Interpolated, kLanes> interpolated;
  std::array<double, kLanes> nearness;
  for (std::size_t n = 0; n < some.size(); ++n) {
    alignas(64) double polynomial[kCoefficients];
    cells.polynomial(some[n], polynomial);
    cubicAt(polynomial, kChecks, at.u, at.v, at.w, interpolated[n].x, interpolated[n].y, interpolated[n].z);
    put(frame_.centre(some[n]), n, points);
  }
  const auto close = [&](std::size_t cell, std::size_t part, std::size_t k) {
    const Interpolated& i = interpolated[cell];
    const Vec3 off(exact.x[k] - i.x[part], exact.y[k] - i.y[part], exact.z[k] - i.z[part]);
    return 2 * off.norm() <= source_.tolerance;
  };
  source_.nearness(points, some.size(), nearness.data());
  source_.displacements(points, some.size(), exact);
  for (std::size_t n = 0; n < some.size(); ++n) cells.fine_[first + n] = close(n, 0, n);
  // The other points of what has passed so far, as many cells at a time as fill a block.
  std::size_t count = 0;
  std::array<std::pair<std::size_t, std::size_t>, kLanes> owner;
  const auto judge = [&] {
    if (count > 0) source_.displacements(points, count, exact);
    for (std::size_t k = 0; k < count; ++k)
      if (!close(owner[k].first, owner[k].second, k)) cells.fine_[first + owner[k].first] = false;
    count = 0;
  };
  for (std::size_t n = 0; n < some.size(); ++n) {
    if (!cells.fine_[first + n]) continue;
    for (std::size_t part = 1; part < (nearness[n] < kNear ? kChecks : kFewChecks); ++part) {
      put(frame_.origin + frame_.side * Vec3(some[n].x + at.u[part], some[n].y + at.v[part], some[n].z + at.w[part]), count, points);
      owner[count++] = {n, part};
      if (count == kLanes) judge();
    }
  }
  judge();
}

}  // namespace fielddeform::gffd::detail
