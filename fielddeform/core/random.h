#pragma once

#include <cstdint>

namespace fielddeform {

/// One 64-bit hash per (seed, index): the project's only source of random numbers, the same on every platform.
inline std::uint64_t splitmix64(std::uint64_t seed, std::uint64_t index) noexcept {
  std::uint64_t z = seed + (index + 1) * 0x9E3779B97F4A7C15ull;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
  return z ^ (z >> 31);
}

/// Uniform in [0, 1), 53 bits.
inline double uniform01(std::uint64_t seed, std::uint64_t index) noexcept {
  return static_cast<double>(splitmix64(seed, index) >> 11) * 0x1.0p-53;
}

}  // namespace fielddeform
