#include <fielddeform/spatial/detail/closest_block.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::spatial {
namespace {

using detail::kBlock;

constexpr std::size_t kMostTests = 320;  // more elements: half the block
constexpr double kWithin = 0x1p400;      // tree's units: squares of squares stay in range

}  // namespace

bool ClosestTree::Impl::BlockBase::take(Points queries) {
  count_ = queries.size();
  low_ = high_ = queries[0] * tree_.scale;
  for (std::size_t i = 0; i < count_; ++i) {
    const Vec3 q = queries[i] * tree_.scale;
    lanes_.x[i] = q[0];
    lanes_.y[i] = q[1];
    lanes_.z[i] = q[2];
    for (int k = 0; k < 3; ++k)  // one by one: a maximum may leave a NaN out
      if (!(std::abs(q[k]) < kWithin)) return false;
    low_ = low_.cwiseMin(q);
    high_ = high_.cwiseMax(q);
  }
  fill();
  return true;
}

void ClosestTree::Impl::BlockBase::fill() {
  for (std::size_t i = count_; i % detail::kGroup != 0; ++i) {
    lanes_.x[i] = lanes_.x[count_ - 1];
    lanes_.y[i] = lanes_.y[count_ - 1];
    lanes_.z[i] = lanes_.z[count_ - 1];
  }
}

void ClosestTree::Impl::BlockBase::enclose(double wider) {
  lanes_.centre = 0.5 * (low_ + high_);
  half_ = wider * (0.5 + kRounding) * (high_ - low_);
  size2_ = detail::square(half_);
}

void ClosestTree::Impl::BlockBase::begin() {
  nearest_.squaredDistance = most_ = std::numeric_limits<double>::infinity();
  nearest_.offset.setZero();
}

// Points and segments: listed one by one.
template <int N>
class ClosestTree::Impl::Block : public BlockBase {
 public:
  explicit Block(const Impl& tree) : BlockBase(tree) {}

  // False: too many elements.
  bool list(double bound, Index hint) {
    const double reach = reachOf(bound);
    candidates_ = 0;
    begin();
    const std::uint32_t first = hint < tree_.count ? tree_.slot[hint] : kNoIndex;
    if (first != kNoIndex && !add(first)) return false;
    if (!collect(reach, first) || !thin()) return false;
    if (!(nearest_.squaredDistance <= reach)) candidates_ = 0;
    return true;
  }

  void answer(Points queries, std::span<ClosestPoint> out, double maxDistance) {
    const auto end = candidate_.begin() + static_cast<std::ptrdiff_t>(candidates_);
    std::sort(candidate_.begin(), end, [](const Candidate& a, const Candidate& b) { return a.square < b.square; });
    for (auto c = candidate_.begin(); c != end; ++c) {
      c->least = c->square - slackOf(c->square);
      c->offset *= 2;
    }
    for (std::size_t i = 0; i < count_; ++i) out[i] = tree_.answer(queries[i], false, nearestTo({lanes_.x[i], lanes_.y[i], lanes_.z[i]}), maxDistance);
  }

  bool empty() const { return candidates_ == 0; }  // none is within the bound of any query
  bool roomy() const { return 3 * candidates_ < kMostTests; }

 private:
  struct Candidate {
    std::uint32_t slot;
    double square;     // d_T(c)^2
    Vec3 offset;       // c - q_T, then twice that
    double least = 0;  // the square less rounding
  };

  // Nearer boxes first: S is soon the nearest.
  bool collect(double reach, std::uint32_t skip) {
    struct Entry {
      detail::BoxTree::Child child;
      double square;
      Vec3 offset;
    };
    Entry stack[detail::BoxTree::kMaxDepth];
    int top = 0;
    stack[top++] = {tree_.tree.root, 0, Vec3::Zero()};
    while (top > 0) {
      const Entry at = stack[--top];
      if (at.square > reach || isOut(at.square, at.offset)) continue;
      if (at.child.count > 0) {
        for (std::uint32_t s = at.child.begin; s < at.child.begin + at.child.count; ++s)
          if (s != skip && !add(s)) return false;
        continue;
      }
      const detail::BoxTree::Node& node = tree_.tree.nodes[at.child.begin];
      Entry side[2];
      for (int k = 0; k < 2; ++k) {
        side[k].child = node.child[k];
        side[k].square = seen(node, k, side[k].offset);
      }
      const int nearer = side[1].square < side[0].square ? 1 : 0;
      stack[top++] = side[1 - nearer];
      stack[top++] = side[nearer];
    }
    return true;
  }

  bool add(std::uint32_t place) {
    const SimplexHit hit = look<N>(place);
    if (isOut(hit.squaredDistance, hit.offset)) return true;
    if (candidates_ == candidate_.size() && (!thin() || candidates_ > kMostTests)) return false;
    candidate_[candidates_++] = {place, hit.squaredDistance, hit.offset, 0};
    return true;
  }

  // Drops what the S of the end leaves out. False: too many are left.
  bool thin() {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < candidates_; ++i)
      if (!isOut(candidate_[i].square, candidate_[i].offset)) candidate_[kept++] = candidate_[i];
    candidates_ = kept;
    return kept <= kMostTests;
  }

  Best nearestTo(const Vec3& q) const {
    const Vec3 e = q - lanes_.centre;
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
    return best;
  }

  std::size_t candidates_ = 0;
  std::array<Candidate, 2 * kMostTests> candidate_;
};

template <int N>
void ClosestTree::Impl::together(Points queries, std::span<ClosestPoint> out, double maxDistance, BlockHint& hint) const {
  if (!(maxDistance >= 0) || count == 0) return alone(queries, out, maxDistance, hint);
  Block<N> block(*this);
  detail::searchByBlocks(*this, queries, out, maxDistance, 1, hint, [&]() -> Block<N>& { return block; }, [] {});
}

template void ClosestTree::Impl::together<1>(Points, std::span<ClosestPoint>, double, BlockHint&) const;
template void ClosestTree::Impl::together<2>(Points, std::span<ClosestPoint>, double, BlockHint&) const;

}  // namespace fielddeform::spatial
