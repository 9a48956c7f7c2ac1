#pragma once

#include <fielddeform/mesh/mesh.h>
#include <fielddeform/skeleton/skeleton.h>

#include <string>
#include <vector>

/// Closed-form deformations: a generated mesh, its skeleton at rest and posed, and where every vertex ideally goes.
/// The objects are about 2 units long and lie along z.
namespace fielddeform::tests {

struct Case {
  std::string name;
  mesh::Mesh mesh;                 ///< closed, oriented outwards, triangles
  skeleton::Skeleton rest, posed;  ///< "primitive0", ... with radii; vertex order gives the correspondence
  std::vector<Vec3> ideal;         ///< #V, or empty where no ideal map is known (branch)
};

/// "bend90", "bend180", "twist4_180", "twist4_360", "twist2_180" (4 or 2 lines), "stretch2", "trans", "rottrans",
/// "branch", "cagebend90", "lodtwist180": 9602 vertices each, the branch 7374.
const std::vector<std::string>& caseNames();

/// @param t  share of the edit, in [0, 1]: a pose on the way, with its own ideal
/// @throw std::invalid_argument for an unknown name
Case makeCase(const std::string& name, double t = 1);

struct CapsuleOptions {
  double length = 2;     ///< of the cylinder, along z from -length/2 to length/2
  double radius = 0.25;  ///< of the cylinder and its two half spheres
  int around = 96;       ///< vertices a ring, >= 3
  int along = 100;       ///< rings, >= 2; one more vertex closes each end
  double bump = 0.15;    ///< share of the radius: bump sin(5 z) cos(3 phi)
  double square = 0;     ///< share of the radius: square cos(4 phi)
};

/// A capsule with bumps: closed, oriented outwards.
mesh::Mesh makeCapsule(const CapsuleOptions& options = {});

/// Points on the line from -length/2 to length/2 through (x, y, 0) along z, evenly spaced.
std::vector<Vec3> verticalLine(int count, double length, double x = 0, double y = 0);

/// Bends the part |z| <= length/2 of space to an arc of `angle` radians in the xz plane, towards +x, keeping lengths
/// on the z axis; space beyond follows rigidly.
std::vector<Vec3> bendMap(Points points, double angle, double length = 2);
/// Turns space about z by angle * z / length radians within |z| <= length/2, and rigidly beyond.
std::vector<Vec3> twistMap(Points points, double angle, double length = 2);

}  // namespace fielddeform::tests
