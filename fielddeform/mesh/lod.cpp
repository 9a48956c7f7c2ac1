#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <OpenMesh/Core/Geometry/QuadricT.hh>
#include <OpenMesh/Tools/Decimater/DecimaterT.hh>
#include <fielddeform/mesh/lod.h>
#include <fielddeform/mesh/topology.h>
#include <fmt/format.h>

#include <cmath>
#include <numeric>
#include <stdexcept>

namespace fielddeform::mesh {
namespace {

struct Traits : OpenMesh::DefaultTraits {
  using Point = OpenMesh::Vec3d;
  using Normal = OpenMesh::Vec3d;
};
using HalfedgeMesh = OpenMesh::TriMesh_ArrayKernelT<Traits>;

Index find(std::vector<Index>& parent, Index i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

/// The object's triangles, without those that no halfedge structure can hold.
std::vector<Index> usableTriangles(const Mesh& object, std::size_t& skipped) {
  std::vector<Index> out;
  const auto& p = object.positions();
  for (std::size_t f = 0; f < object.faceCount(); ++f) {
    const std::size_t before = out.size();
    object.forEachTriangle(f, [&](Index a, Index b, Index c) {
      if (a != b && b != c && c != a && p[a].allFinite() && p[b].allFinite() && p[c].allFinite())
        out.insert(out.end(), {a, b, c});
    });
    skipped += out.size() == before;
  }
  return out;
}

/// For each corner the corner that stands for its vertex. Corners of a vertex are joined across edges of exactly two
/// triangles that run in opposite directions, so that non-manifold places and turned neighbours come apart.
std::vector<Index> cornerFans(const std::vector<Index>& triangles, std::size_t vertexCount) {
  const EdgeTable table(vertexCount, triangles);
  std::vector<Index> parent(triangles.size());
  std::iota(parent.begin(), parent.end(), 0u);
  const auto next = [](Index c) { return c % 3 == 2 ? c - 2 : c + 1; };
  const auto join = [&](Index a, Index b) {
    a = find(parent, a), b = find(parent, b);
    if (a != b) parent[std::max(a, b)] = std::min(a, b);
  };
  for (std::size_t e = 0; e < table.size(); ++e) {
    const auto uses = table.uses(e);
    if (uses.size() != 2 || table.isForward(uses[0]) == table.isForward(uses[1])) continue;
    join(uses[0], next(uses[1])), join(next(uses[0]), uses[1]);
  }
  for (Index c = 0; c < parent.size(); ++c) parent[c] = find(parent, c);
  return parent;
}

/// The object in a halfedge structure, centred and scaled by a power of two to about unit size.
class Builder {
 public:
  Builder(const Mesh& object, Lod& lod) : object_(object), lod_(lod) {
    const Box box = boundingBox(object.positions());
    if (box.isEmpty()) return;
    centre_ = 0.5 * box.min() + 0.5 * box.max();
    const double size = (0.5 * box.max() - 0.5 * box.min()).maxCoeff();
    if (size > 0) exponent_ = -std::ilogb(size);
  }

  HalfedgeMesh build() {
    const std::vector<Index> triangles = usableTriangles(object_, lod_.skippedFaces);
    const std::vector<Index> fan = cornerFans(triangles, object_.vertexCount());
    std::vector<OpenMesh::VertexHandle> handle(triangles.size());
    std::vector<bool> seen(object_.vertexCount(), false);
    for (std::size_t c = 0; c < triangles.size(); ++c) {
      if (fan[c] == c) {
        handle[c] = add(triangles[c]);
        lod_.cutVertices += seen[triangles[c]];
        seen[triangles[c]] = true;
      } else {
        handle[c] = handle[fan[c]];
      }
    }
    for (std::size_t c = 0; c < triangles.size(); c += 3) {
      if (fits(handle[c], handle[c + 1], handle[c + 2])) {
        mesh_.add_face(handle[c], handle[c + 1], handle[c + 2]);
      } else {  // a surface that meets itself along an edge: this triangle is left on its own
        lod_.cutVertices += 3;
        mesh_.add_face(add(triangles[c]), add(triangles[c + 1]), add(triangles[c + 2]));
      }
    }
    return std::move(mesh_);
  }

  const std::vector<Index>& origin() const { return origin_; }

 private:
  OpenMesh::VertexHandle add(Index vertex) {
    const Vec3 p = object_.positions()[vertex] - centre_;
    origin_.push_back(vertex);
    return mesh_.add_vertex({std::ldexp(p.x(), exponent_), std::ldexp(p.y(), exponent_), std::ldexp(p.z(), exponent_)});
  }
  /// Whether the three vertices are on the boundary so far and the three halfedges are free (else OpenMesh prints).
  bool fits(OpenMesh::VertexHandle a, OpenMesh::VertexHandle b, OpenMesh::VertexHandle c) {
    if (a == b || b == c || c == a) return false;
    const OpenMesh::VertexHandle v[] = {a, b, c};
    for (int k = 0; k < 3; ++k) {
      if (!mesh_.is_boundary(v[k])) return false;
      const auto h = mesh_.find_halfedge(v[k], v[(k + 1) % 3]);
      if (h.is_valid() && !mesh_.is_boundary(h)) return false;
    }
    return true;
  }

  const Mesh& object_;
  Lod& lod_;
  Vec3 centre_ = Vec3::Zero();
  int exponent_ = 0;
  HalfedgeMesh mesh_;
  std::vector<Index> origin_;
};

/// Error quadrics of the faces around each vertex. [Garland & Heckbert 1997] Unlike OpenMesh's own module it holds the
/// boundary, refuses to turn faces over without needing normals, and takes short edges first where all is flat.
template <class M>
class QuadricModule : public OpenMesh::Decimater::ModBaseT<M> {
 public:
  DECIMATING_MODULE(QuadricModule, M, HeldQuadric)
  using Point = OpenMesh::Vec3d;
  using Quadric = OpenMesh::Geometry::Quadricd;

  explicit QuadricModule(M& mesh) : Base(mesh, false) {}

  void initialize() override {
    M& mesh = Base::mesh();
    quadrics_.assign(mesh.n_vertices(), Quadric(0.0));
    for (const auto f : mesh.faces()) {
      const auto h = mesh.halfedge_handle(f);
      const Point a = at(mesh.from_vertex_handle(h));
      const Point n = (at(mesh.to_vertex_handle(h)) - a) % (at(mesh.opposite_vh(h)) - a);
      for (const auto v : mesh.fv_range(f)) addPlane(v, n, a, 0.5 * n.norm());
    }
    // A plane through each boundary edge at right angles to its face, else the rim of a flat surface would shrink at no
    // cost. [section 6]
    for (const auto h : mesh.halfedges()) {
      if (!mesh.is_boundary(h) || mesh.is_boundary(mesh.opposite_halfedge_handle(h))) continue;
      const auto from = mesh.from_vertex_handle(h), to = mesh.to_vertex_handle(h);
      const Point a = at(from), edge = at(to) - a;
      const Point n = edge % (edge % (at(mesh.opposite_vh(mesh.opposite_halfedge_handle(h))) - a));
      for (const auto v : {from, to}) addPlane(v, n, a, kBoundaryWeight * edge.sqrnorm());
    }
  }

  float collapse_priority(const CollapseInfo& c) override {
    if (turnsFaceOver(c)) return static_cast<float>(Base::ILLEGAL_COLLAPSE);
    Quadric q = quadrics_[index(c.v0)];
    q += quadrics_[index(c.v1)];
    return static_cast<float>(std::max(0.0, q(c.p1)) + kShortEdges * (c.p1 - c.p0).sqrnorm());
  }

  void postprocess_collapse(const CollapseInfo& c) override { quadrics_[index(c.v1)] += quadrics_[index(c.v0)]; }

 private:
  static constexpr double kBoundaryWeight = 10;  ///< against the faces' area weights
  static constexpr double kShortEdges = 1e-9;    ///< of an object of unit size: far below any visible error

  static std::size_t index(OpenMesh::VertexHandle v) { return static_cast<std::size_t>(v.idx()); }
  const Point& at(OpenMesh::VertexHandle v) { return Base::mesh().point(v); }

  void addPlane(OpenMesh::VertexHandle v, Point n, const Point& a, double weight) {
    const double length = n.norm();
    if (!(length > 0)) return;
    n /= length;
    Quadric q(n[0], n[1], n[2], -(n | a));
    q *= weight;
    quadrics_[index(v)] += q;
  }

  /// Whether a face around v0 that stays would turn by a right angle or more, or lose its area.
  bool turnsFaceOver(const CollapseInfo& c) {
    const M& mesh = Base::mesh();
    for (const auto h : mesh.voh_range(c.v0)) {
      if (mesh.is_boundary(h)) continue;
      const auto a = mesh.to_vertex_handle(h), b = mesh.opposite_vh(h);
      if (a == c.v1 || b == c.v1) continue;
      const Point &p = at(a), &q = at(b);
      const Point before = (p - c.p0) % (q - c.p0), after = (p - c.p1) % (q - c.p1);
      if ((before | after) <= 0 && before.sqrnorm() > 0) return true;
    }
    return false;
  }

  std::vector<Quadric> quadrics_;
};

void decimate(HalfedgeMesh& mesh, std::size_t faces) {
  OpenMesh::Decimater::DecimaterT<HalfedgeMesh> decimater(mesh);
  OpenMesh::Decimater::ModHandleT<QuadricModule<HalfedgeMesh>> quadric;
  decimater.add(quadric);
  if (decimater.initialize()) decimater.decimate_to_faces(0, faces);
}

/// The faces that are left, with the vertices that they use, in the object's order.
void extract(const Mesh& object, const HalfedgeMesh& mesh, const std::vector<Index>& origin, Lod& lod) {
  std::vector<Index> place(mesh.n_vertices(), kNoIndex), corners;
  const auto each = [&](auto&& call) {
    for (const auto f : mesh.all_faces())
      if (!mesh.status(f).deleted())
        for (const auto v : mesh.fv_range(f)) call(static_cast<std::size_t>(v.idx()));
  };
  each([&](std::size_t v) { place[v] = 0; });
  std::vector<Vec3> positions;
  for (std::size_t v = 0; v < place.size(); ++v) {
    if (place[v] == kNoIndex) continue;
    place[v] = static_cast<Index>(positions.size());
    positions.push_back(object.positions()[origin[v]]);
    lod.vertexOf.push_back(origin[v]);
  }
  each([&](std::size_t v) { corners.push_back(place[v]); });
  lod.mesh = Mesh(std::move(positions), std::move(corners));
  lod.mesh.setPositionType(object.positionType());
}

std::string describe(const Lod& lod, std::size_t faces) {
  std::string message;
  const auto say = [&](const std::string& part) { message += (message.empty() ? "" : "; ") + part; };
  if (lod.skippedFaces) say(fmt::format("{} degenerate or non-finite faces left out", lod.skippedFaces));
  if (lod.cutVertices) say(fmt::format("cut at {} non-manifold places", lod.cutVertices));
  if (lod.mesh.faceCount() > faces)
    say(fmt::format("{} faces left, {} asked for: no other edge can collapse", lod.mesh.faceCount(), faces));
  return message;
}

}  // namespace

Lod simplify(const Mesh& object, std::size_t faces) {
  if (faces == 0) throw std::invalid_argument("faces is 0, expected at least 1");
  Lod lod;
  Builder builder(object, lod);
  HalfedgeMesh mesh = builder.build();
  mesh.request_vertex_status(), mesh.request_edge_status(), mesh.request_face_status(), mesh.request_halfedge_status();
  if (mesh.n_faces() > faces) decimate(mesh, faces);
  extract(object, mesh, builder.origin(), lod);
  lod.message = describe(lod, faces);
  return lod;
}

}  // namespace fielddeform::mesh
