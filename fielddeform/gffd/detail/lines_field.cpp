#include <fielddeform/gffd/detail/lines_field.h>
#include <fielddeform/numeric/elementary.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace fielddeform::gffd::detail {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kSteepest = 0.9;     // share of a length that the slope may fall at a vertex
constexpr double kRounding = 1 + 1e-9;
constexpr double kSlopeFloor = 0.05;  // as in field::Field
constexpr int kJumps = 8;
// Nearer to a segment's end than this share of the reach, rounding may prefer its neighbour: both are tried, from either side.
constexpr double kUndecided = 1e-7;

struct Foot {
  double x, y, z, square;
};

}  // namespace

std::optional<LinesField> LinesField::of(const skeleton::Skeleton& skeleton, const field::FieldOptions& options,
                                         double reference) {
  if (options.distance.kind != field::Distance::Exact || options.extension != field::Extension::Linear) return std::nullopt;
  if (options.potential != skeleton::Potential::Exponential) return std::nullopt;
  LinesField f;
  for (const auto& p : skeleton.primitives) {
    if (!(p.weight > 0)) continue;
    if (p.type == skeleton::PrimitiveType::Mesh || !p.radius || !p.pointRadius.empty()) return std::nullopt;
    if (p.potential.value_or(options.potential) != options.potential) return std::nullopt;
    if (!(*p.radius > 1e-100) || !(*p.radius < 1e100)) return std::nullopt;
    for (const Vec3& x : p.points)
      if (!(x.cwiseAbs().maxCoeff() < 1e100)) return std::nullopt;
    f.lines_.push_back(makeLine(p));
  }
  if (f.lines_.empty()) return std::nullopt;
  f.sharpness_ = options.sharpness;
  f.end_ = numeric::exp(-options.sharpness);
  f.slopeFloor_ = kSlopeFloor * (1 - f.end_) / options.sharpness;
  f.reference_ = reference;
  return f;
}

LinesField::Line LinesField::makeLine(const skeleton::Primitive& p) {
  Line line;
  line.term = {*p.radius, p.weight, p.weight == 1};
  const std::size_t n = p.points.size();
  const auto add = [&](const Vec3& a, const Vec3& b) {
    const Vec3 ab = b - a;
    const double length = ab.norm();
    line.segments.push_back({a, b, length > 0 ? Vec3(ab / length) : Vec3::Zero(), length, 0, 0});
  };
  if (p.type == skeleton::PrimitiveType::Points || n == 1) {
    for (const Vec3& x : p.points) add(x, x);
  } else {
    for (std::size_t i = 0; i + 1 < n; ++i) add(p.points[i], p.points[i + 1]);
    line.closed = p.closed && n > 2;
    if (line.closed) add(p.points[n - 1], p.points[0]);
  }
  const std::size_t count = line.segments.size();
  for (std::size_t i = 0; i < count; ++i) {
    if (i + 1 == count && !line.closed) break;
    Segment &s = line.segments[i], &t = line.segments[(i + 1) % count];
    s.after = t.before = (t.along - s.along).norm();
  }
  const auto size = static_cast<std::size_t>(std::clamp(std::sqrt(static_cast<double>(count) / 2), 1.0, 256.0));
  for (std::size_t begin = 0; begin < count; begin += size) {
    Group g{Vec3::Zero(), 0, 0, static_cast<Index>(begin), static_cast<Index>(std::min(count, begin + size))};
    Box box;
    for (Index i = g.begin; i < g.end; ++i) {
      box.extend(line.segments[i].a);
      box.extend(line.segments[i].b);
    }
    g.centre = box.center();
    for (Index i = g.begin; i < g.end; ++i) {
      const Segment& s = line.segments[i];
      g.radius = std::max({g.radius, (s.a - g.centre).norm(), (s.b - g.centre).norm()});
      g.turn = std::max(g.turn, s.length > 0 ? std::max(s.before, s.after) / s.length : kInfinity);
    }
    g.radius *= kRounding;
    line.groups.push_back(g);
  }
  return line;
}

namespace {

template <class Segment>
inline double alongSegment(const Segment& s, double x, double y, double z) {
  return (x - s.a[0]) * s.along[0] + (y - s.a[1]) * s.along[1] + (z - s.a[2]) * s.along[2];
}

// The ends are met exactly, so that neighbours that share one agree to the bit.
template <class Segment>
inline Foot footOn(const Segment& s, double x, double y, double z, double t) {
  double dx = x - s.a[0], dy = y - s.a[1], dz = z - s.a[2];
  if (t >= s.length) {
    if (t > 0) dx = x - s.b[0], dy = y - s.b[1], dz = z - s.b[2];
  } else if (t > 0) {
    dx -= t * s.along[0];
    dy -= t * s.along[1];
    dz -= t * s.along[2];
  }
  return {dx, dy, dz, dx * dx + dy * dy + dz * dz};
}

}  // namespace

LinesField::Nearby LinesField::nearby(const Line& line, const Vec3& centre, double radius) const {
  const std::size_t n = line.groups.size();
  double low = kInfinity;
  std::size_t nearest = 0;
  for (std::size_t g = 0; g < n; ++g) {
    const double d = (centre - line.groups[g].centre).norm() - line.groups[g].radius;
    if (d < low) low = d, nearest = g;
  }
  Nearby out;
  double best = kInfinity;
  for (Index i = line.groups[nearest].begin; i < line.groups[nearest].end; ++i) {
    const Segment& s = line.segments[i];
    const Foot f = footOn(s, centre[0], centre[1], centre[2], alongSegment(s, centre[0], centre[1], centre[2]));
    if (f.square < best) best = f.square, out.start = i;
  }
  const double limit = (std::sqrt(best) + 2 * radius) * kRounding;
  out.least = low - radius;
  std::size_t first = n, last = 0, held = 0;
  double turn = 0;
  for (std::size_t g = 0; g < n; ++g) {
    const double d = (centre - line.groups[g].centre).norm();
    if (!(d - line.groups[g].radius <= limit)) continue;
    first = std::min(first, g);
    last = g;
    ++held;
    turn = std::max(turn, line.groups[g].turn);
    out.reach = std::max(out.reach, d + line.groups[g].radius + radius);
  }
  if (held == 0) first = 0, last = n - 1, held = 0;  // no number: every comparison failed
  out.begin = line.groups[first].begin;
  out.end = line.groups[last].end;
  // Around the seam of a closed line the nearest segments are at both ends of the list.
  const bool seam = line.closed && (first == 0 || last + 1 == n);
  out.certain = held == last - first + 1 && !seam && turn * out.reach < kSteepest;
  return out;
}

void LinesField::walk(const Line& line, const Nearby& near, const Block& points, std::size_t count, LineHits& hits) {
  const Segment* segments = line.segments.data();
  for (std::size_t p = 0; p < count; ++p) {
    const double x = points.x[p], y = points.y[p], z = points.z[p];
    Index at = near.start;
    double t = alongSegment(segments[at], x, y, z);
    for (int jump = 0; jump < kJumps; ++jump) {
      const double length = segments[at].length, share = t / length;
      if (share > -1 && share < 2) break;
      const double to = std::clamp(at + std::floor(share), static_cast<double>(near.begin), static_cast<double>(near.end - 1));
      if (static_cast<Index>(to) == at) break;
      at = static_cast<Index>(to);
      t = alongSegment(segments[at], x, y, z);
    }
    Foot best = footOn(segments[at], x, y, z, t);
    Index found = at;
    double forward = t;
    for (Index i = at; i + 1 < near.end && forward >= segments[i].length - near.reach * (segments[i].after + kUndecided); ++i) {
      forward = alongSegment(segments[i + 1], x, y, z);
      const Foot f = footOn(segments[i + 1], x, y, z, forward);
      if (f.square < best.square) best = f, found = i + 1;
    }
    double back = t;
    for (Index i = at; i > near.begin && back <= near.reach * (segments[i].before + kUndecided); --i) {
      back = alongSegment(segments[i - 1], x, y, z);
      const Foot f = footOn(segments[i - 1], x, y, z, back);
      if (f.square < best.square || (f.square == best.square && i - 1 < found)) best = f, found = i - 1;
    }
    hits.x[p] = best.x;
    hits.y[p] = best.y;
    hits.z[p] = best.z;
    hits.square[p] = best.square;
  }
}

void LinesField::tryAll(const Line& line, const Nearby& near, const Block& points, std::size_t count, LineHits& hits) {
  for (std::size_t p = 0; p < count; ++p) {
    const double x = points.x[p], y = points.y[p], z = points.z[p];
    Foot best{0, 0, 0, kInfinity};
    for (Index i = near.begin; i < near.end; ++i) {
      const Segment& s = line.segments[i];
      const Foot f = footOn(s, x, y, z, alongSegment(s, x, y, z));
      if (f.square < best.square) best = f;
    }
    hits.x[p] = best.x;
    hits.y[p] = best.y;
    hits.z[p] = best.z;
    hits.square[p] = best.square;
  }
}

void LinesField::evaluate(const Block& points, std::size_t count, LineValues& out) const {
  Vec3 low(points.x[0], points.y[0], points.z[0]), high = low;
  for (std::size_t p = 1; p < count; ++p) {
    low = low.cwiseMin(Vec3(points.x[p], points.y[p], points.z[p]));
    high = high.cwiseMax(Vec3(points.x[p], points.y[p], points.z[p]));
  }
  const Vec3 centre = 0.5 * (low + high);
  const double radius = 0.5 * (high - low).norm() * kRounding;
  LineHits hits;
  const auto find = [&](const Line& line, const Nearby& near) {
    near.certain ? walk(line, near, points, count, hits) : tryAll(line, near, points, count, hits);
    for (std::size_t p = count; p < kLanes; ++p) {
      hits.x[p] = hits.x[0];
      hits.y[p] = hits.y[0];
      hits.z[p] = hits.z[0];
      hits.square[p] = hits.square[0];
    }
  };
  if (lines_.size() == 1 && lines_[0].term.plain) {
    find(lines_[0], nearby(lines_[0], centre, radius));
    oneLine(hits, lines_[0].term.radius, reference_, out);
    return;
  }
  LineSums sums{};
  for (const Line& line : lines_) {
    const Nearby near = nearby(line, centre, radius);
    if (near.least > line.term.radius * kRounding) continue;  // adds nothing to any of them
    find(line, near);
    addLine(hits, line.term, sharpness_, end_, sums);
  }
  finishLines(sums, sharpness_, end_, slopeFloor_, reference_, out);
}

}  // namespace fielddeform::gffd::detail
