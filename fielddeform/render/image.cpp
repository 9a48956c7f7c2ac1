#include <fielddeform/render/image.h>

#include <array>
#include <string>
#include <utility>

namespace fielddeform::render {
namespace {

std::optional<int> hexDigit(char c) noexcept {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return std::nullopt;
}

constexpr std::pair<std::string_view, Color> kNamed[] = {
    {"white", {1, 1, 1}},
    {"black", {0, 0, 0}},
    {"grey", {0.5f, 0.5f, 0.5f}},
    {"clay", {0.75f, 0.735f, 0.715f}},
    {"red", {0.78f, 0.20f, 0.17f}},
    {"orange", {0.85f, 0.33f, 0.10f}},
    {"yellow", {0.90f, 0.72f, 0.20f}},
    {"green", {0.35f, 0.62f, 0.30f}},
    {"teal", {0.20f, 0.56f, 0.56f}},
    {"blue", {0.22f, 0.42f, 0.72f}},
    {"purple", {0.52f, 0.35f, 0.66f}},
};

}  // namespace

std::optional<Color> parseColor(std::string_view text) noexcept {
  for (const auto& [name, color] : kNamed) {
    if (text == name) return color;
  }
  if (text.starts_with('#')) text.remove_prefix(1);
  if (text.size() != 3 && text.size() != 6) return std::nullopt;
  std::array<float, 3> channel{};
  const std::size_t digits = text.size() / 3;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto high = hexDigit(text[k * digits]), low = hexDigit(text[k * digits + digits - 1]);
    if (!high || !low) return std::nullopt;
    channel[k] = static_cast<float>(16 * *high + *low) / 255.0f;
  }
  return Color{channel[0], channel[1], channel[2]};
}

}  // namespace fielddeform::render
