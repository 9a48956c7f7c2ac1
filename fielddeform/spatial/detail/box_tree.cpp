#include <fielddeform/spatial/detail/box_tree.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

namespace fielddeform::spatial::detail {
namespace {

struct Job {
  std::uint32_t begin, end;  // range of `order`
  std::uint32_t parent;      // node whose child it becomes
  int side;                  // 0 or 1; -1: the root
};

Box boxOf(Points low, Points high, std::span<const Index> elements) {
  Box box;
  for (const Index e : elements) {
    box.extend(low[e]);
    box.extend(high[e]);
  }
  return box;
}

}  // namespace

BoxTree buildBoxTree(Points low, Points high, std::uint32_t leafSize) {
  BoxTree tree;
  tree.order.resize(low.size());
  std::iota(tree.order.begin(), tree.order.end(), Index{0});
  std::vector<Vec3> middle(low.size());  // twice the middle of each box
  for (std::size_t e = 0; e < low.size(); ++e) middle[e] = low[e] + high[e];

  std::vector<Job> jobs{{0, static_cast<std::uint32_t>(low.size()), 0, -1}};
  while (!jobs.empty()) {
    const Job job = jobs.back();
    jobs.pop_back();
    const auto first = tree.order.begin() + job.begin, last = tree.order.begin() + job.end;
    const std::uint32_t count = job.end - job.begin;
    BoxTree::Child self{static_cast<std::uint32_t>(tree.nodes.size()), 0};
    if (count <= leafSize) self = {job.begin, count};
    if (job.side < 0) {
      tree.root = self;
    } else {
      BoxTree::Node& parent = tree.nodes[job.parent];
      const Box box = boxOf(low, high, {first, last});
      for (int k = 0; k < 3; ++k) {
        parent.low[k][job.side] = box.min()[k];
        parent.high[k][job.side] = box.max()[k];
      }
      parent.child[job.side] = self;
    }
    if (self.count != 0 || count == 0) {
      std::sort(first, last);
      continue;
    }
    Box spread;
    for (auto e = first; e != last; ++e) spread.extend(middle[*e]);
    int axis = 0;
    spread.sizes().maxCoeff(&axis);
    const std::uint32_t half = count / 2;
    std::nth_element(first, first + half, last, [&](Index a, Index b) {
      return middle[a][axis] != middle[b][axis] ? middle[a][axis] < middle[b][axis] : a < b;
    });
    tree.nodes.emplace_back();
    jobs.push_back({job.begin + half, job.end, self.begin, 1});
    jobs.push_back({job.begin, job.begin + half, self.begin, 0});
  }
  return tree;
}

double unitScale(Points points, const char* argument) {
  double largest = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite())
      throw std::invalid_argument(fmt::format("{}: point {} is not finite ({}, {}, {})", argument, i, points[i].x(),
                                              points[i].y(), points[i].z()));
    largest = std::max(largest, points[i].cwiseAbs().maxCoeff());
  }
  if (largest == 0) return 1;
  return std::ldexp(1.0, -std::clamp(std::ilogb(largest), -1022, 1022));
}

}  // namespace fielddeform::spatial::detail
