#include <fielddeform/field/detail/stencil_base.h>
#include <fielddeform/numeric/detail/cell_list.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>

namespace fielddeform::field::detail {
namespace {

int piecesOf(double length, double spacing, std::size_t most) {
  return static_cast<int>(std::clamp(std::ceil(length / spacing), 1.0, static_cast<double>(most)));
}

using Triangle = std::array<Index, 3>;

std::vector<Triangle> trianglesOf(const skeleton::Primitive& p) {
  std::vector<Triangle> out;
  for (const auto& f : p.faces)
    for (std::size_t k = 2; k < f.size(); ++k) out.push_back({f[0], f[k - 1], f[k]});
  return out;
}

// How a mesh turns: normals beside its edges, and at its corners where they agree.
class Creases {
 public:
  Creases(const skeleton::Primitive& p, const std::vector<Triangle>& triangles, double angle) : angle_(angle) {
    if (!(angle > 0)) return;
    normal_.reserve(triangles.size());
    corner_.assign(p.points.size(), Vec3::Zero());
    for (const Triangle& t : triangles) {
      const Vec3 n = (p.points[t[1]] - p.points[t[0]]).stableNormalized().cross((p.points[t[2]] - p.points[t[0]]).stableNormalized());
      normal_.push_back(n.stableNormalized());
      for (const Index v : t) corner_[v] += normal_.back();
      for (std::size_t k = 0; k < 3; ++k) {
        Edge& e = edges_[key(t[k], t[(k + 1) % 3])];
        if (e.count < 2) e.normal[e.count] = normal_.back();
        ++e.count;
      }
    }
    for (Vec3& n : corner_) n = n.stableNormalized();
    // Corners where a triangle leans too far from the mean, or the surface ends, have no normal.
    const double least = std::cos(std::min(angle, 1.5));
    for (std::size_t i = 0; i < triangles.size(); ++i)
      for (const Index v : triangles[i])
        if (corner_[v].dot(normal_[i]) < least) corner_[v].setZero();
    for (const Triangle& t : triangles)
      for (std::size_t k = 0; k < 3; ++k)
        if (edges_.at(key(t[k], t[(k + 1) % 3])).count != 2) corner_[t[k]] = corner_[t[(k + 1) % 3]] = Vec3::Zero();
  }

  BasePoint inFace(const Vec3& p, std::size_t triangle) const {
    return angle_ > 0 ? BasePoint{p, normal_[triangle], normal_[triangle]} : BasePoint{p};
  }
  BasePoint onEdge(const Vec3& p, Index a, Index b) const {
    if (!(angle_ > 0)) return {p};
    const Edge& e = edges_.at(key(a, b));
    if (e.count != 2 || !(e.normal[0].dot(e.normal[1]) > 0)) return {p};
    return {p, e.normal[0], e.normal[1]};
  }
  BasePoint atCorner(const Vec3& p, Index v) const { return angle_ > 0 ? BasePoint{p, corner_[v], corner_[v]} : BasePoint{p}; }

 private:
  struct Edge {
    std::array<Vec3, 2> normal{Vec3::Zero(), Vec3::Zero()};
    std::size_t count = 0;
  };
  static std::uint64_t key(Index a, Index b) { return static_cast<std::uint64_t>(std::min(a, b)) << 32 | std::max(a, b); }

  double angle_;
  std::vector<Vec3> normal_, corner_;
  std::unordered_map<std::uint64_t, Edge> edges_;
};

}  // namespace

std::vector<BasePoint> thinned(const std::vector<BasePoint>& points, double spacing) {
  std::vector<Vec3> positions;
  positions.reserve(points.size());
  for (const BasePoint& b : points) positions.push_back(b.point);
  std::vector<BasePoint> out;
  for (const Index i : numeric::detail::thin(positions, spacing, {})) out.push_back(points[i]);
  return out;
}

std::vector<BasePoint> samplePrimitive(const skeleton::Primitive& p, double spacing, std::size_t most, double angle) {
  const std::vector<Triangle> triangles = trianglesOf(p);
  const Creases creases(p, triangles, angle);
  std::vector<BasePoint> out;
  for (Index v = 0; v < p.points.size(); ++v)
    out.push_back(p.type == skeleton::PrimitiveType::Mesh ? creases.atCorner(p.points[v], v) : BasePoint{p.points[v]});
  const auto along = [&](const Vec3& a, const Vec3& b) {
    const int n = piecesOf((b - a).norm(), spacing, most);
    for (int i = 1; i < n; ++i) out.push_back({a + (b - a) * (static_cast<double>(i) / n)});
  };
  const std::size_t count = p.points.size();
  if (p.type == skeleton::PrimitiveType::Polyline)
    for (std::size_t i = 0; i + (p.closed ? 0 : 1) < count; ++i) along(p.points[i], p.points[(i + 1) % count]);
  for (std::size_t f = 0; f < triangles.size(); ++f) {
    const Triangle& t = triangles[f];
    const Vec3 &a = p.points[t[0]], &b = p.points[t[1]], &c = p.points[t[2]];
    const double longest = std::max({(b - a).norm(), (c - a).norm(), (c - b).norm()});
    const int n = piecesOf(longest, spacing, 64);
    for (int i = 0; i <= n; ++i)
      for (int j = 0; j <= n - i; ++j) {
        const Vec3 x = a + (b - a) * (static_cast<double>(i) / n) + (c - a) * (static_cast<double>(j) / n);
        const bool onAC = i == 0, onAB = j == 0, onBC = i + j == n;
        if (onAC + onAB + onBC > 1) continue;  // a corner
        if (onAC) out.push_back(creases.onEdge(x, t[0], t[2]));
        else if (onAB) out.push_back(creases.onEdge(x, t[0], t[1]));
        else if (onBC) out.push_back(creases.onEdge(x, t[1], t[2]));
        else out.push_back(creases.inFace(x, f));
      }
    if (out.size() > 64 * most) out = thinned(out, spacing);
  }
  return thinned(out, spacing);
}

}  // namespace fielddeform::field::detail
