#include <fielddeform/core/error.h>
#include <fielddeform/map/extended_lattice_io.h>

#include <cstddef>
#include <cstdint>

#include "require.h"

/// What must hold for any bytes that the reader of extended lattices is given: an IoError, or a valid lattice whose file reads back as
/// it was written, and that deforms points to numbers.
namespace fielddeform::map {
namespace {

void check(std::string text) {
  ExtendedLattice l;
  try {
    l = parseExtendedLattice(std::move(text), "input");
  } catch (const IoError&) {
    return;
  }
  l.validate();
  if (l.cells.size() > 64) return;
  const std::string json = formatExtendedLattice(l);
  require(formatExtendedLattice(parseExtendedLattice(json, "json")) == json, "writing again gives the same bytes");
  const ExtendedLatticeMap map(l);
  std::vector<Vec3> points;
  for (const auto& cell : l.cells) points.push_back(0.5 * l.nodes[cell[0]] + 0.5 * l.nodes[cell[63]]);
  std::vector<Vec3> image(points.size());
  std::vector<Mat3> jacobian(points.size());
  Progress silent;
  const auto binding = map.bind(points);
  map.apply(*binding, {.position = image, .safe = {}, .status = {}, .residual = {}}, silent);
  map.jacobians(*binding, jacobian);
  for (std::size_t i = 0; i < points.size(); ++i) {
    require(!points[i].allFinite() || image[i].allFinite(), "positions are numbers");
    require(jacobian[i].allFinite(), "derivatives are numbers");
  }
}

}  // namespace
}  // namespace fielddeform::map

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fielddeform::map::check(std::string(reinterpret_cast<const char*>(data), size));
  return 0;
}
