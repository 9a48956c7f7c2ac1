#include <fielddeform/spatial/detail/box_tree.h>
#include <fielddeform/spatial/detail/simplex_inline.h>
#include <fielddeform/spatial/winding.h>
#include <fmt/format.h>

#include <cmath>
#include <stdexcept>
#include <vector>

namespace fielddeform::spatial {
namespace {

constexpr double kInverseFourPi = 0x1.45f306dc9c883p-4;  // 1 / (4 pi)
constexpr double kBeta = 2;      // a group is far beyond this many radii
constexpr double kFar = 0x1p300;
constexpr std::uint32_t kLeafSize = 8;

struct Dipole {
  Vec3 centre = Vec3::Zero();  // area-weighted
  Vec3 area = Vec3::Zero();    // sum of area vectors
  double reach2 = 0;           // (beta * radius)^2 about the centre
};

}  // namespace

struct WindingNumber::Impl {
  double scale = 1;
  detail::BoxTree tree;
  std::vector<Vec3> vertex;                   // by leaf slot, 3 each
  std::vector<std::array<Dipole, 2>> dipole;  // by node and side

  double exactRange(const Vec3& q, std::size_t begin, std::size_t end) const;
  Dipole dipoleOf(std::size_t begin, std::size_t end) const;
  void makeDipoles();
};

// Sum of solid angles. Half angles add as complex numbers multiply, so that one atan2 serves several triangles: as many
// as surely stay together below pi.
double WindingNumber::Impl::exactRange(const Vec3& q, std::size_t begin, std::size_t end) const {
  double sum = 0, real = 1, imaginary = 0, bound = 0;
  for (std::size_t s = begin; s < end; ++s) {
    const detail::HalfAngle h = detail::halfSolidAngle(q, vertex[3 * s], vertex[3 * s + 1], vertex[3 * s + 2]);
    const double tangent = h.cosine > 0 ? std::abs(h.sine) / h.cosine : 4;  // not below the angle
    if (bound + tangent > 3) {
      sum += numeric::atan2(imaginary, real);
      real = 1;
      imaginary = bound = 0;
    }
    if (tangent > 3) {
      sum += h.sine == 0 ? 0 : numeric::atan2(h.sine, h.cosine);
      continue;
    }
    // Scaled to a cosine of one: products of small numbers would underflow.
    const double t = h.sine / h.cosine;
    const double r = real - imaginary * t;
    imaginary += real * t;
    real = r;
    bound += tangent;
  }
  return 2 * (sum + numeric::atan2(imaginary, real));
}

Dipole WindingNumber::Impl::dipoleOf(std::size_t begin, std::size_t end) const {
  Dipole d;
  double total = 0;
  const Vec3 origin = vertex[3 * begin];  // centred, so that a distant mesh loses nothing
  Vec3 moment = Vec3::Zero(), middle = Vec3::Zero();
  for (std::size_t s = begin; s < end; ++s) {
    const Vec3 a = vertex[3 * s] - origin, b = vertex[3 * s + 1] - origin, c = vertex[3 * s + 2] - origin;
    const Vec3 area = 0.5 * (b - a).cross(c - a);
    const double size = area.norm();
    d.area += area;
    moment += size * (a + b + c) / 3;
    middle += (a + b + c) / 3;
    total += size;
  }
  d.centre = origin + (total > 0 ? Vec3(moment / total) : Vec3(middle / static_cast<double>(end - begin)));
  double radius2 = 0;
  for (std::size_t v = 3 * begin; v < 3 * end; ++v) radius2 = std::max(radius2, (vertex[v] - d.centre).squaredNorm());
  d.reach2 = kBeta * kBeta * radius2;
  return d;
}

void WindingNumber::Impl::makeDipoles() {
  // The slots of a subtree are one range; ranges are found from the leaves up (children follow their parents).
  struct Range {
    std::size_t begin = 0, end = 0;
  };
  std::vector<Range> range(tree.nodes.size());
  dipole.resize(tree.nodes.size());
  for (std::size_t n = tree.nodes.size(); n-- > 0;) {
    Range side[2];
    for (int k = 0; k < 2; ++k) {
      const auto& child = tree.nodes[n].child[k];
      side[k] = child.count ? Range{child.begin, child.begin + child.count} : range[child.begin];
      dipole[n][k] = dipoleOf(side[k].begin, side[k].end);
    }
    range[n] = {side[0].begin, side[1].end};
  }
}

WindingNumber::WindingNumber(Points points, std::span<const std::array<Index, 3>> triangles)
    : impl_(std::make_unique<Impl>()) {
  impl_->scale = detail::unitScale(points, "points");
  std::vector<Vec3> low(triangles.size()), high(triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    Box box;
    for (const Index v : triangles[t]) {
      if (v >= points.size())
        throw std::invalid_argument(
            fmt::format("triangles: element {} has vertex {}, expected below {}", t, v, points.size()));
      box.extend(Vec3(points[v] * impl_->scale));
    }
    low[t] = box.min();
    high[t] = box.max();
  }
  impl_->tree = detail::buildBoxTree(low, high, kLeafSize);
  impl_->vertex.reserve(3 * triangles.size());
  for (const Index t : impl_->tree.order)
    for (const Index v : triangles[t]) impl_->vertex.push_back(points[v] * impl_->scale);
  impl_->makeDipoles();
}

WindingNumber::~WindingNumber() = default;
WindingNumber::WindingNumber(WindingNumber&&) noexcept = default;
WindingNumber& WindingNumber::operator=(WindingNumber&&) noexcept = default;

double WindingNumber::exactAt(const Vec3& query) const {
  const Vec3 q = query * impl_->scale;
  if (!q.allFinite()) return 0;
  return impl_->exactRange(q, 0, impl_->tree.order.size()) * kInverseFourPi;
}

double WindingNumber::at(const Vec3& query) const {
  const Vec3 q = query * impl_->scale;
  if (!(q.array().abs() < kFar).all()) return 0;  // far away or not a number
  const detail::BoxTree& tree = impl_->tree;
  detail::BoxTree::Child stack[detail::BoxTree::kMaxDepth];
  int top = 0;
  stack[top++] = tree.root;
  double sum = 0;
  while (top > 0) {
    const auto entry = stack[--top];
    if (entry.count > 0) {
      sum += impl_->exactRange(q, entry.begin, entry.begin + entry.count);
      continue;
    }
    if (tree.nodes.empty()) break;
    for (int side = 1; side >= 0; --side) {
      const Dipole& d = impl_->dipole[entry.begin][side];
      const Vec3 r = d.centre - q;
      const double r2 = r.squaredNorm();
      if (r2 > d.reach2)
        sum += d.area.dot(r) / (r2 * std::sqrt(r2));
      else
        stack[top++] = tree.nodes[entry.begin].child[side];
    }
  }
  return sum * kInverseFourPi;
}

}  // namespace fielddeform::spatial
