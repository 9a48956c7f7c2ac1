#include <fielddeform/core/error.h>
#include <fielddeform/skeleton/io.h>

#include <cstddef>
#include <cstdint>

#include "require.h"

/// What must hold for any bytes that the skeleton reader is given: an IoError, or a valid skeleton whose file reads back
/// as it was written.
namespace fielddeform::skeleton {
namespace {

void check(std::string text) {
  Skeleton skeleton;
  try {
    skeleton = parseSkeleton(std::move(text), "input");
  } catch (const IoError&) {
    return;
  }
  validate(skeleton);
  const std::string json = formatSkeleton(skeleton, FileFormat::Json);
  const Skeleton back = parseSkeleton(json, "json");
  require(back.primitives.size() == skeleton.primitives.size(), "as many primitives come back");
  for (std::size_t i = 0; i < back.primitives.size(); ++i) {
    require(back.primitives[i].points == skeleton.primitives[i].points, "the same points come back");
    require(back.primitives[i].faces == skeleton.primitives[i].faces, "the same faces come back");
  }
  require(formatSkeleton(back, FileFormat::Json) == json, "writing again gives the same bytes");
  // Names may clash once they are written as OBJ objects; what is read must be valid.
  try {
    validate(parseSkeleton(formatSkeleton(skeleton, FileFormat::Obj), "obj"));
  } catch (const IoError&) {
  }
}

}  // namespace
}  // namespace fielddeform::skeleton

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fielddeform::skeleton::check(std::string(reinterpret_cast<const char*>(data), size));
  return 0;
}
