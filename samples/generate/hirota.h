#pragma once

#include <fielddeform/mesh/mesh.h>

namespace fielddeform::samples {

/// The shapes of Hirota et al. 1999, all closed and oriented outwards.

/// A torus about y, ring radius 1, tube radius 0.4: 4 * level by 2 * level quads (level 16: 4096 triangles).
mesh::Mesh torus(int level);

/// An Indian club along y, 4 long: a thin handle with a knob, a thick end. Quads.
/// @param around  vertices of a section
mesh::Mesh club(int around);

/// A standing cow-like animal facing +x, y up, about 2.4 long, without details. About 6000 triangles for fineness 1.
mesh::Mesh quadruped(double fineness = 1);

/// A pitcher of bicubic Bezier patches, y up, 3 high: a pot with a wall, a lip and a handle, which is a closed piece of its
/// own that stands in the wall. Quads.
/// @param level  quads along a patch's side
mesh::Mesh pitcher(int level);

}  // namespace fielddeform::samples
