#pragma once

#include <fielddeform/mesh/topology.h>

namespace fielddeform::resample::detail {

/// Edges to divide for the shape of their faces. An edge that stays straight is never too coarse, however often the
/// other sides of its faces are divided; its faces would become thinner with every round.
/// A face that replaced one of the input is thin if the smallest angle of its fan is below minAngle and below half of that
/// of the input's face, at rest and deformed. Its longest rest sides (within 10 % of the longest for polygons, so that
/// strips of quads stay strips of quads; one for triangles, ties by index) are returned, ascending.
/// @param input     the mesh before any division
/// @param parentOf  #F, the input's face
std::vector<Index> sidesOfThinFaces(const mesh::Mesh& input, const mesh::Mesh& mesh, const mesh::EdgeTable& table,
                                    Points posed, std::span<const Index> parentOf, double minAngle);

/// Faces that share their parent with another: those that replaced a face. Ascending.
std::vector<Index> replacedFaces(std::span<const Index> parentOf);

}  // namespace fielddeform::resample::detail
