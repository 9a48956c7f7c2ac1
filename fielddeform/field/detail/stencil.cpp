#include <fielddeform/core/parallel.h>
#include <fielddeform/field/detail/stencil.h>
#include <fielddeform/numeric/detail/cell_list.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace fielddeform::field::detail {
namespace {

constexpr double kWidest = 1.2;    // radii: the outermost surface
constexpr int kSurfaces = 4;       // each at half the offset of the one before
constexpr double kDensest = 0.5;   // spacing on a surface, of its offset
constexpr double kDensestOfMany = 0.18;
constexpr std::size_t kMany = 2000;
constexpr double kSparsest = 1;    // before a surface is given up
constexpr double kCoarser = 1.2;
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

const std::vector<Vec3>& directions() {
  static const std::vector<Vec3> all = [] {
    std::vector<Vec3> d;
    for (int k = 0; k < 3; ++k) d.push_back(Vec3::Unit(k)), d.push_back(-Vec3::Unit(k));
    for (int j = 0; j < 8; ++j) d.push_back(Vec3(j & 1 ? 1 : -1, j & 2 ? 1 : -1, j & 4 ? 1 : -1).normalized());
    return d;
  }();
  return all;
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

std::vector<Vec3> sampleOffset(const PrimitiveDistance& distance, const std::vector<Vec3>& base, double offset, double spacing) {
  const std::vector<Vec3> sparse = taken(base, thin(base, 0.7 * spacing, {}));
  const auto& ways = directions();
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

// The points at so many surfaces; nothing if there are more than `most`.
std::optional<std::vector<Vec3>> sample(const PrimitiveDistance& distance, const skeleton::Primitive& p, int surfaces,
                                        double density, std::size_t most) {
  const double widest = kWidest * distance.greatestRadius();
  const double narrowest = std::ldexp(widest, 1 - surfaces);
  std::vector<Vec3> points = samplePrimitive(p, density * narrowest, most);
  const std::vector<Vec3> base = points;
  for (int k = surfaces; k-- > 0 && points.size() <= most;) {
    const double offset = std::ldexp(widest, -k);
    const std::vector<Vec3> more = sampleOffset(distance, base, offset, density * offset);
    points.insert(points.end(), more.begin(), more.end());
  }
  if (points.size() > most) return std::nullopt;
  return points;
}

}  // namespace

Stencil sampleDistance(const PrimitiveDistance& distance, const skeleton::Primitive& primitive, std::size_t most) {
  std::optional<std::vector<Vec3>> points;
  int surfaces = kSurfaces;
  const double densest = most > kMany ? kDensestOfMany : kDensest;
  for (double density = densest; !points; density *= kCoarser) {
    if (density > kSparsest && surfaces > 1) {
      density = kDensest;
      --surfaces;
    }
    points = sample(distance, primitive, surfaces, density, most);
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
