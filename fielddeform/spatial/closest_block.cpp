#include <fielddeform/spatial/detail/closest_tree_impl.h>
#include <fielddeform/spatial/detail/triangle_lanes.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

// Which elements can be the nearest to a query p = c + e of a block, a box of centre c and half sides h? Let q_T be the foot
// of c on element T, and S any one of them. T is convex, so |c - q|^2 >= |c - q_T|^2 + |q - q_T|^2 for every q of it, and
//   d_T(p)^2 >= d_T(c)^2 + 2 e . (c - q_T)                 (minimise over q - q_T)
//   d_S(p)^2 <= d_S(c)^2 + 2 e . (c - q_S) + |e|^2         (the foot stays)
// T is out of the question if the first exceeds the second for every e:
//   d_T(c)^2 - d_S(c)^2 > |h|^2 + 2 sum_k h_k |q_T - q_S|_k
// This does not depend on how far the block is away, as the triangle inequality (d_T > d_S + 2 |h|) does: over a flat
// patch it leaves what lies within 2.4 |h| of the foot. The first line also tells, query by query, what need not be tried.
// For a box of elements, |c - q|^2 >= its squared distance and |q - q_S|_k <= the farther of its two sides.
namespace fielddeform::spatial {
namespace {

using detail::kBlock;

constexpr std::size_t kFew = 4;         // fewer queries search one by one
constexpr std::size_t kMostTests = 320;  // more elements: half the block
constexpr std::size_t kAlone = 16;      // queries that search one by one where even few of them have too many elements
constexpr double kWithin = 0x1p400;     // tree's units: squares of squares stay in range
constexpr double kRounding = 1e-9;      // of squared distances, far more than theirs

}  // namespace

template <int N>
class ClosestTree::Impl::Block {
 public:
  explicit Block(const Impl& tree) : tree_(tree) {}

  // False: not finite, or too large.
  bool take(Points queries) {
    count_ = queries.size();
    Vec3 low = queries[0] * tree_.scale, high = low;
    for (std::size_t i = 0; i < count_; ++i) {
      const Vec3 q = queries[i] * tree_.scale;
      lanes_.x[i] = q[0];
      lanes_.y[i] = q[1];
      lanes_.z[i] = q[2];
      for (int k = 0; k < 3; ++k)  // one by one: a maximum may leave a NaN out
        if (!(std::abs(q[k]) < kWithin)) return false;
      low = low.cwiseMin(q);
      high = high.cwiseMax(q);
    }
    lanes_.centre = 0.5 * (low + high);
    half_ = (0.5 + kRounding) * (high - low);
    size2_ = detail::square(half_);
    for (std::size_t i = count_; i % 8 != 0; ++i) {
      lanes_.x[i] = lanes_.x[count_ - 1];
      lanes_.y[i] = lanes_.y[count_ - 1];
      lanes_.z[i] = lanes_.z[count_ - 1];
    }
    return true;
  }

  // False: too many elements. No candidates: none is within the bound of any query.
  bool list(double bound, Index hint) {
    const double reach = limitOf((bound + std::sqrt(size2_)) * (1 + kRounding));
    candidates_ = 0;
    nearest_.squaredDistance = most_ = std::numeric_limits<double>::infinity();
    const std::uint32_t first = hint < tree_.count ? tree_.slot[hint] : kNoIndex;
    if (first != kNoIndex && !add(first)) return false;
    if (!collect(reach, first) || !thin()) return false;
    if (!(nearest_.squaredDistance <= reach)) candidates_ = 0;
    return true;
  }

  void answer(Points queries, std::span<ClosestPoint> out, double maxDistance) {
    if (candidates_ == 0) {
      std::fill(out.begin(), out.end(), ClosestPoint{});
      return;
    }
    const auto end = candidate_.begin() + static_cast<std::ptrdiff_t>(candidates_);
    std::sort(candidate_.begin(), end, [](const Candidate& a, const Candidate& b) { return a.square < b.square; });
    for (auto c = candidate_.begin(); c != end; ++c) {
      c->least = c->square - slackOf(c->square);
      c->offset *= 2;
    }
    if constexpr (N == 3) byLanes(queries, out, maxDistance);
    else oneByOne(queries, out, maxDistance);
  }

  std::size_t candidates() const { return candidates_; }
  Index nearest() const { return listed_; }

 private:
  struct Candidate {
    std::uint32_t slot;
    double square;     // d_T(c)^2
    Vec3 offset;       // c - q_T, then twice that
    double least = 0;  // the square less rounding
  };

  Vec3 query(std::size_t i) const { return {lanes_.x[i], lanes_.y[i], lanes_.z[i]}; }

  // 2 e . (q - q_S) at most, for offsets or corners apart by this much on each axis.
  double most(const Vec3& apart) const { return 2 * detail::dot(half_, apart); }

  // Nearer boxes first: S is soon the nearest.
  bool collect(double reach, std::uint32_t skip) {
    struct Entry {
      detail::BoxTree::Child child;
      double square;
      const detail::BoxTree::Node* node;
      int side;
    };
    Entry stack[detail::BoxTree::kMaxDepth];
    int top = 0;
    stack[top++] = {tree_.tree.root, 0, nullptr, 0};
    const Vec3& c = lanes_.centre;
    while (top > 0) {
      const Entry at = stack[--top];
      if (at.square > reach || (at.node && !within(at.square, *at.node, at.side))) continue;
      if (at.child.count > 0) {
        for (std::uint32_t s = at.child.begin; s < at.child.begin + at.child.count; ++s)
          if (s != skip && !add(s)) return false;
        continue;
      }
      const detail::BoxTree::Node& node = tree_.tree.nodes[at.child.begin];
      double square[2] = {0, 0};
      for (int k = 0; k < 3; ++k)
        for (int side = 0; side < 2; ++side) {
          const double below = node.low[k][side] - c[k], above = c[k] - node.high[k][side];
          double d = below > above ? below : above;
          d = d > 0 ? d : 0;
          square[side] += d * d;
        }
      const int nearer = square[1] < square[0] ? 1 : 0, farther = 1 - nearer;
      stack[top++] = {node.child[farther], square[farther], &node, farther};
      stack[top++] = {node.child[nearer], square[nearer], &node, nearer};
    }
    return true;
  }

  bool within(double square, const detail::BoxTree::Node& node, int side) const {
    if (square <= most_) return true;
    Vec3 apart;
    for (int k = 0; k < 3; ++k) apart[k] = std::max(node.high[k][side] - foot_[k], foot_[k] - node.low[k][side]);
    return square - most_ <= most(apart);
  }

  bool add(std::uint32_t place) {
    const SimplexHit hit = tree_.testOne<N>(lanes_.centre, place);
    if (hit.squaredDistance < nearest_.squaredDistance) {
      nearest_ = hit;
      listed_ = tree_.tree.order[place];
      foot_ = lanes_.centre - hit.offset;
      most_ = hit.squaredDistance + size2_ + slackOf(hit.squaredDistance);
    }
    if (isOut(hit.squaredDistance, hit.offset)) return true;
    if (candidates_ == candidate_.size() && (!thin() || candidates_ > kMostTests)) return false;
    candidate_[candidates_++] = {place, hit.squaredDistance, hit.offset, 0};
    return true;
  }

  double slackOf(double square) const {
    const double d = std::sqrt(square) + tree_.extent + 2 * std::sqrt(size2_);
    return kRounding * (d * d);
  }
  bool isOut(double square, const Vec3& offset) const {
    return square - most_ > most((offset - nearest_.offset).cwiseAbs()) + kRounding * square;
  }

  // Drops what the S of the end leaves out. False: too many are left.
  bool thin() {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < candidates_; ++i)
      if (!isOut(candidate_[i].square, candidate_[i].offset)) candidate_[kept++] = candidate_[i];
    candidates_ = kept;
    return kept <= kMostTests;
  }

  void byLanes(Points queries, std::span<ClosestPoint> out, double maxDistance) {
    std::array<detail::TriangleTest, kMostTests> tests;
    for (std::size_t i = 0; i < candidates_; ++i) {
      const Candidate& c = candidate_[i];
      const Vec3* v = tree_.vertex.data() + std::size_t{3} * c.slot;
      tests[i] = detail::makeTest(v[0], v[1], v[2], tree_.tree.order[c.slot]);
      tests[i].least = c.least;
      for (int k = 0; k < 3; ++k) tests[i].offset[k] = c.offset[k];
    }
    detail::LaneHits hits;
    detail::nearestTriangles(tests.data(), candidates_, lanes_, count_, hits);
    for (std::size_t i = 0; i < count_; ++i) {
      Best best;
      best.hit = {hits.square[i], Vec3(hits.x[i], hits.y[i], hits.z[i]), Vec3(hits.u[i], hits.v[i], hits.w[i])};
      best.element = static_cast<Index>(hits.element[i]);
      best.slot = tree_.slot[best.element];
      out[i] = tree_.answer(queries[i], false, best, maxDistance);
    }
  }

  void oneByOne(Points queries, std::span<ClosestPoint> out, double maxDistance) {
    for (std::size_t i = 0; i < count_; ++i) {
      const Vec3 q = query(i), e = q - lanes_.centre;
      Best best;
      for (std::size_t k = 0; k < candidates_; ++k) {
        const Candidate& c = candidate_[k];
        if (!(c.least + detail::dot(e, c.offset) <= best.hit.squaredDistance)) continue;
        const SimplexHit hit = tree_.testOne<N>(q, c.slot);
        const Index element = tree_.tree.order[c.slot];
        if (hit.squaredDistance > best.hit.squaredDistance) continue;
        if (hit.squaredDistance == best.hit.squaredDistance && best.element <= element) continue;
        best.hit = hit;
        best.element = element;
        best.slot = c.slot;
      }
      out[i] = tree_.answer(queries[i], false, best, maxDistance);
    }
  }

  const Impl& tree_;
  detail::LaneQueries lanes_;
  std::size_t count_ = 0, candidates_ = 0;
  Vec3 half_, foot_;
  double size2_ = 0, most_ = 0;  // |h|^2; d_S(c)^2 + |h|^2 and rounding
  SimplexHit nearest_{};         // S
  Index listed_ = kNoIndex;
  std::array<Candidate, 2 * kMostTests> candidate_;
};

template <int N>
void ClosestTree::Impl::together(Points queries, std::span<ClosestPoint> out, double maxDistance, BlockHint& hint) const {
  Block<N> block(*this);
  std::size_t size = std::clamp(hint.size, kFew, kBlock);
  const auto alone = [&](std::size_t begin, std::size_t n) {
    for (std::size_t i = begin; i < begin + n; ++i) {
      out[i] = query(queries[i], {maxDistance, hint.element});
      if (out[i].element != kNoIndex) hint.element = out[i].element;
    }
  };
  for (std::size_t begin = 0; begin < queries.size();) {
    const std::size_t n = std::min(size, queries.size() - begin);
    const Points some = queries.subspan(begin, n);
    if (n < kFew || !(maxDistance >= 0) || count == 0 || !block.take(some)) {
      alone(begin, n);
      begin += n;
      continue;
    }
    if (!block.list(maxDistance * scale, hint.element)) {
      if (n >= 2 * kFew) {
        size = n / 2;
        continue;
      }
      const std::size_t many = std::min(kAlone, queries.size() - begin);
      alone(begin, many);
      begin += many;
      continue;
    }
    if (block.candidates() > 0) hint.element = block.nearest();
    block.answer(some, out.subspan(begin, n), maxDistance);
    if (n == size && 3 * block.candidates() < kMostTests) size = std::min(2 * size, kBlock);
    begin += n;
  }
  hint.size = size;
}

template void ClosestTree::Impl::together<1>(Points, std::span<ClosestPoint>, double, BlockHint&) const;
template void ClosestTree::Impl::together<2>(Points, std::span<ClosestPoint>, double, BlockHint&) const;
template void ClosestTree::Impl::together<3>(Points, std::span<ClosestPoint>, double, BlockHint&) const;

}  // namespace fielddeform::spatial
