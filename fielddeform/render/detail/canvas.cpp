#include <fielddeform/render/detail/canvas.h>
#include <fielddeform/render/detail/font.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace fielddeform::render::detail {
namespace {

float decode(float v) { return v <= 0.04045f ? v / 12.92f : std::pow((v + 0.055f) / 1.055f, 2.4f); }
float encode(float v) {
  v = std::clamp(v, 0.0f, 1.0f);
  return v <= 0.0031308f ? v * 12.92f : 1.055f * std::pow(v, 1 / 2.4f) - 0.055f;
}
std::uint8_t quantise(float v) { return static_cast<std::uint8_t>(std::lround(std::clamp(v, 0.0f, 1.0f) * 255.0f)); }

float distanceToSegment(const Eigen::Vector2f& p, const Eigen::Vector2f& a, const Eigen::Vector2f& b) {
  const Eigen::Vector2f d = b - a;
  const float length = d.squaredNorm();
  const float t = length > 0 ? std::clamp((p - a).dot(d) / length, 0.0f, 1.0f) : 0.0f;
  return (a + t * d - p).norm();
}

/// Text that fits: the size shrinks a little, then the text is cut.
std::pair<std::string, float> fitted(std::string_view text, const TextPlace& place) {
  std::string shown(text);
  float height = place.capitalHeight;
  const auto width = [&] { return layOut(shown).width * height / kCapitalHeight; };
  while (width() > place.maxWidth && height > 0.6f * place.capitalHeight) height *= 0.95f;
  bool cut = false;
  while (width() > place.maxWidth && shown.size() > (cut ? 3u : 0u)) {
    if (cut) shown.resize(shown.size() - 3);
    do {
      if (shown.empty()) break;
      const bool continuation = (static_cast<unsigned char>(shown.back()) & 0xC0) == 0x80;
      shown.pop_back();
      if (!continuation) break;
    } while (true);
    shown += "...";
    cut = true;
  }
  return {shown, height};
}

class Pen {
 public:
  Pen(Image& image, const Color& color, float width) : image_(image), ink_(toLinear(color)), half_(width / 2) {}

  void stroke(const std::vector<Eigen::Vector2f>& line) {
    for (std::size_t i = 0; i + 1 < line.size(); ++i) cover(line[i], line[i + 1]);
  }
  /// Blends the ink in by coverage. Strokes overlap in corners: the largest coverage counts, not the sum.
  void finish() {
    for (const auto& [at, amount] : covered()) {
      const int x = static_cast<int>(at % static_cast<std::size_t>(image_.width)),
                y = static_cast<int>(at / static_cast<std::size_t>(image_.width));
      const std::uint8_t* p = image_.pixel(x, y);
      const Eigen::Vector3f paper = toLinear({p[0] / 255.0f, p[1] / 255.0f, p[2] / 255.0f});
      // Linear blending makes dark text on light paper look thin; this exponent evens it out.
      setPixel(image_, x, y, toSrgb(paper + std::pow(amount, 0.8f) * (ink_ - paper)));
    }
  }

 private:
  std::vector<std::pair<std::size_t, float>> covered() {
    std::sort(coverage_.begin(), coverage_.end());
    std::vector<std::pair<std::size_t, float>> out;
    for (const auto& c : coverage_) {
      if (!out.empty() && out.back().first == c.first)
        out.back().second = std::max(out.back().second, c.second);
      else
        out.push_back(c);
    }
    return out;
  }
  void cover(const Eigen::Vector2f& a, const Eigen::Vector2f& b) {
    const float reach = half_ + 1;
    const int x0 = std::max(0, static_cast<int>(std::floor(std::min(a.x(), b.x()) - reach)));
    const int x1 = std::min(image_.width - 1, static_cast<int>(std::ceil(std::max(a.x(), b.x()) + reach)));
    const int y0 = std::max(0, static_cast<int>(std::floor(std::min(a.y(), b.y()) - reach)));
    const int y1 = std::min(image_.height - 1, static_cast<int>(std::ceil(std::max(a.y(), b.y()) + reach)));
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        const Eigen::Vector2f centre(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
        const float amount = std::clamp(half_ + 0.5f - distanceToSegment(centre, a, b), 0.0f, 1.0f);
        if (amount > 0) coverage_.emplace_back(static_cast<std::size_t>(y) * image_.width + x, amount);
      }
    }
  }

  Image& image_;
  Eigen::Vector3f ink_;
  float half_;
  std::vector<std::pair<std::size_t, float>> coverage_;
};

}  // namespace

Eigen::Vector3f toLinear(const Color& c) { return {decode(c.r), decode(c.g), decode(c.b)}; }
Color toSrgb(const Eigen::Vector3f& v) { return {encode(v.x()), encode(v.y()), encode(v.z())}; }

Image blank(int width, int height, const Color& color) {
  Image image{width, height, std::vector<std::uint8_t>(3 * static_cast<std::size_t>(width) * height)};
  fill(image, 0, 0, width, height, color);
  return image;
}

void fill(Image& image, int x, int y, int width, int height, const Color& color) {
  for (int j = std::max(y, 0); j < std::min(y + height, image.height); ++j) {
    for (int i = std::max(x, 0); i < std::min(x + width, image.width); ++i) setPixel(image, i, j, color);
  }
}

void setPixel(Image& image, int x, int y, const Color& color) {
  std::uint8_t* p = image.pixel(x, y);
  p[0] = quantise(color.r), p[1] = quantise(color.g), p[2] = quantise(color.b);
}

void drawText(Image& image, std::string_view text, const TextPlace& place, const Color& color) {
  const auto [shown, height] = fitted(text, place);
  Lettering lettering = layOut(shown);
  const float unit = height / kCapitalHeight;
  const float left = place.anchor == TextPlace::Anchor::Left ? place.x : place.x - unit * lettering.width / 2;
  Pen pen(image, color, std::max(1.15f, 1.05f * unit));
  for (auto& stroke : lettering.strokes) {
    for (auto& p : stroke) p = Eigen::Vector2f(left + unit * p.x(), place.baseline - unit * p.y());
    pen.stroke(stroke);
  }
  pen.finish();
}

}  // namespace fielddeform::render::detail
