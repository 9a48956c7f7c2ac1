#include <fielddeform/core/error.h>
#include <fielddeform/field/vdb.h>

#include <cstddef>
#include <cstdint>

#include "require.h"

/// What must hold for any bytes that the reader of volumes is given: an IoError, or a surface of numbers whose triangles
/// have vertices, within the memory.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fielddeform;
  field::VdbReadOptions options;
  options.maxMegabytes = 30;
  try {
    const mesh::Mesh surface = field::parseVdbSurface({reinterpret_cast<const char*>(data), size}, "input.vdb", options);
    for (const Vec3& p : surface.positions()) require(p.allFinite(), "positions are numbers");
    for (const Index c : surface.corners()) require(c < surface.vertexCount(), "corners are vertices");
  } catch (const IoError&) {
  }
  return 0;
}
