#pragma once

#include <fielddeform/core/parallel.h>
#include <fielddeform/gffd/detail/cells.h>

#include <algorithm>
#include <array>
#include <vector>

namespace fielddeform::gffd::detail {

/// Points of a cell by part, so that those that share a block are near one another in meshes of any order.
class PartOrder {
 public:
  static constexpr std::uint32_t kSplit = 96;  ///< a cell with more points is sorted by its parts
  PartOrder(const CellFrame& frame, Points rest) : frame_(frame), rest_(rest) {}

  std::span<const std::uint32_t> sort(const CellIndex& cell, std::span<const std::uint32_t> points) {
    part_.resize(points.size());
    sorted_.resize(points.size());
    std::array<std::uint32_t, kParts * kParts * kParts + 1> start{};
    for (std::size_t k = 0; k < points.size(); ++k) {
      const Vec3 at = (rest_[points[k]] - frame_.node(cell)) * (kParts * frame_.inverse);
      const auto along = [&](int axis) { return static_cast<int>(std::clamp(at[axis], 0.0, kParts - kEdge)); };
      const int x = along(0), y = along(1), z = along(2);
      // The eight parts of one octant follow one another.
      part_[k] = static_cast<std::uint8_t>((x & 2) << 4 | (y & 2) << 3 | (z & 2) << 2 | (x & 1) << 2 | (y & 1) << 1 | (z & 1));
      ++start[part_[k] + std::size_t{1}];
    }
    for (std::size_t p = 1; p < start.size(); ++p) start[p] += start[p - 1];
    for (std::size_t k = 0; k < points.size(); ++k) sorted_[start[part_[k]]++] = points[k];
    for (std::size_t o = 0; o < kOctants; ++o) ends_[o] = start[kParts * kParts * kParts / kOctants * (o + 1) - 1];
    return sorted_;
  }
  /// Where the points of each octant end in what sort() returned.
  const std::array<std::uint32_t, 8>& octantEnds() const { return ends_; }

 private:
  static constexpr int kParts = 4;  // along an axis
  static constexpr std::size_t kOctants = 8;
  static constexpr double kEdge = 1e-12;

  const CellFrame& frame_;
  Points rest_;
  std::vector<std::uint8_t> part_;
  std::vector<std::uint32_t> sorted_;
  std::array<std::uint32_t, 8> ends_{};
};

/// Walks through all points of an order in tasks of some thousand, in parallel, each in an order in which neighbours follow one
/// another: task(forEach) is called once a task, and forEach(worker) calls worker.take(i) for each of its points and worker.pause()
/// where the next point may lie elsewhere.
template <class Task>
void forEachNeighbourhood(const CellFrame& frame, const CellOrder& cells, Points rest, Progress& progress, Task&& task) {
  constexpr std::uint32_t kTask = 4096;  // points
  // Tasks of whole cells; one large cell is a task.
  std::vector<std::size_t> tasks{0};
  std::uint32_t held = 0;
  for (std::size_t r = 0; r < cells.runs.size(); ++r) {
    held += cells.runs[r].end - cells.runs[r].begin;
    if (held < kTask && r + 1 < cells.runs.size()) continue;
    tasks.push_back(r + 1);
    held = 0;
  }
  parallelFor(tasks.size() - 1, 1, progress, [&](std::size_t begin, std::size_t end) {
    PartOrder parts(frame, rest);
    for (std::size_t t = begin; t < end; ++t) {
      task([&](auto& worker) {
        for (std::size_t r = tasks[t]; r < tasks[t + 1]; ++r) {
          const CellOrder::Run& run = cells.runs[r];
          std::span<const std::uint32_t> points(cells.order.data() + run.begin, run.end - run.begin);
          const bool split = points.size() > PartOrder::kSplit;
          if (split) points = parts.sort(run.cell, points);
          std::size_t octant = 0;
          for (std::size_t k = 0; k < points.size(); ++k) {
            for (; split && k == parts.octantEnds()[octant]; ++octant) worker.pause();
            worker.take(points[k]);
          }
          worker.pause();
        }
      });
    }
  });
}

}  // namespace fielddeform::gffd::detail
