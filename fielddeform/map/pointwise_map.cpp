#include <fielddeform/core/parallel.h>
#include <fielddeform/map/pointwise_map.h>
#include <fmt/format.h>

#include <stdexcept>
#include <vector>

namespace fielddeform::map {
namespace {

constexpr std::size_t kGrain = 64;

void checkSize(std::size_t found, std::size_t expected) {
  if (found != expected) throw std::invalid_argument(fmt::format("out: a span has {} elements, expected {}", found, expected));
}

}  // namespace

struct PointwiseMap::Bound final : Binding {
  std::size_t size() const override { return rest.size(); }
  std::shared_ptr<const char> token;
  std::vector<Vec3> rest, displacement;
  std::vector<Status> status;
  std::shared_ptr<const RestSide> side;  // null: nothing was kept
};

PointwiseMap::PointwiseMap() : token_(std::make_shared<const char>('\0')) {}

const PointwiseMap::Bound& PointwiseMap::own(const Binding& binding) const {
  const auto* bound = dynamic_cast<const Bound*>(&binding);
  if (!bound || bound->token != token_) throw std::invalid_argument("binding: made by another map");
  return *bound;
}

Vec3 PointwiseMap::position(const Vec3& rest) const {
  const Vec3 d = displacement(rest);
  return d.isZero(0) ? rest : Vec3(rest + d);  // keeps the sign of zeros, too
}

std::shared_ptr<const Binding> PointwiseMap::bind(Points rest) const { return boundBy(rest, nullptr); }

std::shared_ptr<const Binding> PointwiseMap::bindAgain(const Binding* earlier, Points rest) const {
  const auto* last = dynamic_cast<const Bound*>(earlier);
  std::vector<double> key = restKey();
  if (last && last->side && last->side->size == rest.size() && last->side->key == key) return boundBy(rest, last->side);
  const std::shared_ptr<RestSide> side = keepRest(rest);
  if (side) side->key = std::move(key), side->size = rest.size();
  return boundBy(rest, side);
}

std::shared_ptr<const Binding> PointwiseMap::boundBy(Points rest, std::shared_ptr<const RestSide> side) const {
  auto bound = std::make_shared<Bound>();
  bound->token = token_;
  bound->rest.assign(rest.begin(), rest.end());
  bound->displacement.assign(rest.size(), Vec3::Zero());
  bound->status.assign(rest.size(), Status::Invalid);
  bound->side = std::move(side);
  parallelFor(rest.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      if (!rest[i].allFinite()) continue;
      const Vec3 d = bound->side ? displacementOf(*bound->side, i, rest[i]) : displacement(rest[i]);
      if (!(rest[i] + d).allFinite()) continue;
      bound->displacement[i] = d;
      bound->status[i] = d.isZero(0) ? Status::Fixed : Status::Converged;
    }
  });
  return bound;
}

void PointwiseMap::apply(const Binding& binding, MapOutput out, Progress& progress) const {
  const Bound& b = own(binding);
  for (const std::size_t size : {out.position.size(), out.safe.size(), out.status.size(), out.residual.size()})
    if (size != 0) checkSize(size, b.size());
  parallelFor(b.size(), 8192, progress, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3 x = b.status[i] == Status::Converged ? Vec3(b.rest[i] + b.displacement[i]) : b.rest[i];
      if (!out.position.empty()) out.position[i] = x;
      if (!out.safe.empty()) out.safe[i] = x;
      if (!out.status.empty()) out.status[i] = b.status[i];
      if (!out.residual.empty()) out.residual[i] = 0;
    }
  });
}

void PointwiseMap::jacobians(const Binding& binding, std::span<Mat3> out) const {
  const Bound& b = own(binding);
  checkSize(out.size(), b.size());
  parallelFor(out.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      out[i].setIdentity();
      if (b.status[i] != Status::Invalid) out[i] = jacobian(b.rest[i]);
    }
  });
}

}  // namespace fielddeform::map
