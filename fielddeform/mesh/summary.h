#pragma once

#include <fielddeform/mesh/measures.h>
#include <fielddeform/mesh/quality.h>

#include <string>
#include <vector>

namespace fielddeform::mesh {

struct AttributeSummary {
  std::string name;
  Element on = Element::Vertex;
  ScalarType type = ScalarType::Float32;
  int width = 1;
  std::size_t values = 0;
  bool indexed = false;  ///< corners name their value (seams possible)
  bool list = false;     ///< several values an element
};

/// Counts of what is unusual. Nothing of it keeps a mesh from being deformed.
struct DefectCounts {
  std::size_t invalidPoints = 0;       ///< vertices with a non-finite coordinate
  std::size_t duplicatePoints = 0;     ///< at exactly an earlier vertex's place
  std::size_t isolatedVertices = 0;    ///< used by no face, line or point
  std::size_t degenerateFaces = 0;     ///< fewer than three different vertices, or no area
  std::size_t duplicateFaces = 0;      ///< the same vertices as an earlier face
  std::size_t nonManifoldEdges = 0;    ///< used more than twice
  std::size_t nonManifoldVertices = 0; ///< fans that touch in a point
  std::size_t inconsistentEdges = 0;   ///< neighbours turned against each other
};

/// All that can be said about one mesh; definitions in topology.h, measures.h and quality.h.
struct Summary {
  std::size_t vertices = 0, faces = 0, corners = 0, edges = 0;
  std::size_t triangles = 0, quads = 0, polygons = 0;  ///< faces of 3, of 4, of more corners
  std::size_t lines = 0, loosePoints = 0;
  Box bounds;                          ///< of the finite vertices; empty if there are none
  double size = 0;                     ///< the box's diagonal
  bool closed = false;                 ///< has faces, and no edge is used an odd number of times
  bool oriented = false;               ///< no neighbours turned against each other
  bool manifold = false;               ///< no edge used more than twice, no fans that touch in a point
  std::size_t boundaryEdges = 0;
  std::size_t boundaryLoops = 0;
  std::vector<ComponentMeasures> components;  ///< parts joined by shared edges, by their smallest face
  SurfaceMoments moments;              ///< area, centroid, covariance
  MaybeVolume volume;
  MaybeVolume volumeAsWritten;         ///< of the coordinates as the file's type holds them
  double minAngle = 0;                 ///< of all triangles with area, radians
  std::size_t sharpEdges = 0;          ///< neighbours folded onto each other (normals' cosine < kFoldTo)
  double medianEdge = 0;               ///< length of the middle edge, model units
  ScalarType positionType = ScalarType::Float64;
  std::vector<AttributeSummary> attributes;
  DefectCounts defects;
};

Summary summarize(const Mesh& mesh);

}  // namespace fielddeform::mesh
