#pragma once

#include <fielddeform/spatial/detail/closest_tree_impl.h>
#include <fielddeform/spatial/detail/triangle_lanes.h>

#include <algorithm>
#include <array>
#include <vector>

// Which elements can be the nearest to a query p = c + e of a block, a box of centre c and half sides h? Let q_T be the foot
// of c on element T, and S any one of them. T is convex, so |c - q|^2 >= |c - q_T|^2 + |q - q_T|^2 for every q of it, and
//   d_T(p)^2 >= d_T(c)^2 + 2 e . (c - q_T)                 (minimise over q - q_T)
//   d_S(p)^2 <= d_S(c)^2 + 2 e . (c - q_S) + |e|^2         (the foot stays)
// T is out of the question if the first exceeds the second for every e:
//   d_T(c)^2 - d_S(c)^2 > |h|^2 + 2 sum_k h_k |q_T - q_S|_k
// This does not depend on how far the block is away, as the triangle inequality (d_T > d_S + 2 |h|) does: over a flat
// patch it leaves what lies within 2.4 |h| of the foot. The first line also tells, query by query, what need not be tried.
// A box of elements is convex too, and its foot takes the place of q_T.
namespace fielddeform::spatial {

inline constexpr std::size_t kFew = 4;     // fewer queries search one by one
inline constexpr std::size_t kAlone = 16;  // queries that search one by one where even few of them have too many elements

/// A block of up to kBlock queries in the tree's units, and S.
class ClosestTree::Impl::BlockBase {
 public:
  /// Loads queries. False: not finite, or too large.
  bool take(Points queries);
  /// The block's box is theirs, times a factor.
  void enclose(double wider);
  /// The element nearest to the centre, once something is listed.
  Index nearest() const { return tree_.tree.order[nearestSlot_]; }

 protected:
  explicit BlockBase(const Impl& tree) : tree_(tree) {}

  /// The square that bounds searches around the centre for elements within the bound of some query.
  double reachOf(double bound) const { return limitOf((bound + std::sqrt(size2_)) * (1 + kRounding)); }
  /// Repeats the last query up to the next whole group.
  void fill();
  /// No S yet.
  void begin();
  /// An element seen from the centre; S if none is nearer.
  template <int N>
  SimplexHit look(std::uint32_t place) {
    const SimplexHit hit = tree_.testOne<N>(lanes_.centre, place);
    if (hit.squaredDistance < nearest_.squaredDistance) {
      nearest_ = hit;
      nearestSlot_ = place;
      most_ = hit.squaredDistance + size2_ + slackOf(hit.squaredDistance);
    }
    return hit;
  }
  /// Rounding of bounds; of a box, its diagonal counts.
  double slackOf(double square, double diagonal = 0) const {
    const double d = std::sqrt(square) + tree_.extent + 2 * std::sqrt(size2_);
    return kRounding * (d * d) + kBoxRounding * (d * diagonal);
  }
  /// Whether something convex at this squared distance from the centre, with the centre minus its foot, is out of the question.
  bool isOut(double square, const Vec3& offset, double diagonal = 0) const {
    return square - most_ > 2 * detail::dot(half_, (offset - nearest_.offset).cwiseAbs()) + kRounding * square + kBoxRounding * (diagonal * diagonal);
  }
  /// Offset from the box of one child of a node to the centre. @return its square
  double seen(const detail::BoxTree::Node& node, int side, Vec3& offset) const {
    for (int k = 0; k < 3; ++k) {
      const double below = node.low[k][side] - lanes_.centre[k], above = lanes_.centre[k] - node.high[k][side];
      offset[k] = above > 0 ? above : below > 0 ? -below : 0;
    }
    return detail::square(offset);
  }

  static constexpr double kRounding = 1e-9;      // of squared distances, far more than theirs
  static constexpr double kBoxRounding = 1e-12;

  const Impl& tree_;
  detail::LaneQueries lanes_;
  std::size_t count_ = 0;
  Vec3 low_, high_;              // of the queries
  Vec3 half_;                    // half sides of the queries' box
  double size2_ = 0, most_ = 0;  // |h|^2; d_S(c)^2 + |h|^2 and rounding
  SimplexHit nearest_{};         // S
  std::uint32_t nearestSlot_ = 0;
};

namespace detail {

/// Answers queries block after block, halved where too many elements are listed and doubled where few are.
/// @param wider    a block's box is its queries', times this
/// @param blockOf  gives the block to list in: take, enclose, list, empty, nearest, answer, roomy
/// @param listed   called when it has listed
template <class Tree, class BlockOf, class Listed>
void searchByBlocks(const Tree& tree, Points queries, std::span<ClosestPoint> out, double maxDistance, double wider,
                    ClosestTree::BlockHint& hint, BlockOf&& blockOf, Listed&& listed) {
  std::size_t size = std::clamp(hint.size, kFew, kBlock);
  for (std::size_t begin = 0; begin < queries.size();) {
    std::size_t n = std::min(size, queries.size() - begin);
    auto& block = blockOf();
    if (n >= kFew && block.take(queries.subspan(begin, n))) {
      block.enclose(wider);
      if (block.list(maxDistance * tree.scale, hint.element)) {
        listed();
        if (block.empty()) {
          std::fill_n(out.begin() + static_cast<std::ptrdiff_t>(begin), n, ClosestPoint{});
        } else {
          hint.element = block.nearest();
          block.answer(queries.subspan(begin, n), out.subspan(begin, n), maxDistance);
        }
        if (n == size && block.roomy()) size = std::min(2 * size, kBlock);
        begin += n;
        continue;
      }
      if (n >= 2 * kFew) {
        size = n / 2;
        continue;
      }
      n = std::min(kAlone, queries.size() - begin);
    }
    tree.alone(queries.subspan(begin, n), out.subspan(begin, n), maxDistance, hint);
    begin += n;
  }
  hint.size = size;
}

}  // namespace detail

/// Triangles: leaves of the tree are listed by their boxes; a leaf's triangles are looked at once some query asks for them.
class ClosestTree::Impl::TriangleBlock : public BlockBase {
 public:
  explicit TriangleBlock(const Impl& tree) : BlockBase(tree) {}
  /// Lists for the box. False: too many leaves.
  bool list(double bound, Index hint);
  /// Loads those at the beginning, up to kBlock, that lie within the box of the last list. @return how many
  std::size_t takeWithin(Points queries);
  void answer(Points queries, std::span<ClosestPoint> out, double maxDistance);
  bool empty() const { return leafCount_ == 0; }  ///< nothing is within the bound of any query
  bool roomy() const { return 3 * leafCount_ < kMostLeaves; }

 private:
  static constexpr std::size_t kMostLeaves = 128, kLeaf = 4;  // more: half the block; triangles of a leaf
  struct Leaf {
    std::uint32_t begin, count;
    const detail::OrientedBox* box;
    double square, diagonal;
    Vec3 offset;
    std::uint16_t firstTest = 0, tests = 0;
    bool made = false;
  };
  // What a group found: tried first by the next one, and by the same one when it comes again.
  struct Seeds {
    std::array<std::uint16_t, 3> test;
    std::size_t count = 0;
  };

  bool collect(double reach);
  bool takeLeaf(const detail::BoxTree::Child& leaf, const detail::OrientedBox* box, double square, const Vec3& offset);
  void thin();
  void make(Leaf& leaf);
  void makeTest(std::uint32_t place, const SimplexHit& hit);
  void prepare();

  std::size_t leafCount_ = 0;
  std::array<Leaf, kMostLeaves> leaf_;
  std::array<detail::LinearBound, kMostLeaves> bound_;
  std::array<detail::LeafBox, kMostLeaves> box_;
  std::vector<detail::TriangleTest> test_;
  std::array<Seeds, detail::kBlock / detail::kGroup> seeds_;
};

/// The blocks of the last call, for queries that come again.
class ClosestTree::Impl::TriangleSearch : public BlockHint::Kept {
 public:
  explicit TriangleSearch(const Impl& tree) : tree_(tree), id_(tree.id) {}
  bool isOf(const Impl& other) const { return id_ == other.id; }
  void run(Points queries, std::span<ClosestPoint> out, double maxDistance, BlockHint& hint);

 private:
  static constexpr std::size_t kKept = 8;
  std::size_t again(Points queries, std::span<ClosestPoint> out, double maxDistance);
  TriangleBlock& next(std::size_t stored);

  const Impl& tree_;
  std::uint64_t id_;
  double maxDistance_ = -1;
  std::size_t kept_ = 0;
  std::vector<TriangleBlock> block_;
};

}  // namespace fielddeform::spatial
