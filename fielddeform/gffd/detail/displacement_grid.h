#pragma once

#include <fielddeform/core/progress.h>
#include <fielddeform/gffd/detail/cells.h>
#include <fielddeform/gffd/detail/grid_kernel.h>

#include <array>
#include <functional>
#include <memory>
#include <mutex>

namespace fielddeform::gffd::detail {

/// The predictor's displacement at the nodes of the cells that were asked for, and which of those cells it can be
/// interpolated in. Nodes are computed once and kept: midpoints and further meshes in the same cells find them there.
/// Every value follows from its node and the predictor alone. Safe to use from many threads.
class DisplacementGrid {
 public:
  /// What is put on the grid.
  struct Source {
    std::function<void(const Block&, std::size_t, Block&)> displacements;  ///< exact, at a block of rest points
    std::function<void(const Block&, std::size_t, double*)> nearness;      ///< distances to the skeleton in radii
    double tolerance = 0;  ///< twice what interpolation may be off where it is checked, world
  };
  /// Nodes and cells at one moment; never changes.
  class Cells {
   public:
    /// Whether the cell may be interpolated in. It must have been asked for.
    bool fine(const CellIndex& cell) const { return fine_[cells_.find(cell)] != 0; }
    std::size_t nodeCount() const noexcept { return node_.size(); }
    /// The cell's polynomial. @param coefficients  kCoefficients numbers
    void polynomial(const CellIndex& cell, double* coefficients) const;

   private:
    friend class DisplacementGrid;
    CellTable nodes_, cells_;
    std::vector<Vec3> node_;
    std::vector<std::array<std::uint32_t, 64>> around_;  // each cell's nodes
    std::vector<char> fine_;
  };

  DisplacementGrid(const CellFrame& frame, Source source);
  /// The grid with at least these cells. @throw Cancelled
  std::shared_ptr<const Cells> with(std::span<const CellOrder::Run> runs, Progress& progress) const;
  const CellFrame& frame() const noexcept { return frame_; }

 private:
  void fill(Cells& cells, std::span<const CellIndex> nodes, std::uint32_t first) const;
  void check(Cells& cells, std::span<const CellIndex> some, std::uint32_t first) const;

  CellFrame frame_;
  Source source_;
  mutable std::mutex mutex_;
  mutable std::shared_ptr<const Cells> cells_;
};

}  // namespace fielddeform::gffd::detail
