#include <fielddeform/core/parallel.h>
#include <fielddeform/spatial/closest_tree.h>
#include <fielddeform/spatial/detail/closest_tree_impl.h>
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace fielddeform::spatial {
namespace {

constexpr std::uint32_t kLeafSize = 4;
constexpr double kTinySquare = 0x1p-960;

}  // namespace

std::uint64_t ClosestTree::Impl::nextId() noexcept {
  static std::atomic<std::uint64_t> next{0};
  return next.fetch_add(1, std::memory_order_relaxed);
}

template <std::size_t N>
std::unique_ptr<ClosestTree::Impl> ClosestTree::Impl::build(Points points,
                                                            std::span<const std::array<Index, N>> elements,
                                                            const char* argument) {
  if (elements.size() >= (std::size_t{1} << 31))
    throw std::invalid_argument(fmt::format("{}: {} elements, expected less than 2^31", argument, elements.size()));
  auto impl = std::make_unique<Impl>();
  impl->corners = static_cast<int>(N);
  impl->count = elements.size();
  impl->scale = detail::unitScale(points, "points");
  impl->inverse = 1 / impl->scale;
  std::vector<Vec3> low(elements.size()), high(elements.size());
  for (std::size_t e = 0; e < elements.size(); ++e) {
    for (const Index v : elements[e])
      if (v >= points.size())
        throw std::invalid_argument(
            fmt::format("{}: element {} has vertex {}, expected below {}", argument, e, v, points.size()));
    low[e] = high[e] = points[elements[e][0]] * impl->scale;
    for (std::size_t k = 1; k < N; ++k) {
      const Vec3 p = points[elements[e][k]] * impl->scale;
      low[e] = low[e].cwiseMin(p);
      high[e] = high[e].cwiseMax(p);
    }
    impl->extent = std::max(impl->extent, (high[e] - low[e]).norm());
  }
  impl->tree = detail::buildBoxTree(low, high, kLeafSize);
  impl->vertex.reserve(N * elements.size());
  impl->slot.resize(elements.size());
  for (std::uint32_t s = 0; s < elements.size(); ++s) {
    const Index e = impl->tree.order[s];
    impl->slot[e] = s;
    for (const Index v : elements[e]) impl->vertex.push_back(points[v] * impl->scale);
  }
  if constexpr (N == 3) impl->oriented = detail::orientedBoxes(impl->tree, impl->vertex);
  return impl;
}

Vec3 ClosestTree::Impl::inUnits(const Vec3& world, bool& far) const {
  const Vec3 q = world * scale;
  far = !(q.cwiseAbs().maxCoeff() < kFar);
  return far ? Vec3((world * 0.25).stableNormalized() * kFar) : q;  // the elements' order is lost in rounding either way
}

ClosestPoint ClosestTree::Impl::query(const Vec3& world, const QueryOptions& options) const {
  if (count == 0 || !world.allFinite() || !(options.maxDistance >= 0)) return {};
  bool far = false;
  const Vec3 q = inUnits(world, far);
  Best best;
  best.limit = limitOf(options.maxDistance * scale);
  switch (corners) {
    case 1: search<1>(q, options.hint, best); break;
    case 2: search<2>(q, options.hint, best); break;
    default: search<3>(q, options.hint, best);
  }
  return answer(world, far, best, options.maxDistance);
}

ClosestPoint ClosestTree::Impl::answer(const Vec3& world, bool far, const Best& best, double maxDistance) const {
  if (best.element == kNoIndex) return {};

  const Vec3* v = vertex.data() + static_cast<std::size_t>(corners) * best.slot;
  const Vec3& w = best.hit.weight;
  // A corner is returned as it was given; elsewhere the foot seen from the first corner with any weight.
  Vec3 foot = v[0];
  if (corners > 1) {
    int largest = 0;
    w.maxCoeff(&largest);
    foot = v[largest];
    for (int k = 0; k < corners; ++k)
      if (k != largest && w[k] != 0) foot += w[k] * (v[k] - v[largest]);
  }
  const double d2 = best.hit.squaredDistance;
  const Vec3 point = foot * inverse;
  const bool outOfRange = far || d2 < kTinySquare;
  const Vec3 offset = outOfRange ? Vec3(world - point) : Vec3(best.hit.offset * inverse);
  const double distance = outOfRange ? offset.stableNorm() : std::sqrt(d2) * inverse;
  if (distance > maxDistance) return {};
  return {best.element, distance, point, offset, w};
}

ClosestTree::ClosestTree(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ClosestTree::~ClosestTree() = default;
ClosestTree::ClosestTree(ClosestTree&&) noexcept = default;
ClosestTree& ClosestTree::operator=(ClosestTree&&) noexcept = default;

ClosestTree ClosestTree::ofPoints(Points points) {
  std::vector<std::array<Index, 1>> elements(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) elements[i] = {static_cast<Index>(i)};
  return ClosestTree(Impl::build<1>(points, elements, "points"));
}

ClosestTree ClosestTree::ofSegments(Points points, std::span<const std::array<Index, 2>> segments) {
  return ClosestTree(Impl::build<2>(points, segments, "segments"));
}

ClosestTree ClosestTree::ofTriangles(Points points, std::span<const std::array<Index, 3>> triangles) {
  return ClosestTree(Impl::build<3>(points, triangles, "triangles"));
}

std::size_t ClosestTree::size() const noexcept { return impl_->count; }

ClosestPoint ClosestTree::closest(const Vec3& query, const QueryOptions& options) const {
  return impl_->query(query, options);
}

ClosestPoint ClosestTree::closestOn(Index element, const Vec3& query) const {
  if (!(element < impl_->count) || !query.allFinite()) return {};
  bool far = false;
  const Vec3 q = impl_->inUnits(query, far);
  Impl::Best best;
  best.element = element;
  best.slot = impl_->slot[element];
  switch (impl_->corners) {
    case 1: best.hit = impl_->testOne<1>(q, best.slot); break;
    case 2: best.hit = impl_->testOne<2>(q, best.slot); break;
    default: best.hit = impl_->testOne<3>(q, best.slot);
  }
  return impl_->answer(query, far, best, std::numeric_limits<double>::infinity());
}

void ClosestTree::closest(Points queries, std::span<ClosestPoint> out) const {
  if (queries.size() != out.size())
    throw std::invalid_argument(fmt::format("out: {} elements, expected {}", out.size(), queries.size()));
  parallelFor(queries.size(), 1024, [&](std::size_t begin, std::size_t end) {
    QueryOptions options;
    for (std::size_t i = begin; i < end; ++i) {
      out[i] = impl_->query(queries[i], options);
      if (out[i].element != kNoIndex) options.hint = out[i].element;
    }
  });
}

void ClosestTree::closestTogether(Points queries, std::span<ClosestPoint> out, BlockHint& hint, double maxDistance) const {
  if (queries.size() != out.size())
    throw std::invalid_argument(fmt::format("out: {} elements, expected {}", out.size(), queries.size()));
  switch (impl_->corners) {
    case 1: return impl_->together<1>(queries, out, maxDistance, hint);
    case 2: return impl_->together<2>(queries, out, maxDistance, hint);
    default: return impl_->trianglesTogether(queries, out, maxDistance, hint);
  }
}

}  // namespace fielddeform::spatial
