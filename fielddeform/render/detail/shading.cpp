#include <fielddeform/core/parallel.h>
#include <fielddeform/core/random.h>
#include <fielddeform/render/detail/canvas.h>
#include <fielddeform/render/detail/shading.h>

#include <algorithm>
#include <cmath>
#include <numbers>

// Light: a soft key from the upper left of the camera, a weak fill from the right, and a sky whose share each point
// sees by ambient occlusion. Key and sky terms are kept apart until the noise of their few rays has been filtered.
namespace fielddeform::render::detail {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

constexpr float kOffset = 2e-4f;         // from a surface before the next ray starts, in sizes of the object
constexpr float kOcclusionReach = 0.9f;  // what is farther away does not darken, same unit
constexpr float kKeySoftness = 0.14f;    // radius of the key light at distance 1
constexpr int kEdgeFactor = 4;

/// Light that a camera ray sees: constant + key * visible + sky * open.
struct Light {
  Vector3f constant = Vector3f::Zero(), key = Vector3f::Zero(), sky = Vector3f::Zero();
  float visible = 0, open = 0;

  Vector3f total() const { return constant + visible * key + open * sky; }
};

/// One camera ray.
struct Sample {
  Light light;
  Vector3f normal = Vector3f::Zero();
  float depth = 0;
  std::uint32_t part = 0xFFFFFFFFu;  // body hit; all ones: none
  std::uint32_t overlay = 0xFFFFFFFFu;
};

/// One pixel between the two passes.
struct Pixel {
  Light light;
  Vector3f normal = Vector3f::Zero();
  float depth = 0;
  bool even = false;  // all rays met one smooth piece of surface: its noise may be filtered
  bool empty = true;  // background only
};

/// Points of the plane, evenly spread for any count, shifted by a hash.  [Roberts' R2 sequence]
class Sequence {
 public:
  explicit Sequence(std::uint64_t seed) : x_(uniform01(seed, 0)), y_(uniform01(seed, 1)) {}
  Vector2f next() {
    x_ += 0.7548776662466927, y_ += 0.5698402909980532;
    x_ -= std::floor(x_), y_ -= std::floor(y_);
    return {static_cast<float>(x_), static_cast<float>(y_)};
  }

 private:
  double x_, y_;
};

/// A unit vector about `axis` with density cos / pi.
Vector3f cosineDirection(const Vector3f& axis, const Vector2f& u) {
  const float r = std::sqrt(u.x()), phi = 2 * std::numbers::pi_v<float> * u.y();
  const Vector3f helper = std::abs(axis.x()) > 0.7f ? Vector3f::UnitY() : Vector3f::UnitX();
  const Vector3f s = axis.cross(helper).normalized(), t = axis.cross(s);
  return (r * std::cos(phi) * s + r * std::sin(phi) * t + std::sqrt(std::max(0.0f, 1 - u.x())) * axis).normalized();
}

class Shader {
 public:
  Shader(const RayScene& bodies, const RayScene& overlays, const ViewFrame& frame, const Picture& picture)
      : bodies_(bodies),
        overlays_(overlays),
        frame_(frame),
        quality_(picture.quality),
        background_(toLinear(picture.background)) {
    key_ = (-0.50f * frame.right + 0.75f * frame.up - 0.70f * frame.forward).normalized();
    fill_ = (0.85f * frame.right + 0.05f * frame.up - 0.55f * frame.forward).normalized();
  }

  const Vector3f& background() const { return background_; }

  Pixel pixel(int x, int y) const {
    const std::uint64_t seed = splitmix64(static_cast<std::uint64_t>(y), static_cast<std::uint64_t>(x));
    Sequence positions(splitmix64(seed, 1)), sky(splitmix64(seed, 2)), key(splitmix64(seed, 3));
    Pixel pixel;
    Sample first;
    const int count = quality_.samples;
    bool even = true;
    Vector3f total = Vector3f::Zero();
    const auto take = [&](const Sample& s) {
      total += s.light.total();
      pixel.light.constant += s.light.constant, pixel.light.key += s.light.key, pixel.light.sky += s.light.sky;
      pixel.light.visible += s.light.visible, pixel.light.open += s.light.open;
      pixel.normal += s.normal, pixel.depth += s.depth;
    };
    for (int i = 0; i < count; ++i) {
      const Sample s = sample(x, y, positions.next(), sky, key);
      if (i == 0) first = s;
      even &= s.part == first.part && s.overlay == first.overlay &&
              s.normal.dot(first.normal) > 0.94f * (s.part != ~0u) - 1e-6f &&
              std::abs(s.depth - first.depth) < 12 * frame_.pixel;
      pixel.empty &= s.part == ~0u && s.overlay == ~0u;
      take(s);
    }
    if (pixel.empty) return pixel;
    int taken = count;
    for (; !even && taken < kEdgeFactor * count; ++taken) take(sample(x, y, positions.next(), sky, key));
    const float share = 1 / static_cast<float>(taken);
    pixel.even = even && first.part != ~0u;
    pixel.depth *= share, pixel.normal = pixel.normal.stableNormalized();
    Light& l = pixel.light;
    if (pixel.even) {
      l.constant *= share, l.key *= share, l.sky *= share, l.visible *= share, l.open *= share;
    } else {
      l = {};
      l.constant = share * total;
    }
    return pixel;
  }

 private:
  Sample sample(int x, int y, const Vector2f& inPixel, Sequence& sky, Sequence& key) const {
    const float sx = 2 * (static_cast<float>(x) + inPixel.x()) / static_cast<float>(frame_.cell.width) - 1;
    const float sy = 1 - 2 * (static_cast<float>(y) + inPixel.y()) / static_cast<float>(frame_.cell.height);
    const Vector3f aside = sx * frame_.halfWidth * frame_.right + sy * frame_.halfHeight * frame_.up;
    Vector3f origin = frame_.eye, direction = frame_.forward;
    if (frame_.projection == Projection::Perspective)
      direction = (frame_.forward + aside).normalized();
    else
      origin += aside;

    Sample s;
    Hit body, overlay;
    const bool onBody = bodies_.intersect(origin, direction, body);
    const bool onOverlay = overlays_.intersect(origin, direction, overlay);
    if (onBody) {
      s.part = body.part, s.normal = body.normal, s.depth = body.distance;
      s.light = shade(body, origin + body.distance * direction, direction, sky, key);
    } else {
      s.light.constant = background_;
    }
    const bool front = !onBody || overlay.distance <= body.distance;
    const float opacity = front ? 1 : overlay.hidden;
    if (onOverlay && opacity > 0) {
      const float facing = std::abs(overlay.normal.dot(direction)), lit = std::max(0.0f, overlay.normal.dot(key_));
      const Vector3f ink = overlay.color * (0.45f + 0.30f * facing + 0.45f * lit);
      s.light.constant = (1 - opacity) * s.light.constant + opacity * ink;
      s.light.key *= 1 - opacity, s.light.sky *= 1 - opacity;
      s.overlay = overlay.part;
    }
    return s;
  }

  Light shade(const Hit& hit, const Vector3f& point, const Vector3f& direction, Sequence& sky, Sequence& key) const {
    const Vector3f& n = hit.normal;
    Light light;
    const float up = n.dot(frame_.up), facing = -n.dot(direction);
    light.sky = hit.color.cwiseProduct(Vector3f(0.43f, 0.45f, 0.485f) * (0.75f + 0.25f * up));
    light.constant = hit.color * (0.14f * std::max(0.0f, n.dot(fill_)) + 0.03f * facing);
    const Vector3f half = (key_ - direction).normalized();
    const float gloss = 0.07f * std::pow(std::max(0.0f, n.dot(half)), 30.0f);
    const float cosine = n.dot(key_);
    light.key =
        std::max(0.0f, cosine) * (hit.color.cwiseProduct(Vector3f(1.04f, 1.015f, 0.97f)) + Vector3f::Constant(gloss));

    const Vector3f from = point + kOffset * hit.flat;
    light.open = 1;
    for (int i = 0, open = 0; i < quality_.ambient; ++i) {
      const Vector3f d = cosineDirection(n, sky.next());
      open += d.dot(hit.flat) > 0 && !bodies_.occluded(from, d, kOcclusionReach);
      light.open = static_cast<float>(open) / static_cast<float>(quality_.ambient);
    }
    light.visible = 1;
    if (cosine <= 0) return light;
    for (int i = 0, seen = 0; i < quality_.shadows; ++i) {
      const Vector2f u = key.next();
      const float r = kKeySoftness * std::sqrt(u.x()), phi = 2 * std::numbers::pi_v<float> * u.y();
      const Vector3f d = (key_ + r * std::cos(phi) * frame_.right + r * std::sin(phi) * frame_.up).normalized();
      seen += d.dot(hit.flat) > 0 && !bodies_.occluded(from, d, std::numeric_limits<float>::infinity());
      light.visible = static_cast<float>(seen) / static_cast<float>(quality_.shadows);
    }
    return light;
  }

  const RayScene& bodies_;
  const RayScene& overlays_;
  const ViewFrame& frame_;
  const Quality& quality_;
  Vector3f background_, key_, fill_;
};

/// Mean of visible and open over the neighbours on the same smooth piece of surface.
Light filtered(const std::vector<Pixel>& pixels, const Cell& cell, int x, int y, float pixelSize) {
  constexpr int kReach = 4;
  const Pixel& centre = pixels[static_cast<std::size_t>(y) * cell.width + x];
  float weight = 0, visible = 0, open = 0;
  for (int j = std::max(0, y - kReach); j <= std::min(cell.height - 1, y + kReach); ++j) {
    for (int i = std::max(0, x - kReach); i <= std::min(cell.width - 1, x + kReach); ++i) {
      const Pixel& p = pixels[static_cast<std::size_t>(j) * cell.width + i];
      if (!p.even) continue;
      const float bend = std::max(0.0f, p.normal.dot(centre.normal)),
                  step = (p.depth - centre.depth) / (25 * pixelSize);
      const float r2 = static_cast<float>((i - x) * (i - x) + (j - y) * (j - y)) / 9.0f;
      const float b2 = bend * bend, b8 = b2 * b2 * b2 * b2;
      const float w = b8 * b8 * std::exp(-r2 - step * step);
      weight += w, visible += w * p.light.visible, open += w * p.light.open;
    }
  }
  Light light = centre.light;
  light.visible = visible / weight, light.open = open / weight;
  return light;
}

/// Bright light bends towards white instead of being cut. Below 0.7 nothing changes.
Vector3f toneMapped(const Vector3f& light) {
  return light.unaryExpr([](float v) { return v <= 0.7f ? v : 0.7f + 0.3f * (1 - std::exp(-(v - 0.7f) / 0.3f)); });
}

}  // namespace

void shadeView(const RayScene& bodies, const RayScene& overlays, const ViewFrame& frame, const Picture& picture,
               Image& image, Progress& progress) {
  const Cell& cell = frame.cell;
  const Shader shader(bodies, overlays, frame, picture);
  std::vector<Pixel> pixels(static_cast<std::size_t>(cell.width) * cell.height);
  constexpr int kTile = 16;
  const int across = (cell.width + kTile - 1) / kTile, down = (cell.height + kTile - 1) / kTile;
  parallelFor(static_cast<std::size_t>(across) * down, 1, progress, [&](std::size_t begin, std::size_t) {
    const int x0 = static_cast<int>(begin) % across * kTile, y0 = static_cast<int>(begin) / across * kTile;
    for (int y = y0; y < std::min(y0 + kTile, cell.height); ++y) {
      for (int x = x0; x < std::min(x0 + kTile, cell.width); ++x) {
        pixels[static_cast<std::size_t>(y) * cell.width + x] = shader.pixel(x, y);
      }
    }
  });
  parallelFor(static_cast<std::size_t>(cell.height), 8, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < cell.width; ++x) {
        const Pixel& p = pixels[static_cast<std::size_t>(y) * cell.width + x];
        if (p.empty) continue;  // the sheet's background is there
        const bool smooth = p.even && picture.quality.smooth;
        const Light light = smooth ? filtered(pixels, cell, x, y, frame.pixel) : p.light;
        setPixel(image, cell.x + x, cell.y + y, toSrgb(toneMapped(light.total())));
      }
    }
  });
}

}  // namespace fielddeform::render::detail
