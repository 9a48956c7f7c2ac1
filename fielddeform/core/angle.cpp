#include <fielddeform/core/angle.h>

#include <charconv>
#include <cmath>
#include <initializer_list>
#include <limits>

namespace fielddeform {

double degreesFromRadians(double radians) {
  const double near = radians / kPi * 180;
  // Fewer digits first: 90 stays 90, though pi/2 is rounded.
  for (const int digits : {3, 6, 9, 12, 15, 16}) {
    char text[40];
    const auto end = std::to_chars(text, text + sizeof text, near, std::chars_format::scientific, digits - 1).ptr;
    double rounded = near;
    std::from_chars(text, end, rounded);
    if (radiansFromDegrees(rounded) == radians) return rounded;
  }
  const double inf = std::numeric_limits<double>::infinity();
  double below = near, above = near;
  for (int step = 0; step < 4; ++step) {
    if (radiansFromDegrees(below) == radians) return below;
    if (radiansFromDegrees(above) == radians) return above;
    below = std::nextafter(below, -inf);
    above = std::nextafter(above, inf);
  }
  return near;
}

}  // namespace fielddeform
