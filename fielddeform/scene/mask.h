#pragma once

#include <fielddeform/mesh/mesh.h>
#include <fielddeform/scene/scene.h>

namespace fielddeform::scene {

/// A mask's numbers, one a vertex.
/// @throw IoError for a file that does not hold exactly one finite number a vertex;
///        std::invalid_argument if there is no such attribute, or it has no one finite number a vertex
std::vector<double> readMask(const Mask& mask, const mesh::Mesh& mesh);

/// position = rest + mask (position - rest); exactly `position` where the mask is 1, exactly `rest` where it is 0.
/// Vertices with mask 0 become Fixed with residual 0, unless they are Invalid.
/// @param mask, rest, position, status, residual  #V each; residual may be empty
void applyMask(std::span<const double> mask, Points rest, std::span<Vec3> position, std::span<Status> status,
               std::span<float> residual);

}  // namespace fielddeform::scene
