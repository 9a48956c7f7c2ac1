// The claim of Qin et al. 2003 in numbers: GFFD with a suitable skeleton against Barr's deformations, axial deformation and a
// lattice, with the other methods by the same skeleton beside it; then the candy wrapper by every method.
// Prints the tables of docs/methods.md: errors in per cent of the object's size, mean / greatest; then the least radius that is
// left of a cylinder whose end is turned by half a turn, share of its own. Usage: methods_table
#include <fmt/format.h>
#include <tests/support/methods.h>

#include <cstdio>
#include <stdexcept>

using namespace fielddeform;

int main() {
  const auto head = [](const std::string& corner) {
    fmt::print("| {} |", corner);
    for (const scene::MethodInfo& m : scene::methods()) fmt::print(" `{}` |", m.word);
    fmt::print("\n|---|");
    for (std::size_t i = 0; i < scene::methods().size(); ++i) fmt::print("---|");
    fmt::print("\n");
  };
  const auto row = [](const std::string& name, auto&& cell) {
    fmt::print("| {} |", name);
    for (const scene::MethodInfo& m : scene::methods()) {
      std::string text = "–";
      try {
        text = cell(m.kind);
      } catch (const std::invalid_argument&) {
        // This method cannot follow that skeleton.
      }
      fmt::print(" {} |", text);
      std::fflush(stdout);
    }
    fmt::print("\n");
  };
  // Less than a millionth of a per cent is rounding.
  const auto percent = [](double share) { return share < 1e-8 ? std::string("0") : fmt::format("{:.2g}", 100 * share); };
  const auto pair = [&](const tests::Misses& m) { return percent(m.mean) + " / " + percent(m.max); };
  head("deformation, skeleton; how far it moves vertices");
  for (const tests::Claim& claim : tests::claims())
    row(fmt::format("{}, {}; {}", claim.name, claim.skeletonName, pair(tests::missesOf(claim, claim.mesh.positions()))),
        [&](scene::MethodKind kind) {
          return pair(tests::missesOf(claim, tests::deformBy(kind, claim.mesh, claim.rest, claim.posed)));
        });
  fmt::print("\n");
  head("cylinder");
  for (const bool twoBones : {false, true}) {
    const tests::Claim wrapper = tests::candyWrapper(twoBones);
    row(twoBones ? "two bones, the upper one rolled" : "a line of 65 points, rolled evenly", [&](scene::MethodKind kind) {
      return fmt::format("{:.3f}", tests::waist(wrapper, tests::deformBy(kind, wrapper.mesh, wrapper.rest, wrapper.posed)));
    });
  }
}
