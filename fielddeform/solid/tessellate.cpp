#include <fielddeform/core/error.h>
#include <fielddeform/solid/bezier.h>
#include <fielddeform/solid/size.h>
#include <fielddeform/solid/tessellate.h>

#include <algorithm>
#include <map>

namespace fielddeform::solid {
namespace {

/// Sums a row of control points with Bernstein weights.
Vec3 sum(std::span<const Vec3> points, const double* weight) {
  Vec3 out = Vec3::Zero();
  for (std::size_t i = 0; i < points.size(); ++i) out += weight[i] * points[i];
  return out;
}

class Tessellation {
 public:
  Tessellation(const Object& object, int segments) : object_(object), segments_(segments) {
    for (const Vec3& p : object.points) box_.extend(p);
  }

  void side(const Solid& solid, Side side, bool turned) {
    const Layer layer = layerOf(solid, side);
    std::vector<Index> ids;
    for (const std::size_t slot : layer.slots) ids.push_back(solid.points[slot]);
    const auto n = static_cast<std::size_t>(segments_), row = n + 1;
    std::vector<Index> grid(row * row, kNoIndex);
    const auto along = [&](std::size_t from, std::size_t step, std::size_t count) {
      std::vector<Index> out;
      for (std::size_t i = 0; i < count; ++i) out.push_back(ids[from + i * step]);
      return out;
    };
    const auto w = static_cast<std::size_t>(layer.first), h = static_cast<std::size_t>(layer.second);
    const auto put = [&](const std::vector<Index>& edge, std::size_t from, std::size_t step) {
      const std::vector<Index> v = edgeVertices(edge);
      for (std::size_t i = 0; i <= n; ++i) grid[from + i * step] = v[i];
    };
    put(along(0, 1, w), 0, 1);
    put(along(w * (h - 1), 1, w), row * n, 1);
    put(along(0, w, h), 0, row);
    put(along(w - 1, w, h), n, row);
    inner(ids, layer, grid);
    for (std::size_t j = 0; j < n; ++j)
      for (std::size_t i = 0; i < n; ++i) {
        std::array<Index, 4> q{grid[j * row + i], grid[j * row + i + 1], grid[(j + 1) * row + i + 1], grid[(j + 1) * row + i]};
        if (turned) std::swap(q[1], q[3]);
        face(q);
      }
  }

  mesh::Mesh take() { return {std::move(points_), std::move(corners_), std::move(offsets_)}; }

 private:
  Index add(const Vec3& p) {
    points_.push_back(p);
    return static_cast<Index>(points_.size() - 1);
  }

  /// Corners are control points, by number and, where they coincide as on a collapsed edge, by place.
  Index corner(Index id) {
    const auto [it, fresh] = corners3_.emplace(id, 0);
    if (fresh) it->second = add(object_.points[id]);
    return it->second;
  }

  bool collapsed(const std::vector<Index>& edge) const {
    const double near = 1e-12 * box_.sizes().norm();
    return std::all_of(edge.begin(), edge.end(), [&](Index i) { return (object_.points[i] - object_.points[edge[0]]).norm() <= near; });
  }

  std::vector<Index> edgeVertices(std::vector<Index> edge) {
    std::vector<Index> back(edge.rbegin(), edge.rend());
    const bool reversed = back < edge;
    if (reversed) edge = back;
    auto [it, fresh] = edges_.emplace(edge, std::vector<Index>());
    if (fresh) {
      const auto n = static_cast<std::size_t>(segments_);
      std::vector<Index>& out = it->second;
      if (collapsed(edge)) {
        // Both ends become one vertex, also for the other edges that end here.
        const Index lead = corner(edge.front());
        corners3_.emplace(edge.back(), lead);
        out.assign(n + 1, lead);
      } else {
        std::vector<Vec3> p;
        for (const Index i : edge) p.push_back(object_.points[i]);
        std::array<double, kMaxDegree + 1> b, d;
        out.push_back(corner(edge.front()));
        for (std::size_t k = 1; k < n; ++k) {
          bernstein(static_cast<int>(edge.size()) - 1, static_cast<double>(k) / static_cast<double>(n), b.data(), d.data());
          out.push_back(add(sum(p, b.data())));
        }
        out.push_back(corner(edge.back()));
      }
    }
    std::vector<Index> out = it->second;
    if (reversed) std::reverse(out.begin(), out.end());
    return out;
  }

  void inner(const std::vector<Index>& ids, const Layer& layer, std::vector<Index>& grid) {
    const auto n = static_cast<std::size_t>(segments_), row = n + 1;
    std::array<double, kMaxDegree + 1> b, d;
    std::vector<Vec3> all, curve(static_cast<std::size_t>(layer.first));
    for (const Index i : ids) all.push_back(object_.points[i]);
    for (std::size_t j = 1; j < n; ++j) {
      bernstein(layer.second - 1, static_cast<double>(j) / static_cast<double>(n), b.data(), d.data());
      for (std::size_t i = 0; i < curve.size(); ++i) {
        curve[i].setZero();
        for (std::size_t k = 0; k < static_cast<std::size_t>(layer.second); ++k) curve[i] += b[k] * all[i + k * curve.size()];
      }
      for (std::size_t i = 1; i < n; ++i) {
        bernstein(layer.first - 1, static_cast<double>(i) / static_cast<double>(n), b.data(), d.data());
        grid[j * row + i] = add(sum(curve, b.data()));
      }
    }
  }

  void face(const std::array<Index, 4>& q) {
    std::vector<Index> distinct;
    for (std::size_t k = 0; k < 4; ++k)
      if (q[k] != q[(k + 3) % 4]) distinct.push_back(q[k]);
    if (distinct.size() < 3) return;
    corners_.insert(corners_.end(), distinct.begin(), distinct.end());
    offsets_.push_back(static_cast<Index>(corners_.size()));
  }

  const Object& object_;
  int segments_;
  Box box_;
  std::map<Index, Index> corners3_;
  std::map<std::vector<Index>, std::vector<Index>> edges_;
  std::vector<Vec3> points_;
  std::vector<Index> corners_, offsets_{0};
};

}  // namespace

mesh::Mesh tessellate(const Object& object, int segments) {
  requireInRange("segments", segments, 1, 1024);
  object.validate();
  const Sizes sizes(object);
  const auto covered = [&](const FaceRef& f) {
    return std::any_of(object.joints.begin(), object.joints.end(), [&](const Joint& j) { return j.a == f || j.b == f; });
  };
  Tessellation out(object, segments);
  // Collapsed edges first, so that corners are joined before anything is made of them.
  for (std::size_t s = 0; s < object.solids.size(); ++s) {
    const bool inside = sizes.value(s, object.points) < 0;
    for (int k = 0; k < 6; ++k)
      if (!covered({s, static_cast<Side>(k)})) out.side(object.solids[s], static_cast<Side>(k), ((k % 2 == 1) == (k / 2 != 1)) == inside);
  }
  return out.take();
}

mesh::Mesh sampleInside(const Object& object, int samples) {
  requireInRange("samples", samples, 1, 256);
  object.validate();
  std::vector<Vec3> points;
  mesh::Attribute solid{"solid", mesh::Element::Vertex, 1, mesh::Interpolation::Nearest, std::vector<std::int32_t>(), {}, {}};
  std::array<mesh::Attribute, 3> uvw;
  for (std::size_t a = 0; a < 3; ++a) uvw[a] = {std::string(1, "uvw"[a]), mesh::Element::Vertex, 1, mesh::Interpolation::Linear, std::vector<double>(), {}, {}};
  for (std::size_t s = 0; s < object.solids.size(); ++s) {
    const std::vector<Vec3> control = object.pointsOf(s);
    for (int k = 0; k <= samples; ++k)
      for (int j = 0; j <= samples; ++j)
        for (int i = 0; i <= samples; ++i) {
          const Vec3 u = Vec3(i, j, k) / samples;
          points.push_back(evaluate(object.solids[s].degree, control, u));
          std::get<std::vector<std::int32_t>>(solid.data).push_back(static_cast<std::int32_t>(s));
          for (std::size_t a = 0; a < 3; ++a) std::get<std::vector<double>>(uvw[a].data).push_back(u[static_cast<Eigen::Index>(a)]);
        }
  }
  mesh::Mesh out(std::move(points), {});
  out.attributes().push_back(std::move(solid));
  for (auto& a : uvw) out.attributes().push_back(std::move(a));
  return out;
}

}  // namespace fielddeform::solid
