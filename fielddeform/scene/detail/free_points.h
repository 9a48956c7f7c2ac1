#pragma once

#include <fielddeform/core/types.h>

#include <vector>

namespace fielddeform::scene::detail {

/// A set of points of which the nearest is taken, again and again: a tree of boxes that knows what is left in each.
/// Taking one costs about log n, also where all points lie in one place. Not safe to use from several threads.
class FreePoints {
 public:
  /// @param points  #P by 3, finite, kept as a copy
  explicit FreePoints(Points points);

  /// The nearest point that is free, at most `tolerance` away, and takes it; kNoIndex if there is none. Of several at the
  /// same distance the lowest index.
  Index take(const Vec3& query, double tolerance);
  /// All are free again.
  void release();

 private:
  struct Node {
    Box box;
    std::size_t begin = 0, end = 0;    // in order_; one point: a leaf
    Index child = kNoIndex;            // the first of two
    Index parent = kNoIndex;
    Index least = kNoIndex;            // the lowest free index below; kNoIndex: none
  };
  struct Best {
    Index index = kNoIndex;
    double distance = 0;
  };

  void build(Index node);
  void search(Index node, double bound, const Vec3& query, Best& best) const;
  void refresh(Index leaf, Index least);

  std::vector<Vec3> points_;
  std::vector<Index> order_, leafOf_, taken_;
  std::vector<Node> nodes_;
};

}  // namespace fielddeform::scene::detail
