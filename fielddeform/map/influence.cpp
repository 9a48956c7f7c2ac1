#include <fielddeform/core/parallel.h>
#include <fielddeform/map/influence.h>
#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

namespace fielddeform::map {
namespace {

constexpr std::size_t kGrain = 256;

void checkSize(std::size_t found, std::size_t expected) {
  if (found != expected) throw std::invalid_argument(fmt::format("out: a span has {} elements, expected {}", found, expected));
}

}  // namespace

struct ZonedMap::Bound final : Binding {
  std::size_t size() const override { return rest.size(); }
  std::shared_ptr<const SpaceMap> map;
  std::shared_ptr<const Binding> inner;
  std::vector<Vec3> rest;
  std::vector<double> weight;
  std::vector<Vec3> slope;  // of the weight
  std::shared_ptr<const field::Field> field;
  double band = 0;
};

ZonedMap::ZonedMap(std::shared_ptr<const SpaceMap> map, std::shared_ptr<const field::Field> field, double band)
    : map_(std::move(map)), field_(std::move(field)), band_(band) {
  if (!map_ || !field_) throw std::invalid_argument("map or field is null");
  if (!(band >= 0 && band <= 1)) throw std::invalid_argument(fmt::format("band is {}, must be in [0, 1]", band));
}

const ZonedMap::Bound& ZonedMap::own(const Binding& binding) const {
  const auto* bound = dynamic_cast<const Bound*>(&binding);
  if (!bound || bound->map != map_) throw std::invalid_argument("binding: made by another map");
  return *bound;
}

std::shared_ptr<const Binding> ZonedMap::bindAgain(const Binding* earlier, Points rest) const {
  const auto* last = dynamic_cast<const Bound*>(earlier);
  std::shared_ptr<const Binding> inner = map_->bindAgain(last ? last->inner.get() : nullptr, rest);
  if (!last || last->field != field_ || last->band != band_ || last->size() != rest.size()) return bound(rest, std::move(inner));
  auto again = std::make_shared<Bound>(*last);
  again->map = map_;
  again->inner = std::move(inner);
  return again;
}

std::shared_ptr<const Binding> ZonedMap::bind(Points rest) const { return bound(rest, map_->bind(rest)); }

std::shared_ptr<const Binding> ZonedMap::bound(Points rest, std::shared_ptr<const Binding> inner) const {
  auto bound = std::make_shared<Bound>();
  bound->map = map_;
  bound->inner = std::move(inner);
  bound->field = field_;
  bound->band = band_;
  bound->rest.assign(rest.begin(), rest.end());
  bound->weight.assign(rest.size(), 0.0);
  bound->slope.assign(rest.size(), Vec3::Zero());
  parallelFor(rest.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      if (!rest[i].allFinite()) continue;
      const field::FieldValue v = field_->evaluate(rest[i]);
      if (!v.inside) continue;
      const double s = 1 - v.pseudoDistance / field_->referenceRadius();
      if (band_ == 0 || s >= band_) {
        bound->weight[i] = 1;
        continue;
      }
      const double t = std::max(s, 0.0) / band_;
      bound->weight[i] = t * t * (3 - 2 * t);
      bound->slope[i] = (-6 * t * (1 - t) / (band_ * field_->referenceRadius())) * v.gradient;
    }
  });
  return bound;
}

void ZonedMap::apply(const Binding& binding, MapOutput out, Progress& progress) const {
  const Bound& b = own(binding);
  for (const std::size_t size : {out.position.size(), out.safe.size(), out.status.size(), out.residual.size()})
    if (size != 0) checkSize(size, b.size());
  map_->apply(*b.inner, out, progress);
  for (const std::span<Vec3> points : {out.position, out.safe})
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (b.weight[i] == 0) points[i] = b.rest[i];
      else if (b.weight[i] < 1 && points[i] != b.rest[i]) points[i] = b.rest[i] + b.weight[i] * (points[i] - b.rest[i]);
    }
  for (std::size_t i = 0; i < b.size(); ++i) {
    if (b.weight[i] != 0) continue;
    if (!out.status.empty() && out.status[i] != Status::Invalid) out.status[i] = Status::Fixed;
    if (!out.residual.empty()) out.residual[i] = 0;
  }
}

void ZonedMap::jacobians(const Binding& binding, std::span<Mat3> out) const {
  const Bound& b = own(binding);
  checkSize(out.size(), b.size());
  map_->jacobians(*b.inner, out);
  std::vector<Vec3> image(b.size());
  Progress silent;
  map_->apply(*b.inner, {.position = image, .safe = {}, .status = {}, .residual = {}}, silent);
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (b.weight[i] == 1) continue;
    if (b.weight[i] == 0) out[i].setIdentity();
    else out[i] = Mat3::Identity() + b.weight[i] * (out[i] - Mat3::Identity()) + (image[i] - b.rest[i]) * b.slope[i].transpose();
  }
}

std::vector<double> ZonedMap::weights(const Binding& binding) const { return own(binding).weight; }

}  // namespace fielddeform::map
