#pragma once

namespace fielddeform {

inline constexpr double kPi = 3.14159265358979323846;

/// Radians of an angle in degrees (90 gives exactly kPi / 2).
constexpr double radiansFromDegrees(double degrees) noexcept { return degrees / 180 * kPi; }

/// The shortest number of degrees that reads back as this angle, or the nearest one if there is none that does.
/// @param radians finite
double degreesFromRadians(double radians);

}  // namespace fielddeform
