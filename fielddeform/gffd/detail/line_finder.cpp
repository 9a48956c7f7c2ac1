#include <fielddeform/gffd/detail/line_finder.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace fielddeform::gffd::detail {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Reaches that walks are prepared for: from kFarthest sizes of the line down, 288 bytes a segment.
constexpr std::size_t kReaches = 36, kReachesOfMany = 9, kMany = 50'000;
constexpr double kStep = 1.25, kStepOfMany = kStep * kStep * kStep * kStep;
constexpr double kFarthest = 8;
constexpr std::size_t kFewest = 4;   // segments: fewer are all tried
// Nearer to a segment's end than this share of the reach, rounding may prefer its neighbour: both are tried, from either side.
constexpr double kUndecided = 1e-7;
constexpr double kRounding = 1 + 1e-9;

// The number, or the next float below or above.
float below(double x) {
  const auto f = static_cast<float>(x);
  return f > x ? std::nextafter(f, -std::numeric_limits<float>::infinity()) : f;
}
float above(double x) { return -below(-x); }

double squareTo(const LineSegment& s, const Vec3& p) {
  const Vec3 from = p - s.a;
  const double t = std::clamp(from.dot(s.along), 0.0, s.length);
  return (from - t * s.along).squaredNorm();
}

}  // namespace

LineFinder::LineFinder(const skeleton::Primitive& p) {
  const std::size_t n = p.points.size();
  const auto add = [&](const Vec3& a, const Vec3& b) {
    const Vec3 ab = b - a;
    const double length = ab.norm();
    segments_.push_back({a, b, length > 0 ? Vec3(ab / length) : Vec3::Zero(), length});
  };
  if (p.type == skeleton::PrimitiveType::Points || n == 1) {
    for (const Vec3& x : p.points) add(x, x);
  } else {
    for (std::size_t i = 0; i + 1 < n; ++i) add(p.points[i], p.points[i + 1]);
    closed_ = p.closed && n > 2;
    if (closed_) add(p.points[n - 1], p.points[0]);
  }
  const std::size_t count = segments_.size();
  Box whole;
  const auto size = static_cast<std::size_t>(std::clamp(std::sqrt(static_cast<double>(count) / 2), 1.0, 256.0));
  for (std::size_t begin = 0; begin < count; begin += size) {
    Group g{Vec3::Zero(), 0, static_cast<Index>(begin), static_cast<Index>(std::min(count, begin + size))};
    Box box;
    for (Index i = g.begin; i < g.end; ++i) {
      box.extend(segments_[i].a);
      box.extend(segments_[i].b);
    }
    whole.extend(box);
    g.centre = box.center();
    for (Index i = g.begin; i < g.end; ++i) {
      const LineSegment& s = segments_[i];
      g.radius = std::max({g.radius, (s.a - g.centre).norm(), (s.b - g.centre).norm()});
    }
    g.radius *= kRounding;
    groups_.push_back(g);
  }
  if (p.type != skeleton::PrimitiveType::Points && count >= kFewest) findStops((whole.max() - whole.min()).norm());
}

void LineFinder::findStops(double size) {
  if (!(size > 0) || !std::isfinite(size)) return;
  const std::size_t n = segments_.size();
  // |t' - t| from one segment to the next; points in between have no direction of their own.
  std::vector<double> turn(n, 0);
  Vec3 last = Vec3::Zero();
  for (std::size_t i = 0; i < n; ++i) {
    const LineSegment& s = segments_[i];
    if (!(s.length > 0)) continue;
    if (i > 0 && !last.isZero(0)) turn[i - 1] = (s.along - last).norm();
    last = s.along;
  }
  const bool many = n > kMany;
  greatest_ = kFarthest * size, step_ = many ? kStepOfMany : kStep;
  double reach = greatest_;
  for (std::size_t k = 0; k < (many ? kReachesOfMany : kReaches); ++k, reach /= step_) {
    std::vector<WalkStop>& stops = stops_.emplace_back(n);
    const double undecided = reach * kUndecided;
    double need = 0;
    for (std::size_t i = n; i-- > 0;) {
      need = (need + reach * turn[i]) * kRounding;
      stops[i].after = below(segments_[i].length - need - undecided);
      need = std::max(0.0, need - segments_[i].length);
    }
    need = 0;
    for (std::size_t i = 0; i < n; ++i) {
      if (i > 0) need = (need + reach * turn[i - 1]) * kRounding;
      stops[i].before = above(need + undecided);
      need = std::max(0.0, need - segments_[i].length);
    }
  }
}

const WalkStop* LineFinder::stopsFor(double reach) const {
  if (!(reach <= greatest_)) return nullptr;
  std::size_t k = 0;
  for (double next = greatest_ / step_; k + 1 < stops_.size() && reach <= next; next /= step_) ++k;
  return stops_[k].data();
}

LineFinder::Nearby LineFinder::nearby(const Vec3& centre, double radius) const {
  const std::size_t n = groups_.size();
  double low = kInfinity;
  std::size_t nearest = 0;
  for (std::size_t g = 0; g < n; ++g) {
    const double d = (centre - groups_[g].centre).norm() - groups_[g].radius;
    if (d < low) low = d, nearest = g;
  }
  Nearby out;
  double best = kInfinity;
  for (Index i = groups_[nearest].begin; i < groups_[nearest].end; ++i) {
    const double square = squareTo(segments_[i], centre);
    if (square < best) best = square, out.start = i;
  }
  const double limit = (std::sqrt(best) + 2 * radius) * kRounding;
  out.least = low - radius;
  std::size_t first = n, last = 0;
  for (std::size_t g = 0; g < n; ++g) {
    if (!((centre - groups_[g].centre).norm() - groups_[g].radius <= limit)) continue;
    first = std::min(first, g);
    last = g;
  }
  const bool none = first == n;  // no number: every comparison failed
  if (none) first = 0, last = n - 1;
  out.begin = groups_[first].begin;
  out.end = groups_[last].end;
  // Around the seam of a closed line the nearest segments are at both ends of the list.
  const bool seam = closed_ && (first == 0 || last + 1 == n);
  if (none || seam || stops_.empty()) return out;
  double reach = 0;  // no point of the block is farther from a point of those segments
  for (std::size_t g = first; g <= last; ++g) reach = std::max(reach, (centre - groups_[g].centre).norm() + groups_[g].radius + radius);
  out.stops = stopsFor(reach);
  return out;
}

void LineFinder::find(const Nearby& near, const Block& points, std::size_t count, LineHits& hits) const {
  walkLine({segments_.data(), near.begin, near.end, near.start, near.stops, points, count, hits});
  for (std::size_t p = count; p < kLanes; ++p) {
    hits.x[p] = hits.x[0];
    hits.y[p] = hits.y[0];
    hits.z[p] = hits.z[0];
    hits.square[p] = hits.square[0];
    hits.along[p] = hits.along[0];
    hits.element[p] = hits.element[0];
  }
}

void ballOf(const Block& points, std::size_t count, Vec3& centre, double& radius) {
  Vec3 low(points.x[0], points.y[0], points.z[0]), high = low;
  for (std::size_t p = 1; p < count; ++p) {
    low = low.cwiseMin(Vec3(points.x[p], points.y[p], points.z[p]));
    high = high.cwiseMax(Vec3(points.x[p], points.y[p], points.z[p]));
  }
  centre = 0.5 * (low + high);
  radius = 0.5 * (high - low).norm() * kRounding;
}

}  // namespace fielddeform::gffd::detail
