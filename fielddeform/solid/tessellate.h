#pragma once

#include <fielddeform/mesh/mesh.h>
#include <fielddeform/solid/object.h>

namespace fielddeform::solid {

/// The surface of an object: the sides of its solids that no joint covers, each as segments by segments quads, outward where the size is
/// positive. Without cracks: vertices on edges and corners that sides share are made once, from the shared control points alone.
/// Edges whose control points all coincide are single vertices; faces shrink to triangles there.
/// @param segments  along every edge, 1 .. 1024
/// @throw std::invalid_argument
mesh::Mesh tessellate(const Object& object, int segments);

/// Points inside the solids: (samples + 1)^3 of each, u running fastest, with solid and (u, v, w) as vertex attributes. No faces.
mesh::Mesh sampleInside(const Object& object, int samples);

}  // namespace fielddeform::solid
