#pragma once

#include <fielddeform/mesh/topology.h>

namespace fielddeform::resample::detail {

/// The faces of a mesh after some of its edges were divided.
struct SplitFaces {
  std::vector<Index> corners, offsets;
  std::vector<Index> faceParent;  ///< #F, ascending
  std::vector<Index> source;      ///< a corner: the parent's corner it stands on ...
  std::vector<bool> middle;       ///< ... or halfway from that corner to the next of the parent's face
};

/// Divides the faces at marked edges; faces without one are copied.
/// @param asFan      faces that become their fan even so, ascending
/// @param rank       #E: which new vertex an edge gets, kNoIndex if it is not divided
/// @param positions  rest positions: the mesh's vertices, then the new ones
SplitFaces splitFaces(const mesh::Mesh& mesh, const mesh::EdgeTable& table, std::span<const Index> rank,
                      std::span<const Index> asFan, Points positions);

/// The mesh with its edges divided: faces as given, attributes, lines and points carried over; no layout.
/// @param divided  the divided edges in the order of their new vertices
mesh::Mesh makeRefined(const mesh::Mesh& mesh, const mesh::EdgeTable& table, std::span<const Index> divided,
                       std::span<const Index> rank, const SplitFaces& faces, std::vector<Vec3> positions);

}  // namespace fielddeform::resample::detail
