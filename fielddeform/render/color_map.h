#pragma once

#include <fielddeform/mesh/attribute.h>
#include <fielddeform/render/image.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace fielddeform::render {

/// From a number to a colour.
enum class ColorMap : std::uint8_t {
  Viridis,    ///< dark blue to yellow, evenly brighter: sizes (displacement, residual, stretch)
  Heat,       ///< clay grey over orange to dark red: zero looks like no colour at all
  Diverging,  ///< blue, light grey, red: signed values; an automatic range is made symmetric about 0
};

std::string_view toString(ColorMap map) noexcept;  ///< "viridis", "heat", "diverging"
std::optional<ColorMap> colorMapFromString(std::string_view word) noexcept;

/// @param t  clamped to [0, 1]; NaN gives a neutral grey
Color mapColor(ColorMap map, double t) noexcept;

/// One number a value of an attribute: itself, or the length of a vector.
std::vector<double> scalarsOf(const mesh::Attribute& attribute);

}  // namespace fielddeform::render
