#include <fielddeform/map/chain.h>

#include <algorithm>
#include <stdexcept>

namespace fielddeform::map {

class Chain::Bound final : public Binding {
 public:
  std::size_t size() const override { return bindings.front()->size(); }
  std::vector<std::shared_ptr<const SpaceMap>> maps;  ///< whose they are
  std::vector<std::shared_ptr<const Binding>> bindings;
  /// Status and residual of all maps but the last, combined; empty if there is only one.
  std::vector<Status> status;
  std::vector<float> residual;
};

namespace {

// The outcome of two maps in a row.
Status combined(Status first, Status second) {
  if (first == Status::Invalid || second == Status::Fixed) return first;
  return second;
}

}  // namespace

Chain::Chain(std::vector<std::shared_ptr<const SpaceMap>> maps) : maps_(std::move(maps)) {
  if (maps_.empty()) throw std::invalid_argument("maps: none, needs at least 1");
  if (std::find(maps_.begin(), maps_.end(), nullptr) != maps_.end()) throw std::invalid_argument("maps: one is null");
}

std::shared_ptr<const Binding> Chain::bind(Points rest) const {
  auto bound = std::make_shared<Bound>();
  bound->maps = maps_;
  bound->bindings.push_back(maps_.front()->bind(rest));
  if (maps_.size() == 1) return bound;
  const std::size_t n = rest.size();
  bound->status.assign(n, Status::Fixed);
  bound->residual.assign(n, 0.0f);
  std::vector<Vec3> moved(n);
  std::vector<Status> status(n);
  std::vector<float> residual(n);
  Progress silent;
  for (std::size_t m = 0; m + 1 < maps_.size(); ++m) {
    maps_[m]->apply(*bound->bindings[m], {.position = moved, .safe = {}, .status = status, .residual = residual}, silent);
    for (std::size_t i = 0; i < n; ++i) {
      bound->status[i] = combined(bound->status[i], status[i]);
      bound->residual[i] = std::max(bound->residual[i], residual[i]);
    }
    bound->bindings.push_back(maps_[m + 1]->bind(moved));
  }
  return bound;
}

const Chain::Bound& Chain::own(const Binding& binding) const {
  const auto* bound = dynamic_cast<const Bound*>(&binding);
  if (!bound || bound->maps != maps_) throw std::invalid_argument("binding: made by another map");
  return *bound;
}

void Chain::apply(const Binding& binding, MapOutput out, Progress& progress) const {
  const Bound& bound = own(binding);
  maps_.back()->apply(*bound.bindings.back(), out, progress);
  if (bound.status.empty()) return;
  for (std::size_t i = 0; i < out.status.size(); ++i) out.status[i] = combined(bound.status[i], out.status[i]);
  for (std::size_t i = 0; i < out.residual.size(); ++i) out.residual[i] = std::max(bound.residual[i], out.residual[i]);
}

void Chain::jacobians(const Binding& binding, std::span<Mat3> out) const {
  const Bound& bound = own(binding);
  maps_.front()->jacobians(*bound.bindings.front(), out);
  std::vector<Mat3> next(maps_.size() > 1 ? out.size() : 0);
  for (std::size_t m = 1; m < maps_.size(); ++m) {
    maps_[m]->jacobians(*bound.bindings[m], next);
    for (std::size_t i = 0; i < out.size(); ++i) out[i] = (next[i] * out[i]).eval();
  }
}

}  // namespace fielddeform::map
