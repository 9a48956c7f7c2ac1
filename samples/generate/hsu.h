#pragma once

#include <fielddeform/mesh/mesh.h>

/// Shapes for the figures of Hsu, Hughes & Kaufman 1992. All closed, y up.
namespace fielddeform::samples {

/// A block of 2 x 0.8 x 2 about the origin, its faces divided into squares.
/// @param side  squares along a long edge, even
mesh::Mesh block(int side);
/// The same as the unit cube, its corner at the origin.
mesh::Mesh unitCube(int side);
mesh::Mesh ball(const Vec3& centre, double radius, int around);
/// A sphere of radius 0.8, 2.4 high.
mesh::Mesh egg(int around);
/// A finger ring about the z axis with six straight prongs on top, and the cut stone that they are to hold.
mesh::Mesh prongRing();
mesh::Mesh stone();

}  // namespace fielddeform::samples
