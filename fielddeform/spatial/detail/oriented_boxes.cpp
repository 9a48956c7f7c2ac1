#include <fielddeform/core/parallel.h>
#include <fielddeform/spatial/detail/oriented_boxes.h>

#include <algorithm>

namespace fielddeform::spatial::detail {
namespace {

constexpr std::uint32_t kMost = 256;  // triangles: larger parts of a surface are not flat, and are few
constexpr double kOver = 1e-12;

using Corners = std::span<const Vec3>;

// Around the corners, about a centre: from the centre as it was rounded.
OrientedBox around(Corners corners, const Vec3& centre, const Vec3& x, const Vec3& y, const Vec3& z) {
  OrientedBox box{centre, {x, y, z}, Vec3::Zero(), 0};
  for (const Vec3& p : corners)
    for (int k = 0; k < 3; ++k) box.half[k] = std::max(box.half[k], std::abs(dot(box.axis[k], p - centre)));
  box.diagonal = 2 * std::sqrt(square(box.half));
  box.half += Vec3::Constant(kOver * box.diagonal);
  return box;
}

OrientedBox alongAxes(Corners corners) {
  Box box;
  for (const Vec3& p : corners) box.extend(p);
  return around(corners, 0.5 * (box.min() + box.max()), Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ());
}

// In the plane of the mean normal, along the direction in which the corners are spread most.
OrientedBox alongSurface(Corners corners, const Vec3& normal) {
  const Vec3 u = normal.unitOrthogonal(), w = normal.cross(u);
  Vec3 mean = Vec3::Zero();
  for (const Vec3& p : corners) mean += p - corners[0];
  mean = corners[0] + mean / static_cast<double>(corners.size());
  double uu = 0, uw = 0, ww = 0;
  for (const Vec3& p : corners) {
    const double a = dot(u, p - mean), b = dot(w, p - mean);
    uu += a * a;
    uw += a * b;
    ww += b * b;
  }
  const double d = 0.5 * (uu - ww), r = std::sqrt(d * d + uw * uw);
  const double a = d >= 0 ? d + r : uw, b = d >= 0 ? uw : r - d, length = std::sqrt(a * a + b * b);
  const Vec3 x = length > 0 ? Vec3((a * u + b * w) / length) : u, y = normal.cross(x);
  Vec3 low = Vec3::Zero(), high = Vec3::Zero();
  for (const Vec3& p : corners) {
    const Vec3 at(dot(x, p - mean), dot(y, p - mean), dot(normal, p - mean));
    low = low.cwiseMin(at);
    high = high.cwiseMax(at);
  }
  const Vec3 middle = 0.5 * (low + high);
  return around(corners, mean + middle[0] * x + middle[1] * y + middle[2] * normal, x, y, normal);
}

double surface(const OrientedBox& b) { return b.half[0] * b.half[1] + b.half[1] * b.half[2] + b.half[2] * b.half[0]; }

OrientedBox fit(Corners corners) {
  Vec3 normal = Vec3::Zero();
  for (std::size_t t = 0; t + 2 < corners.size(); t += 3) normal += (corners[t + 1] - corners[t]).cross(corners[t + 2] - corners[t]);
  const OrientedBox plain = alongAxes(corners);
  const double length = std::sqrt(square(normal));
  if (!(length > 0)) return plain;
  const OrientedBox lying = alongSurface(corners, normal / length);
  return surface(lying) < surface(plain) ? lying : plain;
}

}  // namespace

std::vector<OrientedBox> orientedBoxes(const BoxTree& tree, const std::vector<Vec3>& vertex) {
  // The slots below a node are a run: that of its first child, then that of its second.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> run(tree.nodes.size());
  const auto runOf = [&](const BoxTree::Child& c) { return c.count > 0 ? std::pair(c.begin, c.begin + c.count) : run[c.begin]; };
  for (std::size_t i = tree.nodes.size(); i-- > 0;)
    run[i] = {runOf(tree.nodes[i].child[0]).first, runOf(tree.nodes[i].child[1]).second};
  std::vector<OrientedBox> boxes(2 * tree.nodes.size());
  parallelFor(boxes.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b) {
      const auto slots = runOf(tree.nodes[b / 2].child[b % 2]);
      const std::uint32_t count = slots.second - slots.first;
      if (count <= kMost) boxes[b] = fit(Corners(vertex).subspan(std::size_t{3} * slots.first, std::size_t{3} * count));
    }
  });
  return boxes;
}

}  // namespace fielddeform::spatial::detail
