#include <fielddeform/spatial/detail/closest_tree_impl.h>
#include <fielddeform/spatial/detail/triangle_lanes.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

// Which elements can be the nearest to a query p = c + e of a block with centre c and |e| <= rho? Let q_T be the foot of c
// on element T, S the element nearest to c. T is convex, so |c - q|^2 >= |c - q_T|^2 + |q - q_T|^2 for every q of it, and
//   d_T(p)^2 >= d_T(c)^2 + 2 e . (c - q_T)                 (minimise over q - q_T)
//   d_S(p)^2 <= d_S(c)^2 + 2 e . (c - q_S) + |e|^2         (the foot stays)
// T is out of the question if the first exceeds the second for every e:
//   d_T(c)^2 - d_S(c)^2 > rho^2 + 2 rho |q_T - q_S|
// This does not depend on how far the block is away, as the triangle inequality (d_T > d_S + 2 rho) does: over a flat
// patch it leaves what lies within 2.4 rho of the foot. The first line also tells, query by query, what need not be tried.
namespace fielddeform::spatial {
namespace {

using detail::kBlock;

constexpr std::size_t kFew = 4;         // fewer queries search one by one
constexpr std::size_t kMostTests = 24;  // more elements: half the block
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
    Vec3 low = queries[0], high = low;
    for (std::size_t i = 0; i < count_; ++i) {
      const Vec3 q = queries[i] * tree_.scale;
      lanes_.x[i] = q[0];
      lanes_.y[i] = q[1];
      lanes_.z[i] = q[2];
      if (i == 0) low = high = q;
      low = low.cwiseMin(q);
      high = high.cwiseMax(q);
      if (!(q.cwiseAbs().maxCoeff() < kWithin)) return false;
    }
    lanes_.centre = 0.5 * (low + high);
    double farthest = 0;
    for (std::size_t i = 0; i < count_; ++i) farthest = std::max(farthest, detail::square(query(i) - lanes_.centre));
    rho_ = std::sqrt(farthest) * (1 + kRounding);
    for (std::size_t i = count_; i % 8 != 0; ++i) {
      lanes_.x[i] = lanes_.x[count_ - 1];
      lanes_.y[i] = lanes_.y[count_ - 1];
      lanes_.z[i] = lanes_.z[count_ - 1];
    }
    return true;
  }

  // False: too many elements. No candidates: none is within the bound of any query.
  bool list(double bound, Index hint) {
    Best nearest;
    nearest.limit = limitOf((bound + rho_) * (1 + kRounding));
    tree_.search<N>(lanes_.centre, hint, nearest);
    candidates_ = 0;
    if (nearest.element == kNoIndex) return true;
    nearest_ = nearest.hit;
    listed_ = nearest.element;
    return collect();
  }

  void answer(Points queries, std::span<ClosestPoint> out, double maxDistance) {
    if (candidates_ == 0) {
      std::fill(out.begin(), out.end(), ClosestPoint{});
      return;
    }
    std::sort(candidate_.begin(), candidate_.begin() + static_cast<std::ptrdiff_t>(candidates_),
              [](const Candidate& a, const Candidate& b) { return a.least < b.least; });
    if constexpr (N == 3) byLanes(queries, out, maxDistance);
    else oneByOne(queries, out, maxDistance);
  }

  std::size_t candidates() const { return candidates_; }
  Index nearest() const { return listed_; }

 private:
  struct Candidate {
    std::uint32_t slot;
    double least;  // squared; less rounding
    Vec3 offset;   // twice c - q_T
  };

  Vec3 query(std::size_t i) const { return {lanes_.x[i], lanes_.y[i], lanes_.z[i]}; }

  bool collect() {
    const double here = nearest_.squaredDistance, margin = rho_ * rho_;
    const Vec3& c = lanes_.centre;
    const Vec3 foot = c - nearest_.offset;
    const double d = std::sqrt(here) + tree_.extent + 2 * rho_;
    const double most = here + margin + kRounding * (d * d);
    detail::BoxTree::Child stack[detail::BoxTree::kMaxDepth];
    int top = 0;
    stack[top++] = tree_.tree.root;
    while (top > 0) {
      const detail::BoxTree::Child at = stack[--top];
      if (at.count > 0) {
        for (std::uint32_t s = at.begin; s < at.begin + at.count; ++s)
          if (!add(s, most)) return false;
        continue;
      }
      const detail::BoxTree::Node& node = tree_.tree.nodes[at.begin];
      for (int side = 0; side < 2; ++side) {
        double near2 = 0, far2 = 0;
        for (int k = 0; k < 3; ++k) {
          const double low = node.low[k][side], high = node.high[k][side];
          const double away = std::max(std::max(low - c[k], c[k] - high), 0.0);
          const double across = std::max(high - foot[k], foot[k] - low);
          near2 += away * away;
          far2 += across * across;
        }
        if (near2 - most <= (2 + kRounding) * rho_ * std::sqrt(far2)) stack[top++] = node.child[side];
      }
    }
    return true;
  }

  bool add(std::uint32_t slot, double most) {
    const SimplexHit hit = tree_.testOne<N>(lanes_.centre, slot);
    const double apart = std::sqrt(detail::square(hit.offset - nearest_.offset));
    const double d = std::sqrt(hit.squaredDistance) + tree_.extent + 2 * rho_, slack = kRounding * (d * d);
    if (hit.squaredDistance - most > 2 * rho_ * apart + slack) return true;
    if (candidates_ == kMostTests) return false;
    candidate_[candidates_++] = {slot, hit.squaredDistance - slack, 2 * hit.offset};
    return true;
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
  double rho_ = 0;
  SimplexHit nearest_{};
  Index listed_ = kNoIndex;
  std::array<Candidate, kMostTests> candidate_;
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
