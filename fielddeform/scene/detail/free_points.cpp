#include <fielddeform/scene/detail/free_points.h>

#include <algorithm>
#include <numeric>

namespace fielddeform::scene::detail {
namespace {

// Never more than the computed distance to a point in the box: the same operations on numbers that are no greater.
double distanceTo(const Box& box, const Vec3& p) {
  return (box.min() - p).cwiseMax(p - box.max()).cwiseMax(0).norm();
}

}  // namespace

FreePoints::FreePoints(Points points) : points_(points.begin(), points.end()), order_(points.size()), leafOf_(points.size()) {
  std::iota(order_.begin(), order_.end(), Index{0});
  if (points_.empty()) return;
  nodes_.reserve(2 * points_.size());
  nodes_.push_back({.box = {}, .begin = 0, .end = points_.size()});
  for (Index node = 0; node < nodes_.size(); ++node) build(node);
  for (std::size_t node = nodes_.size(); node-- > 1;) {  // children stand behind their parents
    Index& least = nodes_[nodes_[node].parent].least;
    least = std::min(least, nodes_[node].least);
  }
}

void FreePoints::build(Index node) {
  const std::size_t begin = nodes_[node].begin, end = nodes_[node].end;
  for (std::size_t i = begin; i < end; ++i) nodes_[node].box.extend(points_[order_[i]]);
  if (end - begin == 1) {
    nodes_[node].least = order_[begin];
    leafOf_[order_[begin]] = node;
    return;
  }
  int axis = 0;
  nodes_[node].box.sizes().maxCoeff(&axis);
  const std::size_t middle = begin + (end - begin) / 2;
  std::nth_element(order_.begin() + static_cast<std::ptrdiff_t>(begin), order_.begin() + static_cast<std::ptrdiff_t>(middle),
                   order_.begin() + static_cast<std::ptrdiff_t>(end), [&](Index a, Index b) {
                     const double x = points_[a][axis], y = points_[b][axis];
                     return x < y || (x == y && a < b);
                   });
  nodes_[node].child = static_cast<Index>(nodes_.size());
  nodes_.push_back({.box = {}, .begin = begin, .end = middle, .parent = node});
  nodes_.push_back({.box = {}, .begin = middle, .end = end, .parent = node});
}

void FreePoints::search(Index node, double bound, const Vec3& query, Best& best) const {
  const Node& n = nodes_[node];
  if (n.least == kNoIndex || bound > best.distance || (bound == best.distance && n.least > best.index)) return;
  if (n.child == kNoIndex) {
    const double d = (points_[n.least] - query).norm();
    if (d < best.distance || (d == best.distance && n.least < best.index)) best = {n.least, d};
    return;
  }
  Index near = n.child, far = n.child + 1;
  double nearBound = distanceTo(nodes_[near].box, query), farBound = distanceTo(nodes_[far].box, query);
  // At equal bounds first where the lowest index is: it rules the other side out if all lie in one place.
  if (farBound < nearBound || (farBound == nearBound && nodes_[far].least < nodes_[near].least)) {
    std::swap(near, far);
    std::swap(nearBound, farBound);
  }
  search(near, nearBound, query, best);
  search(far, farBound, query, best);
}

void FreePoints::refresh(Index leaf, Index least) {
  nodes_[leaf].least = least;
  for (Index node = nodes_[leaf].parent; node != kNoIndex; node = nodes_[node].parent)
    nodes_[node].least = std::min(nodes_[nodes_[node].child].least, nodes_[nodes_[node].child + 1].least);
}

Index FreePoints::take(const Vec3& query, double tolerance) {
  if (nodes_.empty()) return kNoIndex;
  Best best{kNoIndex, tolerance};
  search(0, distanceTo(nodes_[0].box, query), query, best);
  if (best.index == kNoIndex) return kNoIndex;
  refresh(leafOf_[best.index], kNoIndex);
  taken_.push_back(best.index);
  return best.index;
}

void FreePoints::release() {
  for (const Index k : taken_) refresh(leafOf_[k], k);
  taken_.clear();
}

}  // namespace fielddeform::scene::detail
