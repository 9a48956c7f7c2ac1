#include <fielddeform/core/parallel.h>
#include <fielddeform/gffd/detail/displacement_grid.h>
#include <fielddeform/gffd/detail/grid_kernel.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::gffd::detail {
namespace {

// Nearer than this (in radii) the displacement can have cusps: the cell is checked at nine points, not five.
constexpr double kNear = 0.3;

}  // namespace

DisplacementGrid::DisplacementGrid(const CellFrame& frame, Source source)
    : frame_(frame), source_(std::move(source)), cells_(std::make_shared<const Cells>()) {}

void DisplacementGrid::Cells::polynomial(const CellIndex& cell, double* coefficients) const {
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j)
      for (int k = 0; k < 4; ++k, coefficients += 3) {
        const Vec3& d = node_[nodes_.find({cell.x + i - 1, cell.y + j - 1, cell.z + k - 1})];
        coefficients[0] = d[0];
        coefficients[1] = d[1];
        coefficients[2] = d[2];
      }
  cubicFromNodes(coefficients - kCoefficients);
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
    for (int i = -1; i < 3; ++i)
      for (int j = -1; j < 3; ++j)
        for (int k = -1; k < 3; ++k) {
          const CellIndex node{run.cell.x + i, run.cell.y + j, run.cell.z + k};
          const auto number = static_cast<std::uint32_t>(firstNode + newNodes.size());
          if (cells->nodes_.insert(node, number) == number) newNodes.push_back(node);
        }
  }
  cells->node_.resize(firstNode + newNodes.size());
  cells->fine_.resize(firstCell + newCells.size());
  parallelFor(newNodes.size(), 64, [&](std::size_t begin, std::size_t end) {
    progress.throwIfCancelled();
    for (std::size_t n = begin; n < end; ++n) cells->node_[firstNode + n] = source_.displacement(frame_.node(newNodes[n]));
  });
  parallelFor(newCells.size(), 32, [&](std::size_t begin, std::size_t end) {
    progress.throwIfCancelled();
    for (std::size_t n = begin; n < end; ++n) check(*cells, newCells[n], static_cast<std::uint32_t>(firstCell + n));
  });
  const std::lock_guard lock(mutex_);
  cells_ = cells;
  return cells;
}

void DisplacementGrid::check(Cells& cells, const CellIndex& cell, std::uint32_t number) const {
  alignas(64) double polynomial[kCoefficients];
  cells.polynomial(cell, polynomial);
  // The centre, then the middles of its eight parts: four that touch by edges only, and the other four.
  constexpr int kParts[16] = {0, 0, 3, 5, 6, 1, 2, 4, 7, 0, 0, 0, 0, 0, 0, 0};
  double u[16], v[16], w[16], x[16], y[16], z[16];
  for (int p = 0; p < 16; ++p) {
    const int part = kParts[p];
    u[p] = p == 0 || p > 8 ? 0.5 : part & 1 ? 0.75 : 0.25;
    v[p] = p == 0 || p > 8 ? 0.5 : part & 2 ? 0.75 : 0.25;
    w[p] = p == 0 || p > 8 ? 0.5 : part & 4 ? 0.75 : 0.25;
  }
  const std::size_t points = source_.nearness(frame_.centre(cell)) < kNear ? 9 : 5;
  cubicAt(polynomial, points, u, v, w, x, y, z);
  bool fine = true;
  for (std::size_t p = 0; p < points && fine; ++p) {
    const Vec3 at = frame_.origin + frame_.side * Vec3(cell.x + u[p], cell.y + v[p], cell.z + w[p]);
    const double error = (source_.displacement(at) - Vec3(x[p], y[p], z[p])).norm();
    fine = 2 * error <= source_.tolerance;
  }
  cells.fine_[number] = fine;
}

}  // namespace fielddeform::gffd::detail
