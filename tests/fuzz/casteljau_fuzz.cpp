#include <fielddeform/core/error.h>
#include <fielddeform/map/casteljau_io.h>

#include <cstddef>
#include <cstdint>
#include <stdexcept>

#include "require.h"

/// What must hold for any bytes that the reader of curves is given: an IoError, or a valid curve whose file reads back as it was
/// written, and that deforms points to numbers.
namespace fielddeform::map {
namespace {

void check(std::string text) {
  CasteljauFile file;
  try {
    file = parseCasteljau(std::move(text), "input");
  } catch (const IoError&) {
    return;
  }
  file.curve.validate();
  const std::string json = formatCasteljau(file);
  require(formatCasteljau(parseCasteljau(json, "json")) == json, "writing again gives the same bytes");
  LatticeBox frame;
  if (const auto* box = std::get_if<LatticeBox>(&file.frame)) frame = *box;
  try {
    const CasteljauMap map(file.curve, frame, file.outside);
    const CasteljauMap itself(file.curve, file.curve, file.outside);
    for (const Vec3& u : {Vec3(0.3, 0.5, 0.7), Vec3(0, 1, 0.999), Vec3(-2, 0.5, 3)}) {
      const Vec3 x = frame.origin + frame.axes * u;
      if (!x.allFinite()) continue;
      require(map.position(x).allFinite(), "positions are numbers");
      require(itself.position(x) == x, "a curve carried to itself leaves space alone");
    }
  } catch (const std::invalid_argument&) {  // a straight curve beyond double
  }
}

}  // namespace
}  // namespace fielddeform::map

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fielddeform::map::check(std::string(reinterpret_cast<const char*>(data), size));
  return 0;
}
