#include "mesh_fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return fielddeform::mesh::fuzzMesh(data, size, "input.off");
}
