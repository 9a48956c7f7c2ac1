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

  /// Owners of whole rings first, then of what they leave, the larger shares first.
  void run() {
    plan_.start.assign(1, 0);
    for (const std::size_t least : {std::size_t{0}, std::size_t{4}, std::size_t{3}, std::size_t{2}, std::size_t{1}})
      for (std::size_t v = 0; v + 1 < start_.size(); ++v) {
        const std::size_t whole = start_[v + 1] - start_[v], needed = least == 0 ? std::max<std::size_t>(whole, 3) : least;
        if (left_[v] >= needed) own(static_cast<Index>(v));
      }
  }

 private:
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
