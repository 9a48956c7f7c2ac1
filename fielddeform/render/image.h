#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

namespace fielddeform::render {

/// A colour as it is seen: sRGB-encoded, each channel in [0, 1].
struct Color {
  float r = 0, g = 0, b = 0;
};

/// "#rrggbb", "#rgb" (the # may be left out), or one of: white, black, grey, clay, red, orange, yellow, green, teal,
/// blue, purple.
std::optional<Color> parseColor(std::string_view text) noexcept;

/// 8-bit sRGB picture, rows from the top, 3 bytes a pixel.
struct Image {
  int width = 0;   ///< pixels
  int height = 0;  ///< pixels
  std::vector<std::uint8_t> rgb;

  const std::uint8_t* pixel(int x, int y) const { return rgb.data() + 3 * (static_cast<std::size_t>(y) * width + x); }
  std::uint8_t* pixel(int x, int y) { return rgb.data() + 3 * (static_cast<std::size_t>(y) * width + x); }
};

/// The picture as a PNG file in memory. The same bytes for the same picture.
/// @throw std::invalid_argument if the picture is empty or its size does not match
std::vector<std::uint8_t> encodePng(const Image& image);

/// Writes a PNG file, complete or not at all.
/// @throw IoError; std::invalid_argument as encodePng
void writePng(const Image& image, const std::filesystem::path& path);

}  // namespace fielddeform::render
