// Calls something of every layer that is installed, so that a missing header or symbol is noticed.
#include <fielddeform/core/parallel.h>
#include <fielddeform/core/version.h>
#include <fielddeform/mesh/mesh.h>

#include <cstdio>

int main() {
  const fielddeform::mesh::Mesh triangle({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2});
  std::printf("fielddeform %s: %zu vertices, %d threads\n", fielddeform::kVersion, triangle.vertexCount(),
              fielddeform::threadCount());
  return triangle.faceCount() == 1 ? 0 : 1;
}
