#pragma once

#include <fielddeform/mesh/topology.h>

#include <optional>
#include <string>

namespace fielddeform::mesh {

/// A number that may not exist, and then the reason in words.
struct MaybeVolume {
  std::optional<double> value;  ///< cubic model units; positive if faces are counter-clockwise seen from outside
  std::string reason;           ///< empty if there is a value
};

/// Integrals over a surface. A polygon is the fan from its corner 0. Faces with a non-finite vertex are left out.
struct SurfaceMoments {
  double area = 0;
  Vec3 centroid = Vec3::Zero();    ///< of the area; of the finite vertices, equally weighted, if there is no area
  Mat3 covariance = Mat3::Zero();  ///< mean of (x - centroid)(x - centroid)^T over the area, or over the vertices
};

/// Sums are centred on the bounding box first, taken in chunks of faces in a fixed order, and scaled to the object:
/// the same bits on any number of threads, and scaled exactly when the input is scaled by a power of two.
/// @param positions #V by 3, world: the mesh's own, or those of a deformed copy
/// @throw std::invalid_argument if the count differs from the mesh's vertices.
SurfaceMoments surfaceMoments(const Mesh& mesh, Points positions);
double area(const Mesh& mesh, Points positions);

/// Volume by the divergence theorem: the sum of a . (b x c) / 6 over the triangles. It exists if the surface is closed
/// and consistently oriented, that is if every edge is used as often in one direction as in the other, and if all
/// faces are finite; else the reason names the number of edges at fault.
MaybeVolume volume(const Mesh& mesh, Points positions, const EdgeCounts& edges);
MaybeVolume volume(const Mesh& mesh, Points positions);

/// The sum itself, whether it means something or not.
double signedVolumeSum(const Mesh& mesh, Points positions);

/// Positions as the mesh's file holds them: rounded to float if Mesh::positionType() is Float32.
std::vector<Vec3> asWritten(const Mesh& mesh, Points positions);
/// Volume of the surface as its file holds it, without a copy of the positions.
MaybeVolume volumeAsWritten(const Mesh& mesh, Points positions, const EdgeCounts& edges);

/// Area and volume of one component, as in topology.h.
struct ComponentMeasures {
  std::size_t faces = 0;
  EdgeCounts edges;
  double area = 0;
  MaybeVolume volume;
};
std::vector<ComponentMeasures> componentMeasures(const Mesh& mesh, Points positions, const Components& components);

}  // namespace fielddeform::mesh
