#pragma once

#include <fielddeform/render/image.h>

#include <Eigen/Core>
#include <string_view>

namespace fielddeform::render::detail {

/// sRGB to linear light and back, channel by channel in [0, 1].
Eigen::Vector3f toLinear(const Color& color);
Color toSrgb(const Eigen::Vector3f& linear);

Image blank(int width, int height, const Color& color);
void fill(Image& image, int x, int y, int width, int height, const Color& color);
void setPixel(Image& image, int x, int y, const Color& color);

/// Where a line of text goes: its middle (or left end) on the baseline, in pixels from the top left.
struct TextPlace {
  float x = 0, baseline = 0;
  float capitalHeight = 12;  ///< pixels
  float maxWidth = 1e9f;     ///< pixels; longer text is drawn smaller, down to 60 %, then cut with dots
  enum class Anchor : std::uint8_t { Middle, Left } anchor = Anchor::Middle;
};

/// Draws text, antialiased; what lies outside the image is cut off.
void drawText(Image& image, std::string_view text, const TextPlace& place, const Color& color);

}  // namespace fielddeform::render::detail
