#include <fielddeform/core/error.h>
#include <fielddeform/field/distance.h>

#include <array>

namespace fielddeform::field {

void DistanceOptions::validate() const {
  if (grid.voxel) requirePositive("voxel", *grid.voxel);
  requireInRange("distance tolerance", grid.tolerance, 1e-6, 0.1);
  requireInRange("grid memory (MB)", grid.maxMegabytes, 1e-3, 1e9);
  requireInRange("grid memory taken (MB)", grid.takenMegabytes, 0, 1e9);
  requireInRange("centres", static_cast<double>(variational.centres), 16, 100000);
  requireInRange("smoothing", variational.smoothing, 0, 1e12);
  requireInRange("variational tolerance", variational.tolerance, 1e-10, 0.1);
}

std::string_view toString(Distance kind) noexcept {
  constexpr std::array<std::string_view, 3> kWords{"exact", "variational", "grid"};
  return kWords[static_cast<std::size_t>(kind)];
}

std::string_view toString(Sampling sampling) noexcept {
  return sampling == Sampling::Quadratic ? "quadratic" : "trilinear";
}

std::string_view toString(GridOf of) noexcept { return of == GridOf::Blend ? "blend" : "primitives"; }

std::string_view toString(GridAround around) noexcept { return around == GridAround::Influence ? "influence" : "mesh"; }

}  // namespace fielddeform::field
