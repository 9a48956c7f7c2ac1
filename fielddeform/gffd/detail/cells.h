#pragma once

#include <fielddeform/skeleton/skeleton.h>

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

namespace fielddeform::gffd::detail {

/// Whole-number coordinates of a cell, or of the node at its lower corner.
struct CellIndex {
  std::int32_t x = 0, y = 0, z = 0;
  bool operator==(const CellIndex&) const = default;
};

/// Cubic cells of rest space. They follow from skeleton and radius alone, never from a mesh, so that previews, levels of
/// detail and bare points share them.
struct CellFrame {
  Vec3 origin = Vec3::Zero();  ///< world; far enough below the influence region that its cells count from 2
  double side = 0;             ///< world; a twelfth of the smallest influence radius
  double inverse = 0;

  /// Nothing where cells would not be counted in 20 bits, or radii are missing or out of range.
  static std::optional<CellFrame> of(const skeleton::Skeleton& rest);

  /// The cell of a point within the influence region.
  CellIndex cellOf(const Vec3& p) const;
  Vec3 node(const CellIndex& c) const { return origin + side * Vec3(c.x, c.y, c.z); }
  Vec3 centre(const CellIndex& c) const { return origin + side * Vec3(c.x + 0.5, c.y + 0.5, c.z + 0.5); }
};

/// From a cell to a number; open addressing, grows by itself.
class CellTable {
 public:
  static constexpr std::uint32_t kNone = 0xFFFFFFFFu;
  explicit CellTable(std::size_t expected = 0);
  std::uint32_t find(const CellIndex& cell) const noexcept;  ///< kNone: not there
  /// The number stored with the cell; `next` is stored if there was none.
  std::uint32_t insert(const CellIndex& cell, std::uint32_t next);
  std::size_t size() const noexcept { return size_; }

 private:
  struct Slot {
    std::uint64_t key;
    std::uint32_t value;
  };
  void grow(std::size_t slots);
  std::vector<Slot> slots_;
  std::size_t mask_ = 0, size_ = 0;
};

/// Points by cell: cells along a Morton curve, the points of each in their own order.
struct CellOrder {
  struct Run {
    CellIndex cell;
    std::uint32_t begin = 0, end = 0;  ///< into order
  };
  std::vector<Run> runs;
  std::vector<std::uint32_t> order;  ///< indices of the points taken
};

/// @param take  whether point i is finite, within the influence region and wanted
CellOrder orderByCell(const CellFrame& frame, Points points, const std::function<bool(std::size_t)>& take);

/// The number of cells that hold a point, or some number above `most`.
std::size_t countCells(const CellFrame& frame, Points points, const std::function<bool(std::size_t)>& take, std::size_t most);

}  // namespace fielddeform::gffd::detail
