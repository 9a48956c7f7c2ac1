#include <fielddeform/render/color_map.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

namespace fielddeform::render {
namespace {

using Stops = std::span<const std::array<int, 3>>;

// Evenly spaced colours (sRGB, 0..255), joined linearly.
constexpr std::array<int, 3> kViridis[] = {{68, 1, 84},    {71, 44, 122},  {59, 81, 139},
                                           {44, 113, 142}, {33, 144, 141}, {39, 173, 129},
                                           {92, 200, 99},  {170, 220, 50}, {253, 231, 37}};
constexpr std::array<int, 3> kHeat[] = {{200, 197, 192}, {242, 200, 130}, {235, 140, 60}, {200, 70, 40}, {120, 20, 35}};
constexpr std::array<int, 3> kDiverging[] = {
    {45, 75, 170}, {110, 150, 215}, {215, 215, 212}, {225, 130, 95}, {165, 20, 40}};

Stops stops(ColorMap map) noexcept {
  switch (map) {
    case ColorMap::Heat:
      return kHeat;
    case ColorMap::Diverging:
      return kDiverging;
    case ColorMap::Viridis:
      break;
  }
  return kViridis;
}

constexpr std::pair<ColorMap, std::string_view> kWords[] = {
    {ColorMap::Viridis, "viridis"}, {ColorMap::Heat, "heat"}, {ColorMap::Diverging, "diverging"}};

}  // namespace

std::string_view toString(ColorMap map) noexcept {
  for (const auto& [value, word] : kWords) {
    if (value == map) return word;
  }
  return "viridis";
}

std::optional<ColorMap> colorMapFromString(std::string_view text) noexcept {
  for (const auto& [value, word] : kWords) {
    if (word == text) return value;
  }
  return std::nullopt;
}

Color mapColor(ColorMap map, double t) noexcept {
  if (std::isnan(t)) return {0.6f, 0.6f, 0.6f};
  const Stops stop = stops(map);
  const double at = std::clamp(t, 0.0, 1.0) * static_cast<double>(stop.size() - 1);
  const std::size_t i = std::min(static_cast<std::size_t>(at), stop.size() - 2);
  const double w = at - static_cast<double>(i);
  const auto channel = [&](int k) { return static_cast<float>(((1 - w) * stop[i][k] + w * stop[i + 1][k]) / 255); };
  return {channel(0), channel(1), channel(2)};
}

std::vector<double> scalarsOf(const mesh::Attribute& attribute) {
  std::vector<double> out(attribute.valueCount());
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (attribute.width == 1) {
      out[i] = attribute.get(i);
      continue;
    }
    for (int k = 0; k < attribute.width; ++k) out[i] = std::hypot(out[i], attribute.get(i, k));
  }
  return out;
}

}  // namespace fielddeform::render
