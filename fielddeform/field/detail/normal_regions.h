#pragma once

#include <fielddeform/field/detail/blocks.h>
#include <fielddeform/field/detail/primitive_distance.h>

#include <array>
#include <optional>
#include <vector>

/// Where the parts of a triangle mesh can be the nearest: q can only be the mesh's nearest point to p if p - q is normal to the mesh
/// at q. So a face counts in the column over it, an edge in the wedge between its faces' normals, a vertex in the cone that
/// its edges leave [Mauch 2000, "A fast algorithm for computing the closest point and distance transform"]. A fine mesh's regions
/// hold each point about once. Open and non-manifold edges have wider wedges.
namespace fielddeform::field::detail {

enum class Part : std::uint8_t { Face, Edge, Vertex };

/// A part's region, or a piece of it, as a pencil of directions that go along an axis: q + t (w, sign), w in a rectangle.
struct Region {
  Index part;                ///< which face, edge or vertex
  Part kind;
  std::uint8_t axis = 0;     ///< 3: every direction, and no pencil
  std::int8_t sign = 1;      ///< along the axis
  float low[2] = {0, 0}, high[2] = {0, 0};  ///< of w, along the axes after `axis`
  float length = 0;          ///< greatest t, voxels
};

/// The condition g . p <= most on points of a region, voxel units.
struct HalfSpace {
  Vec3 g;
  double most;
};

class NormalRegions {
 public:
  /// @param reach  voxels. Nothing if scanning would take more than so many steps
  static std::optional<NormalRegions> of(const PrimitiveDistance& mesh, const Lattice& lattice, double reach, double mostSteps);

  const std::vector<Region>& regions() const noexcept { return regions_; }
  std::span<const Vec3> corners(const Region& r, std::array<Vec3, 3>& out) const;  ///< of the part, voxel units
  std::span<const Index> elements(const Region& r) const;                          ///< that have the part
  void conditions(const Region& r, std::vector<HalfSpace>& out) const;             ///< what points of the region hold to
  /// The lattice points that the region may hold, as a box; voxel units.
  Box boxOf(const Region& r) const;
  double margin() const noexcept { return margin_; }                               ///< rounding, voxels

 private:
  struct Edge {
    Index a, b, begin, end;  // vertices; its faces, in edgeFaces_
  };
  NormalRegions(const PrimitiveDistance& mesh, const Lattice& lattice, double reach);
  void findFaces();
  void findEdges();
  void findVertices();
  void add(const Region& r);
  void addFace(Index f);
  void addEdge(Index e);
  void addVertex(Index v);
  void addVertexSide(Index v, const Vec3& normal);
  Vec3 inward(const Edge& e, Index face) const;

  const std::vector<std::array<Index, 3>>& faces_;
  std::vector<Vec3> points_;                       // voxel units
  double reach_, margin_ = 0, steps_ = 0;
  std::vector<Vec3> normal_;                       // unit, by face; zero: thin, says nothing
  std::vector<Edge> edges_;
  std::vector<Index> edgeFaces_;
  std::vector<Index> vertexBegin_, vertexFaces_;
  std::vector<char> vertexOpen_;                   // at the end of an edge of one face
  std::vector<Index> self_;                        // 0, 1, 2 ...: a face as a list
  std::vector<Region> regions_;
};

}  // namespace fielddeform::field::detail
