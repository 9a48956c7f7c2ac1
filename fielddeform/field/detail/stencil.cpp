#include <fielddeform/core/parallel.h>
#include <fielddeform/field/detail/stencil.h>
#include <fielddeform/field/detail/stencil_base.h>
#include <fielddeform/numeric/detail/cell_list.h>

#include <algorithm>
#include <cmath>
#include <limits>
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
constexpr double kSmooth = 0.75;   // of the density: a mesh that turns less between its triangles is smooth
constexpr double kSurely = 1.1;    // times what is allowed: more points than that are not tried
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

// A point at `offset` from the primitive, beside the one given: away from the closest point. Which side is inside makes no
// difference.
std::optional<Vec3> onOffset(const PrimitiveDistance& distance, const Vec3& near, double offset) {
  constexpr double kAnywhere = std::numeric_limits<double>::infinity();
  ClosestHint hint;
  hint.inside = false;
  const auto hit = distance.closest(near, kAnywhere, hint);
  if (!hit || hit->direction.isZero(0)) return std::nullopt;
  const Vec3 p = hit->point + offset * hit->direction;
  hint.element = hit->element;
  const auto there = distance.closest(p, kAnywhere, hint);
  if (!there || there->distance < kOnSurface * offset) return std::nullopt;
  return p;
}

// Where an offset surface may lie about a point of the primitive.
void addCandidates(const BasePoint& base, double offset, double density, const std::vector<Vec3>& ways, std::vector<Vec3>& out) {
  if (base.anyWay()) {
    for (const Vec3& way : ways) out.push_back(base.point + offset * way);
    return;
  }
  const double turn = std::acos(std::clamp(base.from.dot(base.to), -1.0, 1.0));
  const int steps = static_cast<int>(std::ceil(turn / density - 0.5));
  for (int i = 0; i <= steps; ++i) {
    const double t = steps > 0 ? static_cast<double>(i) / steps : 0;
    const Vec3 way = ((1 - t) * base.from + t * base.to).normalized();
    out.push_back(base.point + offset * way);
    out.push_back(base.point - offset * way);
  }
}

std::vector<Vec3> sampleOffset(const PrimitiveDistance& distance, const std::vector<BasePoint>& base, double offset, double density,
                               const std::vector<Vec3>& ways) {
  std::vector<Vec3> start;
  for (const BasePoint& b : thinned(base, 0.7 * density * offset)) addCandidates(b, offset, density, ways, start);
  std::vector<std::optional<Vec3>> candidate(start.size());
  parallelFor(start.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) candidate[i] = onOffset(distance, start[i], offset);
  });
  std::vector<Vec3> found;
  for (const auto& c : candidate)
    if (c) found.push_back(*c);
  return taken(found, thin(found, density * offset, {}));
}

// What a sampling took: points on the primitive, and on each surface from the outermost inwards.
struct Counts {
  double base = 0;
  std::vector<double> surface;
};

// The points on the surfaces; nothing if there are more than `most`.
std::optional<std::vector<Vec3>> sample(const PrimitiveDistance& distance, const skeleton::Primitive& p, const Layout& layout,
                                        std::size_t most, Counts* counts = nullptr) {
  const double widest = kWidest * distance.greatestRadius();
  if (leastPoints(p, layout, widest) > kOverlap * static_cast<double>(most)) return std::nullopt;
  const std::vector<Vec3> ways = directions(p.type == skeleton::PrimitiveType::Mesh ? std::max(layout.density, kRims) : layout.density,
                                            p.type == skeleton::PrimitiveType::Points);
  const double spacing = layout.density * layout.offset(layout.surfaces - 1, widest);
  const std::vector<BasePoint> base = samplePrimitive(p, spacing, most, most > kMany ? kSmooth * layout.density : 0);
  std::vector<Vec3> points;
  for (const BasePoint& b : base) points.push_back(b.point);
  if (counts) *counts = {static_cast<double>(base.size()), std::vector<double>(static_cast<std::size_t>(layout.surfaces))};
  for (int k = layout.surfaces; k-- > 0 && points.size() <= most;) {
    const std::vector<Vec3> more = sampleOffset(distance, base, layout.offset(k, widest), layout.density, ways);
    points.insert(points.end(), more.begin(), more.end());
    if (counts) counts->surface[static_cast<std::size_t>(k)] = static_cast<double>(more.size());
  }
  if (points.size() > most) return std::nullopt;
  return points;
}

// What a denser sampling would take, by the areas that a coarse one shows: the number of points on a surface of area A is
// about A / spacing^2, and A follows the offset smoothly.
double predict(const skeleton::Primitive& p, const Counts& counts, const Layout& coarse, const Layout& layout) {
  const auto area = [&](double offset) {  // in units of the widest offset
    const double at = std::clamp(-std::log(offset) / std::log(coarse.ratio()), 0.0, static_cast<double>(coarse.surfaces - 1));
    const std::size_t k = std::min(static_cast<std::size_t>(at), counts.surface.size() - 1), next = std::min(k + 1, counts.surface.size() - 1);
    const auto of = [&](std::size_t i) { return counts.surface[i] * std::pow(coarse.density * coarse.offset(static_cast<int>(i), 1), 2); };
    const double t = at - static_cast<double>(k);
    return (1 - t) * of(k) + t * of(next);
  };
  const auto spacing = [](const Layout& l) { return l.density * l.offset(l.surfaces - 1, 1); };
  const int dimensions = p.type == skeleton::PrimitiveType::Points ? 0 : p.type == skeleton::PrimitiveType::Polyline ? 1 : 2;
  double sum = counts.base * std::pow(spacing(coarse) / spacing(layout), dimensions);
  for (int k = 0; k < layout.surfaces; ++k) {
    const double offset = layout.offset(k, 1);
    sum += area(offset) / std::pow(layout.density * offset, 2);
  }
  return sum;
}

// The density to begin with, of those that the search goes through: what is surely too much is not tried.
double firstDensity(const PrimitiveDistance& distance, const skeleton::Primitive& p, std::size_t most) {
  if (most <= kMany) return kDensest;
  Layout coarse{kDensest / 1.5, mostSurfaces(kDensest / 1.5)}, layout{kDensestOfMany, 0};
  Counts counts;
  if (!sample(distance, p, coarse, most, &counts)) return layout.density;
  for (; layout.density * kCoarser < coarse.density; layout.density *= kCoarser) {
    layout.surfaces = mostSurfaces(layout.density);
    if (predict(p, counts, coarse, layout) <= kSurely * static_cast<double>(most)) break;
  }
  return layout.density;
}

}  // namespace

Stencil sampleDistance(const PrimitiveDistance& distance, const skeleton::Primitive& primitive, std::size_t most) {
  std::optional<std::vector<Vec3>> points;
  Layout layout{firstDensity(distance, primitive, most), 0};
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
