#pragma once

namespace fielddeform {

/// x rounded to float. A plain static_cast<double>(static_cast<float>(x)), or Eigen's cast<float>().cast<double>(), does
/// nothing at all where g++ 12 vectorises it at -O2 and -O3 (x and y of a point stay unrounded); going through memory does.
inline double roundToFloat(double x) noexcept {
  volatile float stored = static_cast<float>(x);
  return static_cast<double>(stored);
}

}  // namespace fielddeform
