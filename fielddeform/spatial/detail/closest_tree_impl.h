#pragma once

#include <fielddeform/spatial/closest_tree.h>
#include <fielddeform/spatial/detail/box_tree.h>
#include <fielddeform/spatial/detail/oriented_boxes.h>
#include <fielddeform/spatial/detail/simplex_inline.h>

#include <cmath>
#include <type_traits>
#include <vector>

namespace fielddeform::spatial {

/// The tree in its own units, and one search in it.
struct ClosestTree::Impl {
  // Bound on the rounding of a computed distance, relative to distance and element: boxes up to this much farther are
  // still opened, so that the answer is the minimum of the computed distances, whatever the tree.
  static constexpr double kSlack = 1e-12;
  // Queries beyond this (in the tree's units) see all elements in one place.
  static constexpr double kFar = 0x1p500;

  const std::uint64_t id = nextId();  // no other tree's, ever
  int corners = 0;            // 1, 2 or 3
  std::size_t count = 0;      // elements
  double scale = 1, inverse = 1;
  double extent = 0;          // longest element box diagonal
  detail::BoxTree tree;
  std::vector<Vec3> vertex;   // by leaf slot, `corners` each
  std::vector<Index> slot;    // element -> leaf slot
  std::vector<detail::OrientedBox> oriented;  // of triangles: by node and side

  struct Best {
    SimplexHit hit{std::numeric_limits<double>::infinity(), Vec3::Zero(), Vec3::Zero()};
    Index element = kNoIndex;
    std::uint32_t slot = 0;
    double limit = std::numeric_limits<double>::infinity();  // squared distance of boxes to open
  };

  static std::uint64_t nextId() noexcept;
  template <std::size_t N>
  static std::unique_ptr<Impl> build(Points points, std::span<const std::array<Index, N>> elements, const char* argument);
  void raiseLimit(Best& best) const {
    const double d = std::sqrt(best.hit.squaredDistance);
    const double reach = d + kSlack * (d + extent);
    best.limit = reach * reach;
  }
  // What no element farther than the bound has to beat.
  static double limitOf(double bound) {
    return bound < kFar ? bound * bound * (1 + kSlack) + std::numeric_limits<double>::min()
                        : std::numeric_limits<double>::infinity();
  }
  // Element in a leaf's slot against a query in the tree's units.
  template <int N>
  SimplexHit testOne(const Vec3& q, std::uint32_t s) const {
    const Vec3* v = vertex.data() + static_cast<std::size_t>(N) * s;
    if constexpr (N == 1) return detail::onPoint(q, v[0]);
    else if constexpr (N == 2) return detail::onSegment(q, v[0], v[1]);
    else return detail::onTriangle(q, v[0], v[1], v[2]);
  }
  template <int N>
  void testSlot(const Vec3& q, std::uint32_t s, Best& best) const;
  template <int N>
  void traverse(const Vec3& q, Best& best) const;
  /// The nearest element to a query in the tree's units, from `best.limit` and a hint.
  template <int N>
  void search(const Vec3& q, Index hint, Best& best) const {
    if (hint < count) testSlot<N>(q, slot[hint], best);
    traverse<N>(q, best);
  }
  /// What was found, in world units. @param far  the query was brought nearer
  ClosestPoint answer(const Vec3& world, bool far, const Best& best, double maxDistance) const;
  ClosestPoint query(const Vec3& world, const QueryOptions& options) const;
  /// A query in the tree's units. @param far  set where it was brought nearer
  Vec3 inUnits(const Vec3& world, bool& far) const;

  class BlockBase;
  template <int N>
  class Block;
  class TriangleBlock;
  class TriangleSearch;
  template <int N>
  void together(Points queries, std::span<ClosestPoint> out, double maxDistance, BlockHint& hint) const;
  void trianglesTogether(Points queries, std::span<ClosestPoint> out, double maxDistance, BlockHint& hint) const;
  /// One by one, each with the element of the one before as its hint.
  void alone(Points queries, std::span<ClosestPoint> out, double maxDistance, BlockHint& hint) const {
    for (std::size_t i = 0; i < queries.size(); ++i) {
      out[i] = query(queries[i], {maxDistance, hint.element});
      if (out[i].element != kNoIndex) hint.element = out[i].element;
    }
  }
};

template <int N>
void ClosestTree::Impl::testSlot(const Vec3& q, std::uint32_t s, Best& best) const {
  const SimplexHit hit = testOne<N>(q, s);
  if (hit.squaredDistance > best.hit.squaredDistance) return;
  if (hit.squaredDistance == best.hit.squaredDistance && best.element <= tree.order[s]) return;
  best.hit = hit;
  best.element = tree.order[s];
  best.slot = s;
  raiseLimit(best);
}

template <int N>
void ClosestTree::Impl::traverse(const Vec3& q, Best& best) const {
  struct Plain {
    detail::BoxTree::Child child;
    double squaredDistance;
  };
  struct Boxed : Plain {
    std::uint32_t box;  // of `oriented`
  };
  // Segments and points have no second boxes: a fifth of the time of their searches.
  using Entry = std::conditional_t<N == 3, Boxed, Plain>;
  const auto entryOf = [](const detail::BoxTree::Child& child, double squaredDistance, std::uint32_t box) {
    if constexpr (N == 3) return Entry{{child, squaredDistance}, box};
    else return Entry{child, squaredDistance};
  };
  Entry stack[detail::BoxTree::kMaxDepth];
  int top = 0;
  stack[top++] = entryOf(tree.root, 0, kNoIndex);
  while (top > 0) {
    const Entry entry = stack[--top];
    if (entry.squaredDistance > best.limit) continue;
    if constexpr (N == 3)
      if (entry.box != kNoIndex && oriented[entry.box].exists() && oriented[entry.box].squareTo(q) > best.limit) continue;
    if (entry.child.count > 0) {
      for (std::uint32_t s = entry.child.begin; s < entry.child.begin + entry.child.count; ++s) testSlot<N>(q, s, best);
      continue;
    }
    const detail::BoxTree::Node& node = tree.nodes[entry.child.begin];
    double d2[2] = {0, 0};
    for (int k = 0; k < 3; ++k)
      for (int side = 0; side < 2; ++side) {
        const double below = node.low[k][side] - q[k], above = q[k] - node.high[k][side];
        double d = below > above ? below : above;
        d = d > 0 ? d : 0;
        d2[side] += d * d;
      }
    const int nearer = d2[1] < d2[0] ? 1 : 0, farther = 1 - nearer;
    const std::uint32_t boxes = 2 * entry.child.begin;
    if (d2[farther] <= best.limit) stack[top++] = entryOf(node.child[farther], d2[farther], boxes + static_cast<std::uint32_t>(farther));
    stack[top++] = entryOf(node.child[nearer], d2[nearer], boxes + static_cast<std::uint32_t>(nearer));
  }
}

}  // namespace fielddeform::spatial
