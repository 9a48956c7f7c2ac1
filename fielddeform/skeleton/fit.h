#pragma once

#include <fielddeform/mesh/mesh.h>
#include <fielddeform/skeleton/skeleton.h>

/// Skeletons made from a mesh. Deterministic; scaled exactly when the mesh is scaled by a power of two. Vertices that are
/// not finite, and faces that use them, are left out. Works for open, flat, several and point-only meshes.
namespace fielddeform::skeleton {

/// Influence radius of a skeleton that we made ourselves: this times the greatest distance from a vertex to it.
inline constexpr double kFitRadiusFactor = 1.25;

enum class SpineShape : std::uint8_t {
  Curved,   ///< through the centroids of slices across the axis
  Straight  ///< along the axis, through the object's centroid
};

struct SpineFitOptions {
  std::size_t points = 33;          ///< evenly spaced along the axis, 2 to 1000
  SpineShape shape = SpineShape::Curved;
  std::optional<Vec3> axis{};         ///< direction, any length > 0; absent: the rule of "auto"
  double smoothing = 0.15;          ///< width (standard deviation) over which slices are averaged, in lengths, 0 to 0.5
  std::string name = "spine";
};

struct SpineFit {
  Skeleton skeleton;                ///< one open polyline with a radius
  Vec3 axis;                        ///< unit; the points' coordinates along it increase evenly
  Vec3 about;                       ///< the default axis of a bend (principal_axes.h), unit, across `axis`
  Vec3 centroid;                    ///< of the surface, or of the vertices if there is no area
};

/// A polyline along an object, from one end of its extent to the other.
/// @throw std::invalid_argument for options out of range, and if the finite vertices are none or have no extent along the axis
SpineFit fitSpine(const mesh::Mesh& mesh, const SpineFitOptions& options = {});

struct PointFitOptions {
  std::size_t points = 64;          ///< at least 1
  std::uint64_t seed = 0;
  std::string name = "points";
};

/// Points spread evenly over the surface (over the vertices, if there is no area): each is the farthest from those
/// before it, of 32 times as many candidates drawn by area. [Gonzalez 1985] Fewer points if there are fewer places.
/// @throw std::invalid_argument for options out of range, and if there is no finite vertex
Skeleton fitPoints(const mesh::Mesh& mesh, const PointFitOptions& options = {});

struct LodFitOptions {
  std::size_t faces = 500;          ///< of the simplified model at most, where its topology allows; at least 1
  std::string name = "lod";
};

struct LodFit {
  Skeleton skeleton;                ///< one mesh with a radius
  std::string message;              ///< one sentence if there are more faces than wanted, else empty
};

/// The object's own simplified model as one mesh primitive. [Qin et al. 2003, Fig. 11]
/// Its points stand on vertices of the object and correspond by index, whatever pose they are moved to; closed if it
/// bounds a solid. Its radius reaches over three of its edges, so that neighbours blend.
/// @throw std::invalid_argument for options out of range, and if the mesh has no face of three different finite vertices
LodFit fitLod(const mesh::Mesh& mesh, const LodFitOptions& options = {});

/// The greatest distance from a finite vertex to a skeleton's points, lines and surfaces; 0 without finite vertices.
double greatestDistance(Points vertices, const Skeleton& skeleton);

/// Gives primitives without radius `factor` times the greatest distance (a hundredth of the object's size if that is 0).
/// @return the radius
double fillAutomaticRadius(Skeleton& skeleton, Points vertices, double factor);

}  // namespace fielddeform::skeleton
