#pragma once

#include <fielddeform/mesh/topology.h>
#include <fielddeform/resample/options.h>

#include <array>
#include <string>
#include <string_view>
#include <vector>

namespace fielddeform::resample {

enum class StopReason : std::uint8_t {
  Done,         ///< no edge is too coarse
  MaxRounds,
  MaxVertices,
};
/// "done", "max_rounds", "max_vertices"
std::string_view toString(StopReason reason) noexcept;

struct Report {
  StopReason reason = StopReason::Done;
  std::string message;              ///< one sentence if a limit was hit or points were refused; else empty
  int rounds = 0;                   ///< rounds that inserted something
  std::size_t insertedVertices = 0;
  std::size_t insertedFaces = 0;    ///< faces of the result minus faces of the input
  std::size_t remaining = 0;        ///< edges still too coarse when a limit was hit
  std::size_t refused = 0;          ///< edges not split because the map gave no finite image of their midpoint
  double stretchMax = 0;            ///< deformed / reference length over all edges of the result
  double stretchP99 = 0;            ///< the smallest ratio that at least 99 % of them do not exceed
  double deviationMax = 0;          ///< of the midpoints examined and not inserted, world units; 0 by Stretch alone
  double minAngleBefore = 0;        ///< smallest angle of the input's triangles, radians, at rest
  double minAngleAfter = 0;         ///< of the result's, at rest
  double minNewAngle = 0;           ///< of the triangles that replaced a face, at rest; 0 if there are none
  double minNewAnglePosed = 0;      ///< the same, deformed
};

/// A finer mesh and its image. The input's vertices come first and keep their index, rest position and, unless the mesh
/// step moves them, their image.
struct Refined {
  mesh::Mesh rest;                           ///< with all attributes, groups and materials
  std::vector<Vec3> posed;                   ///< #V
  std::vector<Status> status;                ///< #V; counts add up to #V
  std::vector<float> residual;               ///< #V, world units
  std::vector<Vec3> safe;                    ///< #V, predicted positions
  std::vector<std::array<Index, 2>> parents; ///< for each inserted vertex the ends of the edge it divides, lower first
  std::vector<Index> faceParent;             ///< #F, the input's face it is part of, ascending
  mesh::EdgeTable edges;                     ///< of `rest`
  std::optional<mesh::Mesh> input;           ///< the mesh as it was given, if anything was inserted
  Report report;
};

/// What the caller knows of the mesh already.
struct Start {
  std::vector<Vec3> position = {}, safe = {};  ///< the images of its vertices, #V each; all four empty: not known
  std::vector<Status> status = {};
  std::vector<float> residual = {};
  std::optional<mesh::EdgeTable> edges = {};   ///< its edges
};

/// Divides the edges of a mesh until its image under a map is fine enough.
///
/// Each edge has a reference length: its rest length; the halves of a divided edge inherit the whole's, an edge new
/// inside a face takes the larger of its rest length and the mean reference of that face. A round marks the edges that
/// are too coarse, among those with a vertex that moved; divides them at the rest midpoint; divides their faces
/// (triangles by the templates for one, two or three marked edges, the shorter rest diagonal, ties by index; convex
/// quads likewise; other polygons as their fan); and maps the new points. Faces without a marked edge stay, except that
/// a polygon becomes its fan if a diagonal deviates too much. It ends when no edge is marked, or at a limit.
/// What is marked follows from the surface alone, not from the order of faces, corners or threads.
/// Every use of an edge is divided alike, so that closed stays closed and non-manifold edges stay joined. Attributes are
/// interpolated by their onSplit rule, along the face at corners (a seam stays a seam); faces inherit.
/// Edges shorter than the tolerance at rest and deformed are not tested for deviation.
///
/// The map must not depend on the mesh. Where it gives no finite image, a vertex takes its safe or rest position
/// (Stalled), and an edge stays undivided (refused).
/// @throw std::invalid_argument for options out of range; Cancelled
Refined refine(mesh::Mesh rest, const map::SpaceMap& map, const Options& options, Progress& progress);

/// The same from what is known. Images save binding the mesh again, but for maps whose midpoints inherit values
/// (SpaceMap::midpointsInherit): those need the binding, and compute it.
/// @throw std::invalid_argument also if a count differs from the mesh's vertices, or that of the edges' corners from its corners
Refined refine(mesh::Mesh rest, const map::SpaceMap& map, Start start, const Options& options, Progress& progress);

}  // namespace fielddeform::resample
