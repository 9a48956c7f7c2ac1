#include <fielddeform/gffd/detail/cells.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace fielddeform::gffd::detail {
namespace {

constexpr double kCellsPerRadius = 12;
constexpr double kMostCells = 1 << 20;  // along an axis

std::uint64_t pack(const CellIndex& c) {
  return static_cast<std::uint64_t>(static_cast<std::uint32_t>(c.x)) << 42 |
         static_cast<std::uint64_t>(static_cast<std::uint32_t>(c.y)) << 21 | static_cast<std::uint32_t>(c.z);
}

std::uint64_t spread(std::uint64_t x) {
  x &= 0x1FFFFF;
  x = (x | x << 32) & 0x1F00000000FFFFull;
  x = (x | x << 16) & 0x1F0000FF0000FFull;
  x = (x | x << 8) & 0x100F00F00F00F00Full;
  x = (x | x << 4) & 0x10C30C30C30C30C3ull;
  return (x | x << 2) & 0x1249249249249249ull;
}

std::uint64_t morton(const CellIndex& c) {
  return spread(static_cast<std::uint32_t>(c.x)) << 2 | spread(static_cast<std::uint32_t>(c.y)) << 1 |
         spread(static_cast<std::uint32_t>(c.z));
}

std::size_t hash(std::uint64_t key) {
  key *= 0x9E3779B97F4A7C15ull;
  return static_cast<std::size_t>(key ^ key >> 29);
}

constexpr std::uint64_t kEmpty = ~std::uint64_t{0};

}  // namespace

std::optional<CellFrame> CellFrame::of(const skeleton::Skeleton& rest) {
  Box box;
  double smallest = std::numeric_limits<double>::infinity(), greatest = 0;
  const auto take = [&](double r) {
    smallest = std::min(smallest, r);
    greatest = std::max(greatest, r);
  };
  for (const auto& p : rest.primitives) {
    for (const Vec3& x : p.points) box.extend(x);
    if (p.radius) take(*p.radius);
    for (const double r : p.pointRadius) take(r);
  }
  if (box.isEmpty() || !(smallest > 1e-100) || !(greatest < 1e100)) return std::nullopt;
  CellFrame frame;
  frame.side = smallest / kCellsPerRadius;
  frame.inverse = 1 / frame.side;
  frame.origin = box.min() - Vec3::Constant(greatest + 4 * frame.side);
  const double reach = 2 * greatest + 8 * frame.side;
  if (!((box.sizes().maxCoeff() + reach) * frame.inverse < kMostCells)) return std::nullopt;
  // Where coordinates are so large that their rounding shows in a cell, the exact path is as good as any.
  if (!(std::max(box.min().cwiseAbs().maxCoeff(), box.max().cwiseAbs().maxCoeff()) * frame.inverse < 1e9)) return std::nullopt;
  return frame;
}

CellIndex CellFrame::cellOf(const Vec3& p) const {
  const auto at = [&](int k) {
    const double u = std::floor((p[k] - origin[k]) * inverse);
    return static_cast<std::int32_t>(std::clamp(u, 1.0, kMostCells));
  };
  return {at(0), at(1), at(2)};
}

CellTable::CellTable(std::size_t expected) { grow(std::max<std::size_t>(64, 2 * expected)); }

void CellTable::grow(std::size_t slots) {
  std::size_t n = 64;
  while (n < slots) n *= 2;
  std::vector<Slot> old = std::move(slots_);
  slots_.assign(n, {kEmpty, kNone});
  mask_ = n - 1;
  for (const Slot& s : old) {
    if (s.key == kEmpty) continue;
    std::size_t at = hash(s.key) & mask_;
    while (slots_[at].key != kEmpty) at = (at + 1) & mask_;
    slots_[at] = s;
  }
}

std::uint32_t CellTable::find(const CellIndex& cell) const noexcept {
  const std::uint64_t key = pack(cell);
  for (std::size_t at = hash(key) & mask_;; at = (at + 1) & mask_) {
    if (slots_[at].key == key) return slots_[at].value;
    if (slots_[at].key == kEmpty) return kNone;
  }
}

std::uint32_t CellTable::insert(const CellIndex& cell, std::uint32_t next) {
  const std::uint64_t key = pack(cell);
  std::size_t at = hash(key) & mask_;
  for (; slots_[at].key != kEmpty; at = (at + 1) & mask_)
    if (slots_[at].key == key) return slots_[at].value;
  slots_[at] = {key, next};
  if (2 * ++size_ > slots_.size()) grow(2 * slots_.size());
  return next;
}

CellOrder orderByCell(const CellFrame& frame, Points points, const std::function<bool(std::size_t)>& take) {
  CellOrder out;
  CellTable table;
  std::vector<CellIndex> cells;
  std::vector<std::uint32_t> count, slot(points.size(), CellTable::kNone);
  CellIndex last{-1, -1, -1};
  std::uint32_t lastSlot = 0;
  std::size_t taken = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!take(i)) continue;
    const CellIndex cell = frame.cellOf(points[i]);
    if (!(cell == last)) {
      lastSlot = table.insert(cell, static_cast<std::uint32_t>(cells.size()));
      if (lastSlot == cells.size()) {
        cells.push_back(cell);
        count.push_back(0);
      }
      last = cell;
    }
    slot[i] = lastSlot;
    ++count[lastSlot];
    ++taken;
  }
  std::vector<std::uint64_t> curve(cells.size());
  for (std::size_t c = 0; c < cells.size(); ++c) curve[c] = morton(cells[c]);
  std::vector<std::uint32_t> along(cells.size());
  std::iota(along.begin(), along.end(), 0u);
  std::sort(along.begin(), along.end(), [&](std::uint32_t a, std::uint32_t b) { return curve[a] < curve[b]; });
  out.runs.reserve(cells.size());
  std::uint32_t begin = 0;
  std::vector<std::uint32_t> next(cells.size());
  for (const std::uint32_t c : along) {
    out.runs.push_back({cells[c], begin, begin + count[c]});
    next[c] = begin;
    begin += count[c];
  }
  out.order.resize(taken);
  for (std::size_t i = 0; i < points.size(); ++i)
    if (slot[i] != CellTable::kNone) out.order[next[slot[i]]++] = static_cast<std::uint32_t>(i);
  return out;
}

std::size_t countCells(const CellFrame& frame, Points points, const std::function<bool(std::size_t)>& take, std::size_t most) {
  CellTable table;
  CellIndex last{-1, -1, -1};
  for (std::size_t i = 0; i < points.size() && table.size() <= most; ++i) {
    if (!take(i)) continue;
    const CellIndex cell = frame.cellOf(points[i]);
    if (cell == last) continue;
    last = cell;
    table.insert(cell, 0);
  }
  return table.size();
}

}  // namespace fielddeform::gffd::detail
