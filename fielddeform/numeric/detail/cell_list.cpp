#include <fielddeform/core/random.h>
#include <fielddeform/numeric/detail/cell_list.h>

#include <array>
#include <unordered_map>

namespace fielddeform::numeric::detail {
namespace {

constexpr double kMostCells = 96;  // a side: larger cells are right too, only slower

// Growing sets of points: cells of one size, found by hash.
class Buckets {
 public:
  explicit Buckets(double size) : size_(size) {}
  void add(const Vec3& p, Index i) { cells_[keyOf(cellOf(p))].push_back(i); }
  /// The first for which test(i) holds, among those in the cell of p and its neighbours; kNoIndex if there is none.
  template <class Test>
  Index find(const Vec3& p, Test&& test) const {
    const std::array<std::int64_t, 3> c = cellOf(p);
    for (std::int64_t x = c[0] - 1; x <= c[0] + 1; ++x)
      for (std::int64_t y = c[1] - 1; y <= c[1] + 1; ++y)
        for (std::int64_t z = c[2] - 1; z <= c[2] + 1; ++z) {
          const auto found = cells_.find(keyOf({x, y, z}));
          if (found == cells_.end()) continue;
          for (const Index i : found->second)
            if (test(i)) return i;
        }
    return kNoIndex;
  }

 private:
  std::array<std::int64_t, 3> cellOf(const Vec3& p) const {
    std::array<std::int64_t, 3> c;
    for (std::size_t k = 0; k < 3; ++k) c[k] = static_cast<std::int64_t>(std::floor(p[static_cast<int>(k)] / size_));
    return c;
  }
  // Cells may share a key: they are then searched together.
  static std::uint64_t keyOf(const std::array<std::int64_t, 3>& c) {
    return splitmix64(splitmix64(static_cast<std::uint64_t>(c[0]), static_cast<std::uint64_t>(c[1])), static_cast<std::uint64_t>(c[2]));
  }
  double size_;
  std::unordered_map<std::uint64_t, std::vector<Index>> cells_;
};

}  // namespace

CellList::CellList(Points points, double reach) {
  Box box;
  for (const Vec3& p : points) box.extend(p);
  if (box.isEmpty()) box.extend(Vec3(Vec3::Zero()));
  low_ = box.min();
  cell_ = std::max(reach, box.sizes().maxCoeff() / kMostCells);
  for (int k = 0; k < 3; ++k) count_[k] = static_cast<std::int64_t>(box.sizes()[k] / cell_) + 1;
  const auto cellOf = [&](const Vec3& p) {
    std::int64_t c[3];
    for (int k = 0; k < 3; ++k) c[k] = std::clamp<std::int64_t>(static_cast<std::int64_t>((p[k] - low_[k]) / cell_), 0, count_[k] - 1);
    return static_cast<std::size_t>((c[0] * count_[1] + c[1]) * count_[2] + c[2]);
  };
  begin_.assign(static_cast<std::size_t>(count_[0] * count_[1] * count_[2]) + 1, 0);
  for (const Vec3& p : points) ++begin_[cellOf(p) + 1];
  for (std::size_t c = 1; c < begin_.size(); ++c) begin_[c] += begin_[c - 1];
  std::vector<Index> next(begin_.begin(), begin_.end() - 1);
  points_.resize(points.size());
  original_.resize(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Index at = next[cellOf(points[i])]++;
    points_[at] = points[i];
    original_[at] = static_cast<Index>(i);
  }
}

std::vector<Index> mergeNear(Points points, double distance) {
  Buckets buckets(distance);
  std::vector<Index> group(points.size());
  for (Index i = 0; i < points.size(); ++i) {
    const Index found =
        buckets.find(points[i], [&](Index j) { return (points[i] - points[j]).squaredNorm() <= distance * distance; });
    group[i] = found == kNoIndex ? i : found;
    if (found == kNoIndex) buckets.add(points[i], i);
  }
  return group;
}

namespace {

// Points kept so far, in cells as wide as the spacing: a table of hashes with open addressing, and lists within a cell.
class Kept {
  struct Slot {
    std::uint64_t key = 0;
    Index first = kNoIndex;  // free
  };
  struct Entry {
    Index point, next;
  };
  template <class Slots>
  static auto& find(Slots& slots, std::uint64_t key) {
    std::size_t at = key & (slots.size() - 1);
    while (slots[at].first != kNoIndex && slots[at].key != key) at = (at + 1) & (slots.size() - 1);
    return slots[at];
  }

 public:
  Kept(Points points, double spacing) : points_(points), spacing_(spacing), slots_(1024, Slot{}) {}

  bool hasNear(const Vec3& p) const {
    const std::array<std::int64_t, 3> c = cellOf(p);
    if (near(p, c)) return true;  // most are
    for (std::int64_t x = c[0] - 1; x <= c[0] + 1; ++x)
      for (std::int64_t y = c[1] - 1; y <= c[1] + 1; ++y)
        for (std::int64_t z = c[2] - 1; z <= c[2] + 1; ++z)
          if ((x != c[0] || y != c[1] || z != c[2]) && near(p, {x, y, z})) return true;
    return false;
  }

  void add(Index i) {
    if (2 * (entries_.size() + 1) > slots_.size()) grow();
    Slot& slot = find(slots_, keyOf(cellOf(points_[i])));
    entries_.push_back({i, slot.first});
    slot = {keyOf(cellOf(points_[i])), static_cast<Index>(entries_.size() - 1)};
  }

 private:
  std::array<std::int64_t, 3> cellOf(const Vec3& p) const {
    std::array<std::int64_t, 3> c;
    for (std::size_t k = 0; k < 3; ++k) c[k] = static_cast<std::int64_t>(std::floor(p[static_cast<int>(k)] / spacing_));
    return c;
  }
  // Cells may share a key: they are then searched together.
  static std::uint64_t keyOf(const std::array<std::int64_t, 3>& c) {
    std::uint64_t h = static_cast<std::uint64_t>(c[0]) * 0x9E3779B97F4A7C15u ^ static_cast<std::uint64_t>(c[1]) * 0xC2B2AE3D27D4EB4Fu ^
                      static_cast<std::uint64_t>(c[2]) * 0x165667B19E3779F9u;
    return h ^ h >> 29;
  }
  bool near(const Vec3& p, const std::array<std::int64_t, 3>& cell) const {
    for (Index e = find(slots_, keyOf(cell)).first; e != kNoIndex; e = entries_[e].next)
      if ((p - points_[entries_[e].point]).squaredNorm() < spacing_ * spacing_) return true;
    return false;
  }
  void grow() {
    std::vector<Slot> wider(2 * slots_.size(), Slot{});
    for (const Slot& s : slots_)
      if (s.first != kNoIndex) find(wider, s.key) = s;
    slots_ = std::move(wider);
  }

  Points points_;
  double spacing_;
  std::vector<Slot> slots_;
  std::vector<Entry> entries_;
};

}  // namespace

std::vector<Index> thin(Points points, double spacing, std::vector<Index> chosen) {
  Kept kept(points, spacing);
  std::vector<char> taken(points.size(), 0);
  for (const Index i : chosen) {
    kept.add(i);
    taken[i] = 1;
  }
  for (Index i = 0; i < points.size(); ++i) {
    if (taken[i] || kept.hasNear(points[i])) continue;
    kept.add(i);
    chosen.push_back(i);
  }
  return chosen;
}

}  // namespace fielddeform::numeric::detail
