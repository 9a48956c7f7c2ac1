#pragma once

#include <fielddeform/mesh/mesh.h>

#include <array>
#include <span>
#include <vector>

namespace fielddeform::mesh {

/// The undirected edges of a polygon mesh and the corners that use them, non-manifold ones included.
/// A corner's edge leads from its vertex to the next corner's vertex of the same face. Faces of fewer than three corners
/// and edges from a vertex to itself have none. Edges are sorted by (lower, higher) vertex, uses by corner: the table
/// depends on the mesh alone. About 30 bytes an edge; building takes 46.
class EdgeTable {
 public:
  EdgeTable() = default;  ///< without edges
  explicit EdgeTable(const Mesh& mesh);
  /// @param corners  vertex indices, each less than vertexCount
  /// @param offsets  #F+1 as in Mesh, or empty if all faces are triangles
  EdgeTable(std::size_t vertexCount, std::span<const Index> corners, std::span<const Index> offsets = {});

  std::size_t size() const noexcept { return vertices_.size(); }
  /// The edge's vertices, the lower index first.
  const std::array<Index, 2>& vertices(std::size_t e) const noexcept { return vertices_[e]; }
  /// The corners that use the edge, ascending.
  std::span<const Index> uses(std::size_t e) const noexcept {
    return {uses_.data() + firstUse_[e], firstUse_[e + 1] - firstUse_[e]};
  }
  /// The edge that starts at this corner, or kNoIndex.
  Index ofCorner(std::size_t corner) const noexcept { return cornerEdge_[corner]; }
  /// Whether the corner's edge leads from the lower to the higher vertex.
  bool isForward(std::size_t corner) const noexcept { return forward_[corner]; }
  /// The face that owns a corner.
  Index faceOf(std::size_t corner) const noexcept {
    return cornerFace_.empty() ? static_cast<Index>(corner / 3) : cornerFace_[corner];
  }
  /// The edge between two vertices, or kNoIndex.
  Index find(Index a, Index b) const noexcept;
  std::size_t cornerCount() const noexcept { return cornerEdge_.size(); }

 private:
  std::vector<std::array<Index, 2>> vertices_;
  std::vector<Index> firstUse_, uses_, cornerEdge_, cornerFace_, firstEdge_;
  std::vector<bool> forward_;
};

/// How the edges are used. Every edge is in at least one of: boundary, interior (two uses), non-manifold (more).
struct EdgeCounts {
  std::size_t edges = 0;
  std::size_t boundary = 0;      ///< used once
  std::size_t nonManifold = 0;   ///< used more than twice
  std::size_t open = 0;          ///< used an odd number of times: boundary edges and odd non-manifold ones
  std::size_t inconsistent = 0;  ///< forward and backward uses differ by 2 or more: neighbours turned against each other

  bool closed() const noexcept { return edges > 0 && open == 0; }
  bool oriented() const noexcept { return inconsistent == 0; }
};
EdgeCounts countEdges(const EdgeTable& table);

/// The edges with an odd number of uses, as simple loops of vertices (no vertex twice in one loop). Such edges always
/// form loops, on non-manifold and inconsistently oriented meshes too. Loops start at their smallest edge.
std::vector<std::vector<Index>> boundaryLoops(const EdgeTable& table);

/// Faces joined by shared edges. Components are numbered by their smallest face.
struct Components {
  std::vector<Index> ofFace;      ///< #F; kNoIndex for a face without edges
  std::vector<EdgeCounts> edges;  ///< one a component
  std::size_t count() const noexcept { return edges.size(); }
};
Components components(const EdgeTable& table, std::size_t faceCount);

/// Vertices whose corners fall into more than one group when corners are joined across shared edges (two fans that
/// touch in a point). Ascending.
std::vector<Index> nonManifoldVertices(const Mesh& mesh, const EdgeTable& table);

/// Vertices that no face, line or point element uses. Ascending.
std::vector<Index> isolatedVertices(const Mesh& mesh);

/// Faces with the same vertices, in any order, as an earlier face. Ascending.
std::vector<Index> duplicateFaces(const Mesh& mesh);

/// Vertices at exactly the coordinates of an earlier one (non-finite ones aside). Ascending.
std::vector<Index> duplicatePoints(Points positions);

/// Faces of fewer than three different vertices, or whose fan has no area: 2 * area <= 1e-12 * (longest side)^2 for
/// each of its triangles. Faces with a non-finite vertex are not among them. Ascending.
std::vector<Index> degenerateFaces(const Mesh& mesh, Points positions);

}  // namespace fielddeform::mesh
