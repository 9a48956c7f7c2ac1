#pragma once

#include <fielddeform/core/rigid.h>

namespace fielddeform::gffd::detail {

/// A rigid motion in coordinates whose origin is the point that it is applied to: the translation is the point's
/// displacement, so that rounding does not depend on how far the model lies from the origin.
using LocalMotion = Rigid;

/// 3 t^2 - 2 t^3 between 0 and 1, constant beyond.
inline double smoothstep(double t) {
  if (!(t > 0)) return 0;
  return t < 1 ? t * t * (3 - 2 * t) : 1;
}

}  // namespace fielddeform::gffd::detail
