#include <fielddeform/core/error.h>
#include <fielddeform/map/lattice_io.h>

#include <cstddef>
#include <cstdint>
#include <stdexcept>

#include "require.h"

/// What must hold for any bytes that the lattice reader is given: an IoError, or a valid lattice whose file reads back as it
/// was written; and a small one deforms points to numbers.
namespace fielddeform::map {
namespace {

bool sameShape(const Lattice& a, const Lattice& b) {
  return a.box == b.box && a.axis == b.axis && a.outside == b.outside && a.nodeCount() == b.nodeCount();
}

void deform(const Lattice& l) {
  try {
    const LatticeMap map(l);
    for (const Vec3& u : {Vec3(0.3, 0.5, 0.7), Vec3(0, 1, 0.999), Vec3(-2, 0.5, 3)}) {
      const Vec3 x = l.box.origin + l.box.axes * u;
      if (!x.allFinite()) continue;
      require(map.position(x).allFinite(), "positions are numbers");
      require(map.jacobian(x).allFinite(), "derivatives are numbers");
    }
  } catch (const std::invalid_argument&) {  // its rest nodes are beyond double
  }
}

void check(std::string text) {
  Lattice l;
  try {
    l = parseLattice(std::move(text), "input");
  } catch (const IoError&) {
    return;
  }
  l.validate();
  if (l.nodeCount() > 4096) return;
  const std::string json = formatLattice(l, LatticeFormat::Json);
  const Lattice back = parseLattice(json, "json");
  require(sameShape(l, back), "the same lattice comes back");
  require(formatLattice(back, LatticeFormat::Json) == json, "writing again gives the same bytes");
  deform(l);
  std::string obj;
  try {
    obj = formatLattice(l, LatticeFormat::Obj);
  } catch (const std::invalid_argument&) {
    return;  // a node beyond double
  }
  try {
    const Lattice grid = parseLattice(obj, "obj");
    require(sameShape(l, grid), "the same lattice comes back from OBJ");
    require(parseMovedNodes(l, obj, "obj").nodeCount() == l.nodeCount(), "every node comes back");
  } catch (const IoError&) {  // differences beyond double
  }
}

}  // namespace
}  // namespace fielddeform::map

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fielddeform::map::check(std::string(reinterpret_cast<const char*>(data), size));
  return 0;
}
