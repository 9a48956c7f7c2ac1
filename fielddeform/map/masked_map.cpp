#include <fielddeform/core/parallel.h>
#include <fielddeform/map/masked_map.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace fielddeform::map {
namespace {

constexpr std::size_t kGrain = 8192;

void checkSize(const char* name, std::size_t found, std::size_t expected) {
  if (found != expected) throw std::invalid_argument(fmt::format("{} has {} elements, expected {}", name, found, expected));
}

void checkMask(Points rest, std::span<const double> mask) {
  checkSize("mask", mask.size(), rest.size());
  for (std::size_t i = 0; i < mask.size(); ++i)
    if (!std::isfinite(mask[i])) throw std::invalid_argument(fmt::format("mask[{}] is {}, must be finite", i, mask[i]));
}

bool isOne(std::span<const double> mask) {
  return std::all_of(mask.begin(), mask.end(), [](double m) { return m == 1; });
}

}  // namespace

struct MaskedMap::Bound final : Binding {
  std::size_t size() const override { return rest.size(); }
  std::shared_ptr<const LinearMap> map;  ///< whose bindings fit: that of every withDisplacements()
  std::shared_ptr<const std::vector<Vec3>> owner;
  std::shared_ptr<const Binding> inner;
  Points rest;                    ///< those of ownRest, or the caller's
  std::span<const double> mask;
  std::vector<Vec3> ownRest;
  std::vector<double> ownMask;
  bool ones = false;  ///< the mask is 1 everywhere
};

MaskedMap::MaskedMap(std::shared_ptr<const LinearMap> map, std::vector<Index> nodes) : map_(std::move(map)) {
  if (!map_) throw std::invalid_argument("map is null, expected a linear map");
  const Points all = map_->restNodes(), moved = map_->displacements();
  auto rest = std::make_shared<std::vector<Vec3>>();
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (nodes[i] >= all.size() || (i > 0 && nodes[i] <= nodes[i - 1]))
      throw std::invalid_argument(fmt::format("nodes[{}] is {}, expected ascending indices below {}", i, nodes[i], all.size()));
    rest->push_back(all[nodes[i]]);
    displacements_.push_back(moved[nodes[i]]);
  }
  if (nodes.empty()) {
    rest->assign(all.begin(), all.end());
    displacements_.assign(moved.begin(), moved.end());
  } else {
    nodes_ = std::make_shared<const std::vector<Index>>(std::move(nodes));
  }
  restNodes_ = std::move(rest);
}

const MaskedMap::Bound& MaskedMap::own(const Binding& binding) const {
  const auto* bound = dynamic_cast<const Bound*>(&binding);
  if (!bound || bound->owner != restNodes_) throw std::invalid_argument("the binding was made by another map");
  return *bound;
}

std::shared_ptr<const Binding> MaskedMap::bind(Points rest, std::span<const double> mask) const {
  checkMask(rest, mask);
  auto bound = std::make_shared<Bound>();
  bound->owner = restNodes_;
  bound->map = map_;
  bound->inner = map_->bind(rest);
  bound->ownRest.assign(rest.begin(), rest.end());
  bound->ownMask.assign(mask.begin(), mask.end());
  for (std::size_t i = 0; i < rest.size(); ++i)
    if (!rest[i].allFinite()) bound->ownMask[i] = 0;
  bound->rest = bound->ownRest, bound->mask = bound->ownMask;
  bound->ones = isOne(bound->mask);
  return bound;
}

std::shared_ptr<const Binding> MaskedMap::bindView(Points rest, std::span<const double> mask) const {
  checkMask(rest, mask);
  auto bound = std::make_shared<Bound>();
  bound->owner = restNodes_;
  bound->map = map_;
  bound->inner = map_->bindView(rest);
  bound->rest = rest, bound->mask = mask;
  bound->ones = isOne(mask);
  return bound;
}

std::shared_ptr<const Binding> MaskedMap::bind(Points rest) const {
  return bind(rest, std::vector<double>(rest.size(), 1.0));
}

std::vector<Vec3> MaskedMap::spread(Points nodeValues) const {
  std::vector<Vec3> all(map_->nodeCount(), Vec3::Zero());
  for (std::size_t i = 0; i < nodes_->size(); ++i) all[(*nodes_)[i]] = nodeValues[i];
  return all;
}

void MaskedMap::combine(const Binding& binding, Points nodeValues, std::span<Vec3> out) const {
  const Bound& b = own(binding);
  checkSize("nodeValues", nodeValues.size(), nodeCount());
  checkSize("out", out.size(), b.size());
  if (nodes_) b.map->combine(*b.inner, spread(nodeValues), out);
  else b.map->combine(*b.inner, nodeValues, out);
  if (b.ones) return;
  parallelFor(out.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      if (b.mask[i] == 0) out[i] = Vec3::Zero();  // whatever stands there, NaN too
      else out[i] *= b.mask[i];
  });
}

void MaskedMap::gather(const Binding& binding, Points pointValues, std::span<Vec3> out) const {
  const Bound& b = own(binding);
  checkSize("pointValues", pointValues.size(), b.size());
  checkSize("out", out.size(), nodeCount());
  std::vector<Vec3> masked(b.ones ? 0 : b.size());
  parallelFor(masked.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      masked[i] = b.mask[i] == 0 ? Vec3(Vec3::Zero()) : Vec3(b.mask[i] * pointValues[i]);
  });
  const Points values = b.ones ? pointValues : Points(masked);
  if (!nodes_) return b.map->gather(*b.inner, values, out);
  std::vector<Vec3> all(map_->nodeCount());
  b.map->gather(*b.inner, values, all);
  for (std::size_t i = 0; i < nodes_->size(); ++i) out[i] = all[(*nodes_)[i]];
}

SparseRows MaskedMap::masked(const SparseRows& inner, const std::function<double(std::size_t)>& mask) const {
  std::vector<Index> own(nodes_ ? map_->nodeCount() : 0, kNoIndex);
  for (Index i = 0; nodes_ && i < nodes_->size(); ++i) own[(*nodes_)[i]] = i;
  SparseRows out;
  out.columns = nodeCount();
  for (std::size_t r = 0; r < inner.rows(); ++r) {
    const double m = mask(r);
    for (std::size_t k = inner.start[r]; k < inner.start[r + 1]; ++k) {
      const Index column = nodes_ ? own[inner.column[k]] : inner.column[k];
      const double value = m * inner.value[k];
      if (column == kNoIndex || m == 0 || value == 0) continue;
      out.column.push_back(column);
      out.value.push_back(value);
    }
    out.start.push_back(out.column.size());
  }
  return out;
}

SparseRows MaskedMap::basis(const Binding& binding) const {
  const Bound& b = own(binding);
  return masked(b.map->basis(*b.inner), [&](std::size_t r) { return b.mask[r]; });
}

SparseRows MaskedMap::basisAt(const Binding& binding, std::span<const Index> points) const {
  const Bound& b = own(binding);
  return masked(b.map->basisAt(*b.inner, points), [&](std::size_t r) { return b.mask[points[r]]; });
}

void MaskedMap::apply(const Binding& binding, MapOutput out, Progress& progress) const {
  const Bound& b = own(binding);
  for (const std::size_t size : {out.position.size(), out.safe.size(), out.status.size(), out.residual.size()})
    if (size != 0) checkSize("out", size, b.size());
  std::vector<Vec3> moved(b.size());
  combine(binding, displacements_, moved);
  parallelFor(b.size(), kGrain, progress, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const bool valid = b.rest[i].allFinite(), fixed = b.mask[i] == 0 || moved[i].isZero(0);
      const Vec3 x = fixed ? b.rest[i] : Vec3(b.rest[i] + moved[i]);
      if (!out.position.empty()) out.position[i] = x;
      if (!out.safe.empty()) out.safe[i] = x;
      if (!out.status.empty()) out.status[i] = !valid ? Status::Invalid : fixed ? Status::Fixed : Status::Converged;
      if (!out.residual.empty()) out.residual[i] = 0;
    }
  });
}

void MaskedMap::jacobians(const Binding& binding, std::span<Mat3> out) const {
  const Bound& b = own(binding);
  checkSize("out", out.size(), b.size());
  const auto inner = nodes_ ? b.map->withDisplacements(spread(displacements_)) : b.map->withDisplacements(displacements_);
  inner->jacobians(*b.inner, out);
  for (std::size_t i = 0; i < out.size(); ++i)
    if (b.mask[i] == 0) out[i].setIdentity();
    else out[i] = Mat3::Identity() + b.mask[i] * (out[i] - Mat3::Identity());
}

std::unique_ptr<LinearMap> MaskedMap::withDisplacements(Points displacements) const {
  checkSize("displacements", displacements.size(), nodeCount());
  for (const Vec3& d : displacements)
    if (!d.allFinite()) throw std::invalid_argument("a displacement is not finite");
  auto other = std::make_unique<MaskedMap>(*this);
  other->displacements_.assign(displacements.begin(), displacements.end());
  return other;
}

}  // namespace fielddeform::map
