// The claim of Qin et al. 2003 in numbers: GFFD with a suitable skeleton against Barr's deformations, axial deformation and a
// lattice, with the other methods by the same skeleton beside it; then the candy wrapper by every method.
// Prints errors in per cent of the object's size, mean / greatest. Usage: methods_table
#include <fmt/format.h>
#include <tests/support/methods.h>

#include <cstdio>
#include <stdexcept>

using namespace fielddeform;

int main() {
  fmt::print("{:18}", "deformation");
  for (const scene::MethodInfo& m : scene::methods()) fmt::print("{:>16}", m.word);
  fmt::print("\n");
  const auto row = [](const std::string& name, auto&& cell) {
    fmt::print("{:18}", name);
    for (const scene::MethodInfo& m : scene::methods()) {
      std::string text = "-";
      try {
        text = cell(m.kind);
      } catch (const std::invalid_argument&) {
        // This method cannot follow that skeleton.
      }
      fmt::print("{:>16}", text);
      std::fflush(stdout);
    }
    fmt::print("\n");
  };
  for (const tests::Claim& claim : tests::claims()) {
    const tests::Misses moved = tests::missesOf(claim, claim.mesh.positions());
    fmt::print("{} by {}: moves vertices by {:.2g} / {:.2g}\n", claim.name, claim.skeletonName, 100 * moved.mean, 100 * moved.max);
    row(claim.name, [&](scene::MethodKind kind) {
      const tests::Misses m = tests::missesOf(claim, tests::deformBy(kind, claim.mesh, claim.rest, claim.posed));
      return fmt::format("{:.2g} / {:.2g}", 100 * m.mean, 100 * m.max);
    });
  }
  fmt::print("\nleast radius of a cylinder whose end is turned by half a turn, share of its own\n");
  for (const bool twoBones : {false, true}) {
    const tests::Claim wrapper = tests::candyWrapper(twoBones);
    row(twoBones ? "two bones" : "65 points", [&](scene::MethodKind kind) {
      return fmt::format("{:.3f}", tests::waist(wrapper, tests::deformBy(kind, wrapper.mesh, wrapper.rest, wrapper.posed)));
    });
  }
}
