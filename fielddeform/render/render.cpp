#include <fielddeform/render/detail/canvas.h>
#include <fielddeform/render/detail/shading.h>
#include <fielddeform/render/render.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace fielddeform::render {
namespace {

using namespace detail;

/// Passes a view's share of the work on to the picture's progress, and its cancellation back.
class ViewProgress final : public Progress {
 public:
  ViewProgress(Progress& whole, std::size_t view, std::size_t views) : whole_(whole), view_(view), views_(views) {
    forward();
  }
  void advance(double fraction) override {
    whole_.advance((static_cast<double>(view_) + fraction) / static_cast<double>(views_));
    forward();
  }

 private:
  void forward() {
    if (whole_.cancelled()) cancel();
  }
  Progress& whole_;
  std::size_t view_, views_;
};

Color inkOn(const Color& background) {
  return toLinear(background).dot(Eigen::Vector3f(0.2f, 0.7f, 0.1f)) > 0.2f ? Color{0.16f, 0.16f, 0.18f}
                                                                            : Color{0.9f, 0.9f, 0.9f};
}

void drawView(const Picture& picture, std::size_t index, const Sheet& sheet, const ScalarRange& range, Image& image,
              Progress& progress) {
  const View& view = picture.views[index];
  const ViewFrame& frame = sheet.views[index];
  std::vector<Surface> surfaces;
  std::vector<Strokes> strokes, overlays;
  for (const Body& body : view.bodies) {
    surfaces.push_back(makeSurface(body, frame, picture.scalars, range));
    strokes.push_back(makeStrokes(body, frame, picture.scalars, range));
    progress.throwIfCancelled();
  }
  for (const Overlay& overlay : view.overlays) overlays.push_back(makeStrokes(overlay, frame));
  const RayScene bodyScene(std::move(surfaces), std::move(strokes)), overlayScene({}, std::move(overlays));
  shadeView(bodyScene, overlayScene, frame, picture, image, progress);
}

void drawLabel(const View& view, const ViewFrame& frame, float capital, const Color& ink, Image& image) {
  if (view.label.empty()) return;
  TextPlace place;
  place.x = static_cast<float>(frame.cell.x) + static_cast<float>(frame.cell.width) / 2;
  place.baseline = static_cast<float>(frame.cell.y + frame.cell.height) + 1.7f * capital;
  place.capitalHeight = capital;
  place.maxWidth = 0.96f * static_cast<float>(frame.cell.width);
  drawText(image, view.label, place, ink);
}

/// A bar of the colour map with the range's two ends and middle, the quantity above.
void drawLegend(const ScalarStyle& style, const ScalarRange& range, const Sheet& sheet, const Color& ink,
                Image& image) {
  const Cell& cell = sheet.legend;
  const float text = 0.85f * sheet.capitalHeight;
  const int left = cell.x + static_cast<int>(text), width = std::max(4, static_cast<int>(1.3f * text));
  const int height = std::max(8, static_cast<int>(0.55f * static_cast<float>(cell.height)));
  const int top = cell.y + (cell.height - height) / 2;
  for (int y = 0; y < height; ++y) {
    const double t = 1 - (y + 0.5) / height;
    fill(image, left, top + y, width, 1, mapColor(style.map, t));
  }
  TextPlace place;
  place.anchor = TextPlace::Anchor::Left;
  place.capitalHeight = text;
  place.x = static_cast<float>(left + width) + 0.6f * text;
  place.maxWidth = static_cast<float>(cell.x + cell.width) - place.x - 2;
  for (const double t : {0.0, 0.5, 1.0}) {
    place.baseline = static_cast<float>(top + (1 - t) * height) + text / 2;
    drawText(image, fmt::format("{:.3g}", range.low + t * (range.high - range.low)), place, ink);
  }
  place.x = static_cast<float>(left);
  place.maxWidth = static_cast<float>(cell.x + cell.width - left) - 2;
  place.baseline = static_cast<float>(top) - 1.6f * text;
  drawText(image, style.label, place, ink);
}

}  // namespace

bool available() noexcept { return true; }

Image render(const Picture& picture, Progress& progress) {
  picture.validate();
  progress.beginStage("render");
  progress.throwIfCancelled();
  const Sheet sheet = layOutSheet(picture);
  const ScalarRange range = scalarRange(picture);
  const Color ink = inkOn(picture.background);
  Image image = blank(sheet.width, sheet.height, picture.background);
  for (std::size_t i = 0; i < picture.views.size(); ++i) {
    ViewProgress part(progress, i, picture.views.size());
    drawView(picture, i, sheet, range, image, part);
    drawLabel(picture.views[i], sheet.views[i], sheet.capitalHeight, ink, image);
  }
  if (sheet.legend.width > 0) drawLegend(picture.scalars, range, sheet, ink, image);
  return image;
}

}  // namespace fielddeform::render
