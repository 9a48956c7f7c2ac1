#include <fielddeform/gffd/detail/line_finder.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace fielddeform::gffd::detail {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kSteepest = 0.9;  // share of a length that the slope may fall at a vertex
constexpr double kRounding = 1 + 1e-9;

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
    segments_.push_back({a, b, length > 0 ? Vec3(ab / length) : Vec3::Zero(), length, 0, 0});
  };
  if (p.type == skeleton::PrimitiveType::Points || n == 1) {
    for (const Vec3& x : p.points) add(x, x);
  } else {
    for (std::size_t i = 0; i + 1 < n; ++i) add(p.points[i], p.points[i + 1]);
    closed_ = p.closed && n > 2;
    if (closed_) add(p.points[n - 1], p.points[0]);
  }
  const std::size_t count = segments_.size();
  for (std::size_t i = 0; i < count; ++i) {
    if (i + 1 == count && !closed_) break;
    LineSegment &s = segments_[i], &t = segments_[(i + 1) % count];
    s.after = t.before = (t.along - s.along).norm();
  }
  const auto size = static_cast<std::size_t>(std::clamp(std::sqrt(static_cast<double>(count) / 2), 1.0, 256.0));
  for (std::size_t begin = 0; begin < count; begin += size) {
    Group g{Vec3::Zero(), 0, 0, static_cast<Index>(begin), static_cast<Index>(std::min(count, begin + size))};
    Box box;
    for (Index i = g.begin; i < g.end; ++i) {
      box.extend(segments_[i].a);
      box.extend(segments_[i].b);
    }
    g.centre = box.center();
    for (Index i = g.begin; i < g.end; ++i) {
      const LineSegment& s = segments_[i];
      g.radius = std::max({g.radius, (s.a - g.centre).norm(), (s.b - g.centre).norm()});
      g.turn = std::max(g.turn, s.length > 0 ? std::max(s.before, s.after) / s.length : kInfinity);
    }
    g.radius *= kRounding;
    groups_.push_back(g);
  }
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
  std::size_t first = n, last = 0, held = 0;
  double turn = 0;
  for (std::size_t g = 0; g < n; ++g) {
    const double d = (centre - groups_[g].centre).norm();
    if (!(d - groups_[g].radius <= limit)) continue;
    first = std::min(first, g);
    last = g;
    ++held;
    turn = std::max(turn, groups_[g].turn);
    out.reach = std::max(out.reach, d + groups_[g].radius + radius);
  }
  if (held == 0) first = 0, last = n - 1, held = 0;  // no number: every comparison failed
  out.begin = groups_[first].begin;
  out.end = groups_[last].end;
  // Around the seam of a closed line the nearest segments are at both ends of the list.
  const bool seam = closed_ && (first == 0 || last + 1 == n);
  out.certain = held == last - first + 1 && !seam && turn * out.reach < kSteepest;
  return out;
}

void LineFinder::find(const Nearby& near, const Block& points, std::size_t count, LineHits& hits) const {
  walkLine({segments_.data(), near.begin, near.end, near.start, near.reach, near.certain, points, count, hits});
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
