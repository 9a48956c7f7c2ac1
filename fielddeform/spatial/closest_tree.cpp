#include <fielddeform/core/parallel.h>
#include <fielddeform/spatial/closest_tree.h>
#include <fielddeform/spatial/detail/box_tree.h>
#include <fielddeform/spatial/detail/simplex_inline.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace fielddeform::spatial {
namespace {

constexpr std::uint32_t kLeafSize = 4;
// Bound on the rounding of a computed distance, relative to distance and element: boxes up to this much farther are
// still opened, so that the answer is the minimum of the computed distances, whatever the tree.
constexpr double kSlack = 1e-12;
// Queries beyond this (in the tree's units) see all elements in one place.
constexpr double kFar = 0x1p500;
constexpr double kTinySquare = 0x1p-960;

}  // namespace

struct ClosestTree::Impl {
  int corners = 0;            // 1, 2 or 3
  std::size_t count = 0;      // elements
  double scale = 1, inverse = 1;
  double extent = 0;          // longest element box diagonal
  detail::BoxTree tree;
  std::vector<Vec3> vertex;   // by leaf slot, `corners` each
  std::vector<Index> slot;    // element -> leaf slot

  struct Best {
    SimplexHit hit{std::numeric_limits<double>::infinity(), Vec3::Zero(), Vec3::Zero()};
    Index element = kNoIndex;
    std::uint32_t slot = 0;
    double limit = std::numeric_limits<double>::infinity();  // squared distance of boxes to open
  };

  template <std::size_t N>
  static std::unique_ptr<Impl> build(Points points, std::span<const std::array<Index, N>> elements, const char* argument);
  void raiseLimit(Best& best) const {
    const double d = std::sqrt(best.hit.squaredDistance);
    const double reach = d + kSlack * (d + extent);
    best.limit = reach * reach;
  }
  template <int N>
  void testSlot(const Vec3& q, std::uint32_t s, Best& best) const;
  template <int N>
  void traverse(const Vec3& q, Best& best) const;
  ClosestPoint query(const Vec3& world, const QueryOptions& options) const;
};

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
  return impl;
}

template <int N>
void ClosestTree::Impl::testSlot(const Vec3& q, std::uint32_t s, Best& best) const {
  const Vec3* v = vertex.data() + static_cast<std::size_t>(N) * s;
  SimplexHit hit;
  if constexpr (N == 1) hit = detail::onPoint(q, v[0]);
  if constexpr (N == 2) hit = detail::onSegment(q, v[0], v[1]);
  if constexpr (N == 3) hit = detail::onTriangle(q, v[0], v[1], v[2]);
  if (hit.squaredDistance > best.hit.squaredDistance) return;
  if (hit.squaredDistance == best.hit.squaredDistance && best.element <= tree.order[s]) return;
  best.hit = hit;
  best.element = tree.order[s];
  best.slot = s;
  raiseLimit(best);
}

template <int N>
void ClosestTree::Impl::traverse(const Vec3& q, Best& best) const {
  struct Entry {
    detail::BoxTree::Child child;
    double squaredDistance;
  };
  Entry stack[detail::BoxTree::kMaxDepth];
  int top = 0;
  stack[top++] = {tree.root, 0};
  while (top > 0) {
    const Entry entry = stack[--top];
    if (entry.squaredDistance > best.limit) continue;
    if (entry.child.count > 0) {
      for (std::uint32_t s = entry.child.begin; s < entry.child.begin + entry.child.count; ++s) testSlot<N>(q, s, best);
      continue;
    }
    const detail::BoxTree::Node& node = tree.nodes[entry.child.begin];
    double d2[2] = {0, 0};
    for (int k = 0; k < 3; ++k)
      for (int side = 0; side < 2; ++side) {
        const double below = node.low[k][side] - q[k], above = q[k] - node.high[k][side];
        double d = below > above ? below : above;
        d = d > 0 ? d : 0;
        d2[side] += d * d;
      }
    const int nearer = d2[1] < d2[0] ? 1 : 0, farther = 1 - nearer;
    if (d2[farther] <= best.limit) stack[top++] = {node.child[farther], d2[farther]};
    stack[top++] = {node.child[nearer], d2[nearer]};
  }
}

ClosestPoint ClosestTree::Impl::query(const Vec3& world, const QueryOptions& options) const {
  ClosestPoint result;
  if (count == 0 || !world.allFinite() || !(options.maxDistance >= 0)) return result;
  Vec3 q = world * scale;
  const bool far = !(q.cwiseAbs().maxCoeff() < kFar);
  if (far) q = (world * 0.25).stableNormalized() * kFar;  // the elements' order is lost in rounding either way

  Best best;
  const double bound = options.maxDistance * scale;
  if (bound < kFar) best.limit = bound * bound * (1 + kSlack) + std::numeric_limits<double>::min();
  const bool hinted = options.hint < count;
  switch (corners) {
    case 1:
      if (hinted) testSlot<1>(q, slot[options.hint], best);
      traverse<1>(q, best);
      break;
    case 2:
      if (hinted) testSlot<2>(q, slot[options.hint], best);
      traverse<2>(q, best);
      break;
    default:
      if (hinted) testSlot<3>(q, slot[options.hint], best);
      traverse<3>(q, best);
  }
  if (best.element == kNoIndex) return result;

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
  if (distance > options.maxDistance) return result;
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

}  // namespace fielddeform::spatial
