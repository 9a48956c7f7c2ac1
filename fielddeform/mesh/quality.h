#pragma once

#include <fielddeform/mesh/topology.h>

namespace fielddeform::mesh {

/// Cosines between neighbouring face normals that make a fold: from above kFoldFrom to below kFoldTo.
inline constexpr double kFoldFrom = 0.3, kFoldTo = -0.3;

/// Ratios of edge lengths, posed / rest, over edges whose rest length is not zero and whose ends are finite.
struct StretchReport {
  double max = 1, min = 1;
  double p99 = 1;              ///< the smallest ratio that at least 99 % of the edges do not exceed
  std::size_t edges = 0;       ///< edges measured
  std::size_t unmeasured = 0;  ///< of zero rest length, or non-finite
};

/// What a deformation did to a surface. Polygons are fans from their corner 0, the fan's own diagonals included.
struct QualityReport {
  /// Edges of exactly two triangles whose normals' cosine is > kFoldFrom in rest and < kFoldTo posed. Triangles that are
  /// degenerate in either state are left aside; where neighbours are turned against each other one normal is reversed.
  std::size_t folds = 0;
  std::size_t sharpRest = 0;        ///< such edges with a cosine < kFoldTo in the rest
  std::size_t sharpPosed = 0;       ///< the same, posed
  std::size_t degenerateRest = 0;   ///< triangles without area, in rest
  std::size_t collapsed = 0;        ///< triangles with area in rest and none posed
  double minAngleRest = 0;          ///< smallest angle of a triangle with area, radians; 0 if there is none
  double minAnglePosed = 0;
  StretchReport stretch;            ///< of the mesh's own edges (no fan diagonals)
};

/// @param rest, posed  #V by 3, world
/// @throw std::invalid_argument if a count differs from the mesh's vertices.
QualityReport compareQuality(const Mesh& mesh, Points rest, Points posed);
/// The same where the mesh's edges are known.
QualityReport compareQuality(const Mesh& mesh, const EdgeTable& edges, Points rest, Points posed);

/// Folds alone.
std::size_t countFolds(const Mesh& mesh, Points rest, Points posed);
std::size_t countFolds(const Mesh& mesh, const EdgeTable& edges, Points rest, Points posed);
/// Edges of exactly two triangles whose normals' cosine is below kFoldTo: the folds of one state.
std::size_t countSharpEdges(const Mesh& mesh, Points positions);
std::size_t countSharpEdges(const Mesh& mesh, const EdgeTable& edges, Points positions);
StretchReport edgeStretch(const EdgeTable& edges, Points rest, Points posed);
/// Smallest angle of all triangles with area, radians; 0 if there are none.
double smallestAngle(const Mesh& mesh, Points positions);
/// The same of some faces.
double smallestAngle(const Mesh& mesh, Points positions, std::span<const Index> faces);

/// Triangles turned against the map's own rotation: the posed normal points against the one that the map's derivative
/// gives it (the mean over the corners of cof(J) n), or the derivative reverses orientation at two or more corners.
/// @param jacobians #V, derivative of the posed by the rest position (or rotations), row = output coordinate
std::size_t countFlipped(const Mesh& mesh, Points rest, Points posed, std::span<const Mat3> jacobians);
/// The same without derivatives: the rotation is the best fit of the edges around each vertex, two rings deep.
std::size_t countFlipped(const Mesh& mesh, Points rest, Points posed);
/// @param edges  of the mesh; gone before the fits need room
std::size_t countFlipped(const Mesh& mesh, EdgeTable edges, Points rest, Points posed);

}  // namespace fielddeform::mesh
