#pragma once

#include <fielddeform/core/status.h>
#include <fielddeform/mesh/mesh.h>
#include <fielddeform/scene/methods.h>
#include <fielddeform/skeleton/skeleton.h>

#include <string>
#include <vector>

/// Every method by skeleton on the same mesh and skeletons, and the deformations that GFFD is claimed to reproduce.
namespace fielddeform::tests {

/// The vertices as a method leaves them, with its default options and no zone of influence.
/// @throw std::invalid_argument if the method cannot follow this skeleton
std::vector<Vec3> deformBy(scene::MethodKind method, const mesh::Mesh& mesh, const skeleton::Skeleton& rest,
                           const skeleton::Skeleton& posed);

/// A deformation by one of the methods that came before, and a skeleton with which GFFD is to reproduce it.
struct Claim {
  std::string name;                ///< "Barr bend 90"
  std::string skeletonName;        ///< "a line of 65 points"
  mesh::Mesh mesh;                 ///< about 2 long
  skeleton::Skeleton rest, posed;
  std::vector<Vec3> ideal;         ///< #V: by the method itself
};

/// Barr's bend (90 and 180 degrees), twist, taper, stretch; axial deformation along an S; 4 x 4 x 4 lattices of cubic Bernstein
/// polynomials: nodes bent by 60 degrees; outer nodes moved at random and the inner ones after their neighbours, by the box's shell; all nodes moved, by the shell
/// (which does not say what inner nodes do) and by planes of the box. ["GFFD can implement most deformation functions, such as Barr's method, axis
/// deformation and FFD", Qin et al. 2003]
/// @param around, along  rings of the mesh: around x along vertices
std::vector<Claim> claims(int around = 96, int along = 100);

struct Misses {
  double mean = 0, max = 0;  ///< share of the mesh's size
};
Misses missesOf(const Claim& claim, Points found);

/// A cylinder along z with a skeleton that turns one end half round: the candy wrapper.
Claim candyWrapper(bool twoBones, int around = 64, int along = 81);
/// The least distance of the cylinder's side from its axis, share of the radius: 1 is kept, 0 collapsed.
double waist(const Claim& wrapper, Points found);

}  // namespace fielddeform::tests
