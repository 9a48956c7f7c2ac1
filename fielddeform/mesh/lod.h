#pragma once

#include <fielddeform/mesh/mesh.h>

#include <string>
#include <vector>

namespace fielddeform::mesh {

/// A simplified model. Its vertices stand on vertices of the object, which makes it a skeleton with correspondence: to
/// pose it, move its vertices.
struct Lod {
  Mesh mesh;                     ///< triangles, no attributes
  std::vector<Index> vertexOf;   ///< #V of `mesh`: the object's vertex at the same place
  std::size_t skippedFaces = 0;  ///< of the object: without three different vertices, or with a non-finite one
  std::size_t cutVertices = 0;   ///< extra copies of vertices made where the object is non-manifold: cut there
  std::string message;           ///< one sentence if something of the above happened or the target was missed
};

/// Collapses edges, the least quadric error first, until at most `faces` triangles are left or no collapse is legal.
/// [Garland & Heckbert 1997] A collapse may not change the topology, move a boundary vertex off the boundary, or turn a
/// face over; closed stays closed. Polygons are taken as their fan. The object's coordinates are kept bit for bit, and
/// the choice does not depend on its units or place up to powers of two.
/// @param faces  at least 1
/// @throw std::invalid_argument if faces is 0
Lod simplify(const Mesh& object, std::size_t faces);

}  // namespace fielddeform::mesh
