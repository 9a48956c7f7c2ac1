#include <fielddeform/spatial/detail/closest_block.h>

#include <algorithm>

namespace fielddeform::spatial {

using detail::kBlock, detail::kGroup;

namespace {

// Queries that come again have moved: so much wider than they need are boxes.
constexpr double kWider = 1.0625;

}  // namespace

bool ClosestTree::Impl::TriangleBlock::list(double bound, Index hint) {
  const double reach = reachOf(bound);
  leafCount_ = 0;
  test_.clear();
  begin();
  if (hint < tree_.count) look<3>(tree_.slot[hint]);
  if (!collect(reach)) return false;
  thin();
  if (!(nearest_.squaredDistance <= reach)) leafCount_ = 0;
  else prepare();
  return true;
}

std::size_t ClosestTree::Impl::TriangleBlock::takeWithin(Points queries) {
  for (count_ = 0; count_ < std::min(queries.size(), kBlock); ++count_) {
    const Vec3 q = queries[count_] * tree_.scale;
    for (int k = 0; k < 3; ++k)
      if (!(std::abs(q[k] - lanes_.centre[k]) <= half_[k])) {
        if (count_ > 0) fill();
        return count_;
      }
    lanes_.x[count_] = q[0];
    lanes_.y[count_] = q[1];
    lanes_.z[count_] = q[2];
  }
  if (count_ > 0) fill();
  return count_;
}

// Nearer boxes first: S is soon the nearest.
bool ClosestTree::Impl::TriangleBlock::collect(double reach) {
  struct Entry {
    detail::BoxTree::Child child;
    std::uint32_t box;
    double square;
    Vec3 offset;
  };
  Entry stack[detail::BoxTree::kMaxDepth];
  int top = 0;
  stack[top++] = {tree_.tree.root, kNoIndex, 0, Vec3::Zero()};
  while (top > 0) {
    Entry at = stack[--top];
    const detail::OrientedBox* box = nullptr;
    if (at.square > reach || isOut(at.square, at.offset)) continue;
    if (at.box != kNoIndex && tree_.oriented[at.box].exists()) {
      box = &tree_.oriented[at.box];
      at.square = box->squareTo(lanes_.centre, at.offset);
      if (at.square > reach || isOut(at.square, at.offset, box->diagonal)) continue;
    }
    if (at.child.count > 0) {
      if (!takeLeaf(at.child, box, at.square, at.offset)) return false;
      continue;
    }
    const detail::BoxTree::Node& node = tree_.tree.nodes[at.child.begin];
    Entry side[2];
    for (int k = 0; k < 2; ++k) {
      side[k].child = node.child[k];
      side[k].box = 2 * at.child.begin + static_cast<std::uint32_t>(k);
      side[k].square = seen(node, k, side[k].offset);
    }
    const int nearer = side[1].square < side[0].square ? 1 : 0;
    stack[top++] = side[1 - nearer];
    stack[top++] = side[nearer];
  }
  return true;
}

// False: too many.
bool ClosestTree::Impl::TriangleBlock::takeLeaf(const detail::BoxTree::Child& leaf, const detail::OrientedBox* box, double square, const Vec3& offset) {
  if (square < nearest_.squaredDistance)
    for (std::uint32_t s = leaf.begin; s < leaf.begin + leaf.count; ++s) look<3>(s);
  if (leafCount_ == kMostLeaves) thin();
  if (leafCount_ == kMostLeaves) return false;
  leaf_[leafCount_++] = {.begin = leaf.begin, .count = leaf.count, .box = box, .square = square, .diagonal = box ? box->diagonal : 0, .offset = offset};
  return true;
}

// Drops what the present S leaves out.
void ClosestTree::Impl::TriangleBlock::thin() {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < leafCount_; ++i)
    if (!isOut(leaf_[i].square, leaf_[i].offset, leaf_[i].diagonal)) leaf_[kept++] = leaf_[i];
  leafCount_ = kept;
}

void ClosestTree::Impl::TriangleBlock::makeTest(std::uint32_t place, const SimplexHit& hit) {
  const Vec3* v = tree_.vertex.data() + std::size_t{3} * place;
  detail::TriangleTest& t = test_.emplace_back(detail::makeTest(v[0], v[1], v[2], tree_.tree.order[place]));
  t.bound.least = hit.squaredDistance - slackOf(hit.squaredDistance);
  for (int k = 0; k < 3; ++k) t.bound.offset[k] = 2 * hit.offset[k];
}

// Tests of those of a leaf's triangles that are not out of the question themselves; S has its own.
void ClosestTree::Impl::TriangleBlock::make(Leaf& leaf) {
  leaf.made = true;
  leaf.firstTest = static_cast<std::uint16_t>(test_.size());
  for (std::uint32_t s = leaf.begin; s < leaf.begin + leaf.count; ++s) {
    if (s == nearestSlot_) continue;
    const SimplexHit hit = tree_.testOne<3>(lanes_.centre, s);
    if (!isOut(hit.squaredDistance, hit.offset)) makeTest(s, hit);
  }
  leaf.tests = static_cast<std::uint16_t>(test_.size() - leaf.firstTest);
}

// Bounds of the leaves, and S: the first test, which the first group tries first.
void ClosestTree::Impl::TriangleBlock::prepare() {
  for (Seeds& s : seeds_) s.count = 0;
  seeds_[0].test[seeds_[0].count++] = 0;
  makeTest(nearestSlot_, nearest_);
  for (std::size_t i = 0; i < leafCount_; ++i) {
    Leaf& leaf = leaf_[i];
    box_[i] = {leaf.box, slackOf(leaf.square, leaf.diagonal)};
    bound_[i].least = leaf.square - box_[i].slack;
    for (int k = 0; k < 3; ++k) bound_[i].offset[k] = 2 * leaf.offset[k];
  }
}

void ClosestTree::Impl::TriangleBlock::answer(Points queries, std::span<ClosestPoint> out, double maxDistance) {
  std::array<std::uint16_t, kMostLeaves> leaves;
  std::array<std::uint16_t, kMostLeaves * kLeaf + 1> tests;
  for (std::size_t at = 0; at < count_; at += kGroup) {
    Seeds& seeds = seeds_[at / kGroup];
    if (seeds.count == 0) seeds = seeds_[at / kGroup - 1];
    detail::GroupHits hits;
    detail::tryTriangles(test_.data(), std::span(seeds.test).first(seeds.count), lanes_, at, hits);
    std::size_t near = detail::boundsWithin(std::span(bound_).first(leafCount_), lanes_, at, hits, leaves.data());
    near = detail::boxesWithin(box_.data(), std::span(leaves).first(near), lanes_, at, hits);
    std::size_t listed = 1;
    tests[0] = 0;
    for (std::size_t i = 0; i < near; ++i) {
      Leaf& leaf = leaf_[leaves[i]];
      if (!leaf.made) make(leaf);
      for (std::uint16_t t = 0; t < leaf.tests; ++t) tests[listed++] = static_cast<std::uint16_t>(leaf.firstTest + t);
    }
    detail::tryTriangles(test_.data(), std::span(tests).first(listed), lanes_, at, hits);
    for (std::size_t i = 0; i < std::min(kGroup, count_ - at); ++i) {
      Best best;
      best.hit = {hits.square[i], Vec3(hits.x[i], hits.y[i], hits.z[i]), Vec3(hits.u[i], hits.v[i], hits.w[i])};
      best.element = static_cast<Index>(hits.element[i]);
      best.slot = tree_.slot[best.element];
      out[at + i] = tree_.answer(queries[at + i], false, best, maxDistance);
    }
    seeds.count = 0;
    for (const std::size_t i : {kGroup - 1, std::size_t{3}, std::size_t{0}}) {
      const auto t = static_cast<std::uint16_t>(hits.test[i]);
      bool known = false;
      for (std::size_t k = 0; k < seeds.count; ++k) known = known || seeds.test[k] == t;
      if (!known) seeds.test[seeds.count++] = t;
    }
  }
}

// The block that will be the call's `stored`-th.
ClosestTree::Impl::TriangleBlock& ClosestTree::Impl::TriangleSearch::next(std::size_t stored) {
  const std::size_t i = std::min(stored, kKept - 1);
  if (i >= block_.size()) block_.emplace_back(tree_);
  return block_[i];
}

// Queries in the boxes of the last call's blocks, one block after the other. @return how many
std::size_t ClosestTree::Impl::TriangleSearch::again(Points queries, std::span<ClosestPoint> out, double maxDistance) {
  std::size_t begin = 0;
  for (std::size_t b = 0; b < kept_ && begin < queries.size(); ++b) {
    const std::size_t n = block_[b].takeWithin(queries.subspan(begin));
    if (n == 0) continue;
    if (block_[b].empty()) std::fill_n(out.begin() + static_cast<std::ptrdiff_t>(begin), n, ClosestPoint{});
    else block_[b].answer(queries.subspan(begin, n), out.subspan(begin, n), maxDistance);
    begin += n;
  }
  return begin;
}

void ClosestTree::Impl::TriangleSearch::run(Points queries, std::span<ClosestPoint> out, double maxDistance, BlockHint& hint) {
  std::size_t begin = maxDistance == maxDistance_ ? again(queries, out, maxDistance) : 0;
  if (begin == queries.size()) return;
  maxDistance_ = maxDistance;
  kept_ = 0;
  std::size_t stored = 0;
  const auto blockOf = [&]() -> TriangleBlock& { return next(stored); };
  const auto listed = [&] { kept_ = std::min(++stored, kKept - 1); };  // the last place is written again and again
  detail::searchByBlocks(tree_, queries.subspan(begin), out.subspan(begin), maxDistance, kWider, hint, blockOf, listed);
}

void ClosestTree::Impl::trianglesTogether(Points queries, std::span<ClosestPoint> out, double maxDistance, BlockHint& hint) const {
  if (!(maxDistance >= 0) || count == 0) return alone(queries, out, maxDistance, hint);
  auto* search = dynamic_cast<TriangleSearch*>(hint.kept.get());
  if (!search || !search->isOf(*this)) {
    hint.kept = std::make_shared<TriangleSearch>(*this);
    search = static_cast<TriangleSearch*>(hint.kept.get());
  }
  search->run(queries, out, maxDistance, hint);
}

}  // namespace fielddeform::spatial
