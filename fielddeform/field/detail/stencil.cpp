#include <fielddeform/core/parallel.h>
#include <fielddeform/field/detail/stencil.h>
#include <fielddeform/numeric/detail/cell_list.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

namespace fielddeform::field::detail {
namespace {

constexpr double kWidest = 1.2;    // radii: the outermost surface
constexpr double kInnermost = 0.1; // none nearer than this
constexpr double kDensest = 0.5;   // spacing on a surface, of its offset
constexpr double kSparsest = 1;    // before a surface is given up
constexpr double kCoarser = 1.2;
constexpr std::size_t kMany = 2000;
constexpr double kDensestOfMany = 0.08;
constexpr double kRims = 0.3;      // density of the directions around rims, where a mesh has other needs than its two sides
constexpr double kPacking = 0.4;   // points of a thinned surface by area / spacing^2: at least
constexpr double kOverlap = 2;     // of surfaces around several parts: at most so much of them is in the way of another
constexpr double kOnSurface = 0.9; // of the offset: nearer, another part of the primitive is in the way

using numeric::detail::thin;

std::vector<Vec3> taken(const std::vector<Vec3>& points, const std::vector<Index>& chosen) {
  std::vector<Vec3> out;
  for (const Index i : chosen) out.push_back(points[i]);
  return out;
}

int piecesOf(double length, double spacing, std::size_t most) {
  return static_cast<int>(std::clamp(std::ceil(length / spacing), 1.0, static_cast<double>(most)));
}

// Points of the primitive about `spacing` apart: its own first.
std::vector<Vec3> samplePrimitive(const skeleton::Primitive& p, double spacing, std::size_t most) {
  std::vector<Vec3> out = p.points;
  const auto along = [&](const Vec3& a, const Vec3& b) {
    const int n = piecesOf((b - a).norm(), spacing, most);
    for (int i = 1; i < n; ++i) out.push_back(a + (b - a) * (static_cast<double>(i) / n));
  };
  const std::size_t count = p.points.size();
  if (p.type == skeleton::PrimitiveType::Polyline)
    for (std::size_t i = 0; i + (p.closed ? 0 : 1) < count; ++i) along(p.points[i], p.points[(i + 1) % count]);
  for (const auto& f : p.faces)
    for (std::size_t k = 2; k < f.size(); ++k) {
      const Vec3 &a = p.points[f[0]], &b = p.points[f[k - 1]], &c = p.points[f[k]];
      const double longest = std::max({(b - a).norm(), (c - a).norm(), (c - b).norm()});
      const int n = piecesOf(longest, spacing, 64);
      for (int i = 0; i <= n; ++i)
        for (int j = 0; j <= n - i; ++j)
          out.push_back(a + (b - a) * (static_cast<double>(i) / n) + (c - a) * (static_cast<double>(j) / n));
      if (out.size() > 64 * most) out = taken(out, thin(out, spacing, {}));
    }
  return taken(out, thin(out, spacing, {}));
}

// The way along which surfaces follow each other: as far apart as the points on them, at most doubling.
struct Layout {
  double density;  // spacing on a surface, of its offset
  int surfaces;

  double ratio() const { return 1 / (1 - std::min(density, kDensest)); }
  double offset(int k, double widest) const { return widest * std::pow(ratio(), -k); }
};

int mostSurfaces(double density) {
  return 1 + static_cast<int>(std::log(kWidest / kInnermost) / std::log(Layout{density, 0}.ratio()));
}

// Directions over a sphere: the main ones, and as many more as a surface of the density needs (around a curve or a rim: as
// many as a circle needs).
std::vector<Vec3> directions(double density, bool wholeSphere) {
  std::vector<Vec3> d;
  for (int k = 0; k < 3; ++k) d.push_back(Vec3::Unit(k)), d.push_back(-Vec3::Unit(k));
  for (int j = 0; j < 8; ++j) d.push_back(Vec3(j & 1 ? 1 : -1, j & 2 ? 1 : -1, j & 4 ? 1 : -1).normalized());
  const double turn = 2 * std::numbers::pi / density;
  const int n = static_cast<int>(1.3 * (wholeSphere ? 2 * turn / density : turn));
  for (int i = 0; n > 14 && i < n; ++i) {  // a spiral from pole to pole
    const double z = 1 - (2 * i + 1.0) / n, r = std::sqrt(1 - z * z), a = std::numbers::pi * (3 - std::sqrt(5.0)) * i;
    d.emplace_back(r * std::cos(a), r * std::sin(a), z);
  }
  return d;
}

// A number of points that the surfaces have at least.
double leastPoints(const skeleton::Primitive& p, const Layout& layout, double widest) {
  const double pi = std::numbers::pi;
  double length = 0, area = 0, count = 0;
  const std::size_t n = p.points.size();
  if (p.type == skeleton::PrimitiveType::Polyline)
    for (std::size_t i = 0; i + (p.closed ? 0 : 1) < n; ++i) length += (p.points[(i + 1) % n] - p.points[i]).norm();
  for (const auto& f : p.faces)
    for (std::size_t k = 2; k < f.size(); ++k)
      area += 0.5 * (p.points[f[k - 1]] - p.points[f[0]]).cross(p.points[f[k]] - p.points[f[0]]).norm();
  for (int k = 0; k < layout.surfaces; ++k) {
    const double o = layout.offset(k, widest), around = 2 * area + 2 * pi * length * o + 4 * pi * o * o;
    count += kPacking * around / std::pow(layout.density * o, 2);
  }
  return count;
}

// A point at `offset` from the primitive, beside the one given: along the gradient from the closest point.
std::optional<Vec3> onOffset(const PrimitiveDistance& distance, const Vec3& near, double offset) {
  const auto hit = distance.closest(near);
  if (!hit || hit->direction.isZero(0)) return std::nullopt;
  const Vec3 p = hit->point + (hit->distance < 0 ? -offset : offset) * hit->direction;
  const auto there = distance.closest(p);
  if (!there || std::abs(there->distance) < kOnSurface * offset) return std::nullopt;
  return p;
}

std::vector<Vec3> sampleOffset(const PrimitiveDistance& distance, const std::vector<Vec3>& base, double offset, double spacing,
                               const std::vector<Vec3>& ways) {
  const std::vector<Vec3> sparse = taken(base, thin(base, 0.7 * spacing, {}));
  std::vector<std::optional<Vec3>> candidate(sparse.size() * ways.size());
  parallelFor(candidate.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      candidate[i] = onOffset(distance, sparse[i / ways.size()] + offset * ways[i % ways.size()], offset);
  });
  std::vector<Vec3> found;
  for (const auto& c : candidate)
    if (c) found.push_back(*c);
  return taken(found, thin(found, spacing, {}));
}

// The points on the surfaces; nothing if there are more than `most`.
std::optional<std::vector<Vec3>> sample(const PrimitiveDistance& distance, const skeleton::Primitive& p, const Layout& layout,
                                        std::size_t most) {
  const double widest = kWidest * distance.greatestRadius();
  if (leastPoints(p, layout, widest) > kOverlap * static_cast<double>(most)) return std::nullopt;
  const std::vector<Vec3> ways = directions(p.type == skeleton::PrimitiveType::Mesh ? std::max(layout.density, kRims) : layout.density,
                                            p.type == skeleton::PrimitiveType::Points);
  std::vector<Vec3> points = samplePrimitive(p, layout.density * layout.offset(layout.surfaces - 1, widest), most);
  const std::vector<Vec3> base = points;
  for (int k = layout.surfaces; k-- > 0 && points.size() <= most;) {
    const double offset = layout.offset(k, widest);
    const std::vector<Vec3> more = sampleOffset(distance, base, offset, layout.density * offset, ways);
    points.insert(points.end(), more.begin(), more.end());
  }
  if (points.size() > most) return std::nullopt;
  return points;
}

}  // namespace

Stencil sampleDistance(const PrimitiveDistance& distance, const skeleton::Primitive& primitive, std::size_t most) {
  std::optional<std::vector<Vec3>> points;
  Layout layout{most > kMany ? kDensestOfMany : kDensest, 0};
  for (; !points; layout.density *= kCoarser) {
    if (layout.density <= kDensest) layout.surfaces = mostSurfaces(layout.density);
    if (layout.density > kSparsest && layout.surfaces > 1) {
      layout.density = kDensest;
      --layout.surfaces;
    }
    points = sample(distance, primitive, layout, most);
  }
  Stencil s{std::move(*points), {}};
  s.values.resize(s.points.size());
  parallelFor(s.points.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto hit = distance.closest(s.points[i]);
      s.values[i] = hit ? hit->distance / distance.radiusAt(*hit) * distance.greatestRadius() : 0;
    }
  });
  return s;
}

}  // namespace fielddeform::field::detail
