#pragma once

#include <fielddeform/core/types.h>

#include <vector>

namespace fielddeform::spatial::detail {

/// A binary tree of boxes, median split along the longest side of the elements' middles. The depth is that of a
/// balanced tree whatever the input.
struct BoxTree {
  struct Child {
    std::uint32_t begin = 0;  ///< inner: index of its node; leaf: first slot of `order`
    std::uint32_t count = 0;  ///< 0: inner node; else elements of the leaf
  };
  /// Boxes of both children side by side, [axis][child].
  struct Node {
    double low[3][2];
    double high[3][2];
    Child child[2];
  };
  static constexpr int kMaxDepth = 64;  ///< entries that a depth-first traversal's stack can hold at most

  std::vector<Node> nodes;      ///< children after their parents; empty if the root is a leaf
  std::vector<Index> order;     ///< leaf slot -> element
  Child root;
};

/// @param low, high  one box an element
BoxTree buildBoxTree(Points low, Points high, std::uint32_t leafSize);

/// The power of two that brings the largest absolute coordinate into [1, 2) (as near as doubles allow); 1 for no points or all zero. Trees compute
/// in these units, so that squares of huge or tiny coordinates stay in range; the scaling itself is exact.
/// @throw std::invalid_argument naming the first point that is not finite
double unitScale(Points points, const char* argument);

}  // namespace fielddeform::spatial::detail
