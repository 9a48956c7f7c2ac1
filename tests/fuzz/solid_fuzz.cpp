#include <fielddeform/core/error.h>
#include <fielddeform/solid/regularity.h>
#include <fielddeform/solid/solid_io.h>
#include <fielddeform/solid/tessellate.h>

#include <cstddef>
#include <cstdint>
#include <stdexcept>

#include "require.h"

/// What must hold for any bytes that the reader of objects is given: an IoError, or a valid object whose file reads back as it was written; a
/// small one is solved and tessellated, or refused with a message.
namespace fielddeform::solid {
namespace {

void check(std::string text) {
  SolidFile file;
  try {
    file = parseSolids(std::move(text), "input");
  } catch (const IoError&) {
    return;
  }
  file.object.validate();
  if (file.object.points.size() > 200) return;
  const std::string json = formatSolids(file);
  try {
    require(formatSolids(parseSolids(json, "json")) == json, "writing again gives the same bytes");
  } catch (const IoError&) {  // joined faces whose misses were just within the tolerance, or sizes beyond double
  }
  for (std::size_t s = 0; s < file.object.solids.size(); ++s) checkRegular(file.object, s, 64);
  try {
    Progress silent;
    Options options;
    options.maxIterations = 5;
    const Result r = solve(problemOf(file), options, silent);
    if (r.report.outcome == Outcome::Unmet) return;
    for (const Vec3& p : r.points) require(p.allFinite(), "points are numbers");
    Object after = file.object;
    after.points = r.points;
    tessellate(after, 2);
  } catch (const std::invalid_argument&) {
  } catch (const InfeasibleError&) {
  }
}

}  // namespace
}  // namespace fielddeform::solid

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fielddeform::solid::check(std::string(reinterpret_cast<const char*>(data), size));
  return 0;
}
