#include <fielddeform/core/parallel.h>
#include <fielddeform/render/detail/canvas.h>
#include <fielddeform/render/detail/geometry.h>
#include <fielddeform/render/detail/smooth_normals.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace fielddeform::render::detail {
namespace {

using Eigen::Vector3f;
using Eigen::Vector4f;
using mesh::Element;

/// The colour of a corner, by what the body says: its colour, its scalars, its attribute, clay.
class Painter {
 public:
  Painter(const Body& body, const ScalarStyle& style, const ScalarRange& range)
      : body_(body), style_(style), range_(range) {
    if (body.color) return;
    if (!body.scalars.empty()) {
      scalarsOn_ = body.scalars.size() == body.mesh->vertexCount() ? Element::Vertex : Element::Face;
      return;
    }
    for (const Element on : {Element::Vertex, Element::Corner, Element::Face}) {
      const mesh::Attribute* a = body.mesh->find(on, "color");
      if (!a || a->width < 3 || !a->listOffsets.empty() || a->valueCount() == 0) continue;
      attribute_ = a;
      const auto type = a->type();
      unit_ = type == mesh::ScalarType::Float32 || type == mesh::ScalarType::Float64 ? 1.0 : 1.0 / 255;
      for (int i = 0; i < 256; ++i) table_[i] = toLinear({static_cast<float>(i) / 255, 0, 0}).x();
      return;
    }
  }

  bool varies() const { return !body_.scalars.empty() ? !body_.color : attribute_ != nullptr; }
  Vector3f constant() const { return toLinear(body_.color.value_or(kClay)); }

  Vector3f at(Index vertex, Index corner, std::size_t face) const {
    if (body_.color || !varies()) return constant();
    if (!attribute_) {
      const double s = body_.scalars[scalarsOn_ == Element::Vertex ? vertex : face];
      const double width = range_.high - range_.low;
      return toLinear(mapColor(style_.map, !std::isfinite(s) ? NAN : width > 0 ? (s - range_.low) / width : 0.0));
    }
    std::size_t value = attribute_->on == Element::Vertex ? vertex : attribute_->on == Element::Corner ? corner : face;
    if (!attribute_->indices.empty())
      value = corner < attribute_->indices.size() ? attribute_->indices[corner] : kNoIndex;
    if (value >= attribute_->valueCount()) return constant();
    Vector3f out;
    for (int k = 0; k < 3; ++k) {
      const double c = attribute_->get(value, k) * unit_;
      out[k] = std::isfinite(c) ? table_[static_cast<std::size_t>(std::lround(std::clamp(c, 0.0, 1.0) * 255))] : 0.3f;
    }
    return out;
  }

 private:
  const Body& body_;
  const ScalarStyle& style_;
  const ScalarRange& range_;
  Element scalarsOn_ = Element::Vertex;
  const mesh::Attribute* attribute_ = nullptr;
  double unit_ = 1;
  std::array<float, 256> table_{};
};

Vector3f placed(const ViewFrame& frame, const Vec3& p) { return frame.normalised(p).cast<float>(); }
Vector4f withRadius(const Vector3f& p, float radius) { return {p.x(), p.y(), p.z(), radius}; }

void addTube(Strokes& strokes, const Vector3f& a, const Vector3f& b, float radius) {
  strokes.tubes.push_back(withRadius(a, radius));
  strokes.tubes.push_back(withRadius(b, radius));
}

/// Every edge of polygons once, as (lower, higher) vertex in one number, sorted.
template <class Faces>
std::vector<std::uint64_t> edgesOf(std::size_t faces, Faces&& face) {
  std::vector<std::uint64_t> edges;
  for (std::size_t f = 0; f < faces; ++f) {
    const auto& c = face(f);
    for (std::size_t k = 0; k < c.size(); ++k) {
      const Index a = c[k], b = c[(k + 1) % c.size()];
      if (a != b) edges.push_back(static_cast<std::uint64_t>(std::min(a, b)) << 32 | std::max(a, b));
    }
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

}  // namespace

ScalarRange scalarRange(const Picture& picture) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const View& view : picture.views) {
    for (const Body& body : view.bodies) {
      if (!showsScalars(body)) continue;
      for (const double s : body.scalars) {
        if (std::isfinite(s)) low = std::min(low, s), high = std::max(high, s);
      }
    }
  }
  if (!(low <= high)) low = 0, high = 1;
  if (picture.scalars.map == ColorMap::Diverging && !picture.scalars.low && !picture.scalars.high) {
    high = std::max(std::abs(low), std::abs(high));
    low = -high;
  }
  ScalarRange range{picture.scalars.low.value_or(low), picture.scalars.high.value_or(high)};
  if (range.low > range.high)
    (picture.scalars.low ? range.high : range.low) = picture.scalars.low ? range.low : range.high;
  return range;
}

Surface makeSurface(const Body& body, const ViewFrame& frame, const ScalarStyle& style, const ScalarRange& range) {
  const mesh::Mesh& mesh = *body.mesh;
  const auto& positions = positionsOf(body);
  const Painter painter(body, style, range);
  Surface surface;
  surface.color = painter.constant();
  surface.points.resize(positions.size());
  parallelFor(positions.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      surface.points[v] = positions[v].allFinite() ? placed(frame, positions[v]) : Vector3f(Vector3f::Zero());
    }
  });
  for (std::size_t f = 0; f < mesh.faceCount(); ++f) {
    const auto face = mesh.face(f);
    const Index begin = mesh.faceBegin(f);
    for (std::size_t k = 2; k < face.size(); ++k) {
      const std::size_t at[3] = {0, k - 1, k};
      bool finite = true;
      for (const std::size_t c : at) finite &= positions[face[c]].allFinite();
      if (!finite) continue;
      for (const std::size_t c : at) {
        surface.corners.push_back(face[c]);
        if (painter.varies()) surface.colors.push_back(painter.at(face[c], begin + static_cast<Index>(c), f));
      }
    }
  }
  surface.normals = smoothNormals(surface.points, surface.corners, body.creaseAngle);
  return surface;
}

Strokes makeStrokes(const Body& body, const ViewFrame& frame, const ScalarStyle& style, const ScalarRange& range) {
  const mesh::Mesh& mesh = *body.mesh;
  const auto& positions = positionsOf(body);
  const Painter painter(body, style, range);
  const float view = frame.pixel * static_cast<float>(std::min(frame.cell.width, frame.cell.height));
  Strokes strokes;
  strokes.color = 0.35f * painter.constant();
  const auto tube = [&](Index a, Index b, float radius) {
    if (positions[a].allFinite() && positions[b].allFinite())
      addTube(strokes, placed(frame, positions[a]), placed(frame, positions[b]), radius);
  };
  for (const auto& line : mesh.lines()) {
    for (std::size_t i = 0; i + 1 < line.vertices.size(); ++i)
      tube(line.vertices[i], line.vertices[i + 1], 0.003f * view);
  }
  if (body.edgeWidth > 0) {
    const float radius = static_cast<float>(body.edgeWidth) * 0.0005f * view;
    for (const std::uint64_t e : edgesOf(mesh.faceCount(), [&](std::size_t f) { return mesh.face(f); })) {
      tube(static_cast<Index>(e >> 32), static_cast<Index>(e), radius);
    }
  }
  std::vector<Index> points = mesh.loosePoints();
  if (mesh.cornerCount() == 0 && mesh.lines().empty() && points.empty()) points = drawnVertices(body);
  // Spheres that about touch if the points cover a third of the view.
  const float spacing = view * std::sqrt(0.3f / static_cast<float>(std::max<std::size_t>(1, points.size())));
  const float radius = std::clamp(0.6f * spacing, 0.8f * frame.pixel, 0.012f * view);
  for (const Index v : points) {
    if (!positions[v].allFinite()) continue;
    strokes.spheres.push_back(withRadius(placed(frame, positions[v]), radius));
    strokes.sphereColors.push_back(painter.at(v, kNoIndex, kNoIndex));
  }
  return strokes;
}

Strokes makeStrokes(const Overlay& overlay, const ViewFrame& frame) {
  const float pixels = static_cast<float>(std::min(frame.cell.width, frame.cell.height));
  const float radius = static_cast<float>(overlay.thickness) * frame.pixel * std::max(0.0065f * pixels, 1.4f);
  Strokes strokes;
  strokes.color = toLinear(overlay.color);
  strokes.hidden = static_cast<float>(overlay.hidden);
  for (const auto& primitive : overlay.skeleton.primitives) {
    const auto& p = primitive.points;
    const auto tube = [&](std::size_t a, std::size_t b, float r) {
      addTube(strokes, placed(frame, p[a]), placed(frame, p[b]), r);
    };
    if (primitive.type == skeleton::PrimitiveType::Mesh) {
      const auto edges = edgesOf(
          primitive.faces.size(), [&](std::size_t f) -> const auto& { return primitive.faces[f]; });
      // Many edges get thin, so that the object shows between them.
      const float thin = std::clamp(std::sqrt(400.0f / static_cast<float>(edges.size() + 1)), 0.35f, 1.0f);
      for (const std::uint64_t e : edges) tube(e >> 32, e & 0xFFFFFFFFu, 0.45f * thin * radius);
      continue;
    }
    const bool line = primitive.type == skeleton::PrimitiveType::Polyline;
    for (std::size_t i = 0; line && i + 1 < p.size() + (primitive.closed ? 1 : 0); ++i)
      tube(i, (i + 1) % p.size(), radius);
    // Joints of a polyline show while they stay apart from one another.
    const bool joints = !line || p.size() <= 24;
    for (std::size_t i = 0; i < p.size(); ++i) {
      const bool end = line && !primitive.closed && (i == 0 || i + 1 == p.size());
      if (joints || end)
        strokes.spheres.push_back(withRadius(placed(frame, p[i]), (line ? end ? 2.0f : 1.55f : 2.4f) * radius));
    }
  }
  return strokes;
}

}  // namespace fielddeform::render::detail
