#include <fielddeform/spatial/detail/closest_block.h>

#include <algorithm>

namespace fielddeform::spatial {

using detail::kGroup;

bool ClosestTree::Impl::TriangleBlock::list(double bound, Index hint) {
  const double reach = reachOf(bound);
  leafCount_ = testCount_ = 0;
  begin();
  if (hint < tree_.count) look<3>(tree_.slot[hint]);
  if (!collect(reach)) return false;
  thin();
  if (!(nearest_.squaredDistance <= reach)) leafCount_ = 0;
  return true;
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
    double diagonal = 0;
    if (at.square > reach || isOut(at.square, at.offset)) continue;
    if (at.box != kNoIndex && tree_.oriented[at.box].exists()) {
      const detail::OrientedBox& box = tree_.oriented[at.box];
      at.square = box.squareTo(lanes_.centre, at.offset);
      diagonal = box.diagonal;
      if (at.square > reach || isOut(at.square, at.offset, diagonal)) continue;
    }
    if (at.child.count > 0) {
      if (!takeLeaf(at.child, at.square, at.offset, diagonal)) return false;
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
bool ClosestTree::Impl::TriangleBlock::takeLeaf(const detail::BoxTree::Child& leaf, double square, const Vec3& offset, double diagonal) {
  if (square < nearest_.squaredDistance)
    for (std::uint32_t s = leaf.begin; s < leaf.begin + leaf.count; ++s) look<3>(s);
  if (leafCount_ == kMostLeaves) thin();
  if (leafCount_ == kMostLeaves) return false;
  leaf_[leafCount_++] = {.begin = leaf.begin, .count = leaf.count, .square = square, .diagonal = diagonal, .offset = offset};
  return true;
}

// Drops what the present S leaves out.
void ClosestTree::Impl::TriangleBlock::thin() {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < leafCount_; ++i)
    if (!isOut(leaf_[i].square, leaf_[i].offset, leaf_[i].diagonal)) leaf_[kept++] = leaf_[i];
  leafCount_ = kept;
}

// Tests of those of a leaf's triangles that are not out of the question themselves.
void ClosestTree::Impl::TriangleBlock::make(Leaf& leaf) {
  leaf.made = true;
  leaf.firstTest = static_cast<std::uint16_t>(testCount_);
  for (std::uint32_t s = leaf.begin; s < leaf.begin + leaf.count; ++s) {
    const SimplexHit hit = tree_.testOne<3>(lanes_.centre, s);
    if (isOut(hit.squaredDistance, hit.offset)) continue;
    const Vec3* v = tree_.vertex.data() + std::size_t{3} * s;
    detail::TriangleTest& t = test_[testCount_++];
    t = detail::makeTest(v[0], v[1], v[2], tree_.tree.order[s]);
    t.bound.least = hit.squaredDistance - slackOf(hit.squaredDistance);
    for (int k = 0; k < 3; ++k) t.bound.offset[k] = 2 * hit.offset[k];
  }
  leaf.tests = static_cast<std::uint16_t>(testCount_ - leaf.firstTest);
}

void ClosestTree::Impl::TriangleBlock::answer(Points queries, std::span<ClosestPoint> out, double maxDistance) {
  std::array<std::uint16_t, kMostLeaves> leaves;
  std::array<std::uint16_t, kMostLeaves * kLeaf> tests;
  // What the group before found is tried first: it is near.
  std::array<std::uint16_t, 3> seed{};
  std::size_t seeds = 0;
  for (std::size_t i = 0; i < leafCount_; ++i) {
    Leaf& leaf = leaf_[i];
    bound_[i].least = leaf.square - slackOf(leaf.square, leaf.diagonal);
    for (int k = 0; k < 3; ++k) bound_[i].offset[k] = 2 * leaf.offset[k];
    if (nearestSlot_ - leaf.begin >= leaf.count) continue;
    make(leaf);
    for (std::uint16_t t = 0; t < leaf.tests; ++t)
      if (test_[t].element == static_cast<double>(nearest())) seed[seeds++] = t;
  }
  for (std::size_t at = 0; at < count_; at += kGroup) {
    detail::GroupHits hits;
    detail::tryTriangles(test_.data(), std::span(seed).first(seeds), lanes_, at, hits);
    const std::size_t near = detail::boundsWithin(std::span(bound_).first(leafCount_), lanes_, at, hits, leaves.data());
    std::size_t listed = 0;
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
    seeds = 0;
    for (const std::size_t i : {kGroup - 1, std::size_t{3}, std::size_t{0}}) {
      const auto t = static_cast<std::uint16_t>(hits.test[i]);
      if (std::find(seed.begin(), seed.begin() + static_cast<std::ptrdiff_t>(seeds), t) == seed.begin() + static_cast<std::ptrdiff_t>(seeds)) seed[seeds++] = t;
    }
  }
}

}  // namespace fielddeform::spatial
