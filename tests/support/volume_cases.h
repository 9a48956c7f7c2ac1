#pragma once

#include <fielddeform/map/lattice.h>
#include <fielddeform/volume/preserve.h>

#include <string>

/// Hirota's examples (1999, section 5) as problems, for tests, benchmarks and samples.
namespace fielddeform::tests {

struct VolumeCase {
  std::string name;
  map::Lattice lattice;           ///< undeformed
  mesh::Mesh mesh;                ///< the finest
  volume::Problem problem;        ///< its levels, start and pinned nodes included
};

/// Torus around z: major radius 1, minor 0.4, 2 around tube triangles.
mesh::Mesh makeTorus(int around, int tube, double minor = 0.4);
/// Icosahedron split `rounds` times: 20 * 4^rounds triangles on the unit sphere.
mesh::Mesh makeIcosphere(int rounds);
/// The club: a sphere drawn out along x, one end thicker.
mesh::Mesh makeClub(int rounds);

/// Plate 1: 3x3x3; the top and bottom layers are each moved in by a share of the height and pinned. @param triangles 4^k * 16 >= 64: 4096 in the paper
VolumeCase torusCompression(int triangles = 4096, volume::Springs springs = volume::Springs::All, double share = 0.1);
/// Plate 2: 5x2x2; the two layers at either end are moved out and pinned. 65536 triangles in the paper.
VolumeCase torusStretch(int triangles = 65536, volume::Springs springs = volume::Springs::All);
/// Plate 3: 5x2x2; the two left layers are drawn in and pinned. 20 * 4^rounds triangles, 20480 for 5.
VolumeCase clubCompression(int rounds = 5, volume::Springs springs = volume::Springs::All);
/// Plate 7: 5x2x2; bent by an angle (degrees), the end layers pinned.
VolumeCase clubBent(double degrees = 170, int rounds = 5, volume::Springs springs = volume::Springs::All);
/// Plate 4 on any mesh: 5x2x2 along its longest side, bent, the end layers pinned; levels by simplification.
VolumeCase bending(const std::string& name, const mesh::Mesh& mesh, double degrees, volume::Springs springs = volume::Springs::All);

}  // namespace fielddeform::tests
