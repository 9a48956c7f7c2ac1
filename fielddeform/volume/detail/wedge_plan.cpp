#include <fielddeform/volume/detail/wedge_plan.h>

#include <algorithm>
#include <array>
#include <numeric>

namespace fielddeform::volume::detail {
namespace {

constexpr std::size_t kLargestRing = 64;  // longer ones are not put in order: that takes the square of their length

class Planner {
 public:
  Planner(WedgePlan& plan, std::size_t vertices, std::span<const Index> triangles)
      : plan_(plan), triangles_(triangles), start_(vertices + 1, 0), corner_(triangles.size()), left_(vertices, 0), taken_(triangles.size() / 3, false) {
    for (const Index v : triangles) ++start_[v + 1], ++left_[v];
    std::partial_sum(start_.begin(), start_.end(), start_.begin());
    std::vector<std::size_t> place(start_.begin(), start_.end() - 1);
    for (std::size_t c = 0; c < triangles.size(); ++c) corner_[place[triangles[c]]++] = c;
  }

  /// Owners of whole rings first, each next to the one before (the third colour of a regular triangulation owns everything);
  /// then owners of what these leave, the larger shares first.
  void run() {
    plan_.start.assign(1, 0);
    std::vector<Index> queue;
    for (std::size_t seed = 0; seed + 1 < start_.size(); ++seed) {
      queue.assign(1, static_cast<Index>(seed));
      for (std::size_t next = 0; next < queue.size(); ++next) {
        const Index v = queue[next];
        const std::size_t whole = start_[v + 1] - start_[v];
        if (left_[v] < std::max<std::size_t>(whole, 3) || whole > kLargestRing) continue;
        for (std::size_t i = start_[v]; i < start_[v + 1]; ++i) {
          const Index across = opposite(corner_[i]);
          if (across != kNoIndex && left_[across] == start_[across + 1] - start_[across]) queue.push_back(across);
        }
        own(v);
      }
    }
    for (const std::size_t least : {std::size_t{4}, std::size_t{3}, std::size_t{2}, std::size_t{1}})
      for (std::size_t v = 0; v + 1 < start_.size(); ++v)
        if (left_[v] >= least) own(static_cast<Index>(v));
  }

 private:
  /// The vertex of the next triangle across the side that a corner looks at.
  Index opposite(std::size_t corner) const {
    const std::size_t t = corner / 3 * 3, k = corner - t;
    const Index b = triangles_[t + (k + 1) % 3], c = triangles_[t + (k + 2) % 3];
    for (std::size_t i = start_[b]; i < start_[b + 1] && i < start_[b] + kLargestRing; ++i) {
      const std::size_t other = corner_[i] / 3 * 3, at = corner_[i] - other;
      if (triangles_[other + (at + 2) % 3] == c) return triangles_[other + (at + 1) % 3];
    }
    return kNoIndex;
  }

  void own(Index v) {
    edges_.clear();
    for (std::size_t i = start_[v]; i < start_[v + 1]; ++i) {
      const std::size_t c = corner_[i], t = c / 3 * 3, k = c - t;
      if (taken_[t / 3]) continue;
      taken_[t / 3] = true;
      for (std::size_t j = 0; j < 3; ++j) --left_[triangles_[t + j]];
      edges_.push_back({triangles_[t + (k + 1) % 3], triangles_[t + (k + 2) % 3]});
    }
    if (edges_.size() > kLargestRing)
      for (const auto& [b, c] : edges_) plan_.product.push_back({b, kNoIndex, c});
    else
      while (!edges_.empty()) chain();
    plan_.owner.push_back(v);
    plan_.start.push_back(plan_.product.size());
  }

  /// Takes one run of edges that follow one another out of edges_.
  void chain() {
    std::size_t first = 0;  // of an open run its start, of a closed one any
    for (std::size_t i = 0; i < edges_.size(); ++i)
      if (std::none_of(edges_.begin(), edges_.end(), [&](const auto& e) { return e[1] == edges_[i][0]; })) {
        first = i;
        break;
      }
    run_.assign(edges_[first].begin(), edges_[first].end());
    edges_.erase(edges_.begin() + static_cast<std::ptrdiff_t>(first));
    for (auto next = edges_.begin(); next != edges_.end();) {
      next = std::find_if(edges_.begin(), edges_.end(), [&](const auto& e) { return e[0] == run_.back(); });
      if (next == edges_.end()) break;
      run_.push_back((*next)[1]);
      edges_.erase(next);
      next = edges_.begin();
    }
    std::size_t i = 0;
    for (; i + 2 < run_.size(); i += 2) plan_.product.push_back({run_[i], run_[i + 2], run_[i + 1]});
    if (i + 1 < run_.size()) plan_.product.push_back({run_[i], kNoIndex, run_[i + 1]});
  }

  WedgePlan& plan_;
  std::span<const Index> triangles_;
  std::vector<std::size_t> start_, corner_, left_;
  std::vector<bool> taken_;
  std::vector<std::array<Index, 2>> edges_;
  std::vector<Index> run_;
};

}  // namespace

WedgePlan::WedgePlan(std::size_t vertices, std::span<const Index> triangles) { Planner(*this, vertices, triangles).run(); }

}  // namespace fielddeform::volume::detail
