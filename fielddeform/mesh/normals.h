#pragma once

#include <fielddeform/mesh/mesh.h>

#include <vector>

namespace fielddeform::mesh {

enum class NormalUpdate : std::uint8_t {
  Turn,       ///< each normal follows its surface and keeps its relation to the geometric normal
  Recompute,  ///< each normal becomes the geometric one
};

/// Counts of normals: kept + turned make up the values that some vertex, corner or face uses.
struct NormalReport {
  std::size_t kept = 0;    ///< the surface around them did not move: their bits are kept
  std::size_t turned = 0;  ///< turned, or recomputed
  std::size_t added = 0;   ///< values added where corners that shared one now differ
};

/// Updates every attribute named "normal" of three floating-point channels, on vertices, corners or faces, after a
/// deformation. A normal belongs to the faces that use it: all faces of a vertex for a vertex's normal; for corners, the
/// faces whose corners at one vertex share the value; the face itself for a face's normal. The rotation of those faces
/// takes their geometric normal at rest to the posed one and turns about it by the best fit of the faces' edges.
/// Each normal keeps its length. Normals whose faces did not move at all keep their bits; so do those of length zero or
/// not finite, and those whose faces have no area.
/// An indexed value shared by corners that turn differently is split: new values follow the old ones; values that agree
/// to 1e-6 stay shared.
/// @param mesh   connectivity and the attributes to update
/// @param rest   #V by 3, world, the positions that the normals belong to
/// @param posed  #V by 3, world
/// @throw std::invalid_argument if a count differs from the mesh's vertices.
NormalReport updateNormals(Mesh& mesh, Points rest, Points posed, NormalUpdate update = NormalUpdate::Turn);

/// Geometric unit normals at the vertices; zero where there is no area. Each corner weighs in with the cross product of
/// its two sides over their squared lengths, which is exact on a sphere and does not depend on how a flat face is
/// divided. [Max 1999, "Weights for computing vertex normals from facet normals"]
std::vector<Vec3> vertexNormals(const Mesh& mesh, Points positions);

}  // namespace fielddeform::mesh
