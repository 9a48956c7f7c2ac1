#pragma once

#include <fielddeform/solid/object.h>

namespace fielddeform::solid {

enum class Orientation : std::uint8_t {
  Positive,   ///< det(dF/du) > 0 everywhere inside, proven (it may vanish on the surface, where edges are collapsed)
  Folded,     ///< <= 0 somewhere inside or on the surface, proven: the solid is turned inside out there
  Undecided,  ///< bounds and samples did not settle it
};
std::string_view toString(Orientation orientation) noexcept;  ///< "positive", "folded", "undecided"

struct Regularity {
  Orientation orientation = Orientation::Positive;
  double least = 0;          ///< least determinant found at the corners of the division, cubic units
  Vec3 at = Vec3::Zero();    ///< (u, v, w) where it was
  double mean = 0;           ///< its mean over the cube: the size
  int boxes = 0;             ///< looked at
};
/// The determinant is itself a Bezier polynomial, of degrees (3 l - 1, 3 m - 1, 3 n - 1): its control numbers bound it. The cube is halved until
/// they are all positive, or a corner's number is not. Zeros up to 1e-9 of the largest control number pass: collapsed edges.
Regularity checkRegular(const Object& object, std::size_t solid, int maxBoxes = 4096);

}  // namespace fielddeform::solid
