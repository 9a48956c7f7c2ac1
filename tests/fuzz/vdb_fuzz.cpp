#include <fielddeform/core/error.h>
#include <fielddeform/field/vdb.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>

/// What must hold for any bytes that the reader of volumes is given: an IoError, or a surface of numbers whose triangles
/// have vertices, within the memory.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fielddeform;
  field::VdbReadOptions options;
  options.maxMegabytes = 30;
  try {
    const mesh::Mesh surface = field::parseVdbSurface({reinterpret_cast<const char*>(data), size}, "input.vdb", options);
    for (const Vec3& p : surface.positions())
      if (!p.allFinite()) std::fprintf(stderr, "violated: positions are numbers\n"), std::abort();
    for (const Index c : surface.corners())
      if (c >= surface.vertexCount()) std::fprintf(stderr, "violated: corners are vertices\n"), std::abort();
  } catch (const IoError&) {
  }
  return 0;
}
