#include <fielddeform/core/parallel.h>

#include <array>
#include <cmath>
#include <utility>

#include "figures.h"
#include "isosurface.h"
#include "sculpt.h"

namespace fielddeform::samples {
namespace {

constexpr double kMillimetres = 100;  // the sculpture below is about 1.9 tall

/// Mirrored in x: one formula for the left and the right.
Vec3 folded(const Vec3& p) { return {std::abs(p.x()), p.y(), p.z()}; }

/// Everything that is covered by fur, still smooth.
double body(const Vec3& p) {
  const Vec3 q = folded(p);
  double d = limb(p, {0, 0.36, -0.02}, {0, 0.80, 0.01}, 0.275, 0.270);                 // belly
  d = join(d, limb(p, {0, 0.80, 0.01}, {0, 1.22, 0.0}, 0.262, 0.205), 0.16);           // chest
  d = join(d, limb(p, {0, 1.20, 0.0}, {0, 1.50, 0.03}, 0.185, 0.165), 0.14);           // neck
  d = join(d, ellipsoid(p, {0, 1.66, 0.05}, {0.215, 0.195, 0.225}), 0.12);             // head
  d = join(d, ellipsoid(p, {0, 1.60, 0.225}, {0.115, 0.085, 0.105}), 0.07);            // muzzle
  d = join(d, ellipsoid(q, {0.085, 1.605, 0.20}, {0.085, 0.075, 0.085}), 0.05);        // cheeks
  d = join(d, ellipsoid(q, {0.20, 1.775, 0.0}, {0.055, 0.065, 0.035}), 0.035);         // ears
  d = join(d, ellipsoid(q, {0.205, 0.30, 0.07}, {0.145, 0.225, 0.185}), 0.10);         // thighs
  d = join(d, limb(q, {0.19, 0.07, 0.05}, {0.225, 0.055, 0.30}, 0.085, 0.065), 0.07);  // feet
  for (const double toe : {-0.05, 0.0, 0.05}) {
    d = join(d, limb(q, {0.22 + 0.6 * toe, 0.05, 0.30}, {0.23 + toe, 0.042, 0.375}, 0.036, 0.030), 0.025);
  }
  d = join(d, limb(q, {0.185, 1.20, 0.06}, {0.275, 0.95, 0.15}, 0.082, 0.072), 0.07);   // upper arms
  d = join(d, limb(q, {0.275, 0.95, 0.15}, {0.115, 0.98, 0.315}, 0.070, 0.056), 0.03);  // forearms
  d = join(d, ellipsoid(q, {0.095, 0.985, 0.335}, {0.055, 0.060, 0.050}), 0.03);        // paws
  d = join(d, limb(p, {0, 0.22, -0.22}, {0, 0.09, -0.46}, 0.135, 0.098), 0.12);         // tail
  d = join(d, limb(p, {0, 0.09, -0.46}, {0.10, 0.065, -0.68}, 0.098, 0.060), 0.05);
  return d;
}

double fur(const Vec3& p) {
  const double soft = noise(8 * p, 1);
  const double strands = noise({42 * p.x() + 1.5 * soft, 13 * p.y(), 42 * p.z()}, 2);
  const double fine = noise({90 * p.x(), 34 * p.y(), 90 * p.z() + soft}, 3);
  return 0.0055 * soft + 0.0050 * strands + 0.0022 * fine;
}

double furred(const Vec3& p) {
  const double d = body(p);
  if (d > 0.05 || d < -0.05) return d;
  const Vec3 q = folded(p);
  const double face = std::min((p - Vec3(0, 1.62, 0.30)).norm() / 0.16, (q - Vec3(0.105, 1.715, 0.225)).norm() / 0.08);
  return d - fur(p) * (0.25 + 0.75 * smoothstep(0.6, 1.2, face));
}

double nose(const Vec3& p) { return ellipsoid(p, {0, 1.638, 0.328}, {0.044, 0.032, 0.028}); }
double eyes(const Vec3& p) { return (folded(p) - Vec3(0.098, 1.712, 0.226)).norm() - 0.034; }
double shell(const Vec3& p) {
  const Vec3 c(0, 1.0, 0.375);
  const Vec3 fromHinge = p - c + Vec3(0, 0.10, 0);
  const double ribs =
      0.005 * std::cos(22 * std::atan2(fromHinge.x(), fromHinge.y())) * smoothstep(0.04, 0.15, fromHinge.norm());
  return ellipsoid(p, c, {0.100, 0.092, 0.062}) - ribs;
}

double figure(const Vec3& p) {
  double d = furred(p);
  d = join(d, nose(p), 0.012);
  d = join(d, eyes(p), 0.010);
  return join(d, shell(p), 0.012);
}

using Rgb = std::array<double, 3>;
Rgb mix(const Rgb& a, const Rgb& b, double t) {
  return {a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])};
}

/// Brown back, cream belly and muzzle, darker paws; the fur's own light and dark.
Rgb coat(const Vec3& p, const Vec3& normal) {
  const Rgb brown{118, 84, 58}, cream{214, 190, 154}, dark{74, 52, 38};
  const double front = normal.z() + 0.35 * noise(6 * p, 4);
  const double height = smoothstep(0.25, 0.45, p.y());
  Rgb c = mix(
      brown, cream,
      height * smoothstep(0.25, 0.75, front) * smoothstep(0.27, 0.17, std::abs(p.x())) * smoothstep(1.78, 1.60, p.y()));
  const Vec3 q = folded(p);
  const double muzzle = (p - Vec3(0, 1.575, 0.24)).cwiseQuotient(Vec3(0.19, 0.115, 0.16)).norm();
  c = mix(c, cream, smoothstep(1.15, 0.85, muzzle));
  const double ends =
      std::min((q - Vec3(0.10, 0.985, 0.34)).norm() / 0.11, (q - Vec3(0.225, 0.03, 0.36)).norm() / 0.12);
  c = mix(c, dark, 0.8 * smoothstep(1.1, 0.6, ends));
  c = mix(c, dark, 0.7 * smoothstep(-0.50, -0.70, p.z()));
  const double shade = 1 + 26 * fur(p);
  return {c[0] * shade, c[1] * shade, c[2] * shade};
}

/// A line drawn below the nose, curved up at both ends.
double mouth(const Vec3& p) {
  const double x = std::abs(p.x());
  const double smile = std::abs(p.y() - 1.562 - 2.2 * (x - 0.035) * (x - 0.035)) + 4 * std::max(0.0, x - 0.085);
  const double groove = x + 4 * std::max(0.0, std::max(1.565 - p.y(), p.y() - 1.62));
  return std::min(smile, groove) + 4 * std::max(0.0, 0.2 - p.z());
}

Rgb colorAt(const Vec3& p, const Vec3& normal) {
  const Rgb black{32, 26, 24}, teal{70, 150, 150}, pearl{226, 220, 205}, white{240, 240, 240};
  const double highlight = (folded(p) - Vec3(0.107, 1.727, 0.2565)).norm();
  const std::array<std::pair<double, Rgb>, 4> parts{
      {{furred(p), mix(black, coat(p, normal), 0.25 + 0.75 * smoothstep(0.003, 0.009, mouth(p)))},
       {nose(p), black},
       {eyes(p), mix(white, black, smoothstep(0.009, 0.015, highlight))},
       {shell(p), mix(teal, pearl, 0.5 + 0.5 * std::cos(95 * (p - Vec3(0, 0.90, 0.375)).norm()))}}};
  double nearest = parts[0].first, sum = 0;
  for (const auto& part : parts) nearest = std::min(nearest, part.first);
  Rgb c{0, 0, 0};
  for (const auto& part : parts) {  // borders are as sharp as the vertices are dense
    const double weight = std::exp((nearest - part.first) / 0.0025);
    sum += weight;
    for (std::size_t k = 0; k < 3; ++k) c[k] += weight * part.second[k];
  }
  return {c[0] / sum, c[1] / sum, c[2] / sum};
}

}  // namespace

mesh::Mesh otter(double fineness) {
  const double spacing = 0.0064 / fineness;
  mesh::Mesh mesh = isosurface(Box(Vec3(-0.46, -0.08, -0.80), Vec3(0.46, 1.95, 0.52)), spacing, figure);
  auto& positions = mesh.mutablePositions();
  std::vector<std::uint8_t> rgb(3 * positions.size());
  parallelFor(positions.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      const Rgb c = colorAt(positions[v], gradient(body, positions[v], 0.01).normalized());
      for (std::size_t k = 0; k < 3; ++k)
        rgb[3 * v + k] = static_cast<std::uint8_t>(std::lround(std::clamp(c[k], 0.0, 255.0)));
      positions[v] = (kMillimetres * positions[v]).cast<float>().cast<double>();  // what the file will hold
    }
  });
  mesh.setPositionType(mesh::ScalarType::Float32);
  mesh::Attribute color;
  color.name = "color";
  color.width = 3;
  color.data = std::move(rgb);
  mesh.attributes().push_back(std::move(color));
  return mesh;
}

}  // namespace fielddeform::samples
