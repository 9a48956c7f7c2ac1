#include <fielddeform/core/error.h>
#include <fielddeform/map/targets_file.h>

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "require.h"

/// Any text as a file of targets or of pins: refused with a line, or finite numbers.
namespace fielddeform::map {
namespace {

void check(std::string_view text) {
  const std::vector<Vec3> vertices{Vec3(0, 0, 0), Vec3(1, 2, 3), Vec3(4, 5, 6)};
  try {
    const auto targets = parseTargets(text, "input", vertices);
    require(!targets.empty(), "a file that is accepted has a row");
    for (const PointTarget& t : targets)
      require(t.rest.allFinite() && t.image.allFinite() && t.weight > 0, "targets are finite and weigh something");
  } catch (const IoError& e) {
    require(e.position().line.has_value(), "an error names its line");
  }
  try {
    for (const Vec3& p : parsePins(text, "input", vertices)) require(p.allFinite(), "pins are finite");
  } catch (const IoError& e) {
    require(e.position().line.has_value(), "an error names its line");
  }
}

}  // namespace
}  // namespace fielddeform::map

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fielddeform::map::check(std::string_view(reinterpret_cast<const char*>(data), size));
  return 0;
}
