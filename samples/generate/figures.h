#pragma once

#include <fielddeform/mesh/mesh.h>

namespace fielddeform::samples {

/// A standing otter that holds a shell, about 190 units (millimetres) tall, y up, facing +z: like a scan of a figurine,
/// closed, with fur-like detail, in single precision, with a colour ("color", uchar rgb) on each of its more than 100
/// 000 vertices.
/// @param fineness  1 gives 143 000 vertices, other values in proportion to its square
mesh::Mesh otter(double fineness = 1);

/// A sitting rabbit of soft balls, 2 units tall, y up, facing +z: closed.
/// @param fineness  1 gives 10 000 vertices, other values in proportion to its square
mesh::Mesh bunny(double fineness = 1);

}  // namespace fielddeform::samples
