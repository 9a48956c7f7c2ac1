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
constexpr std::size_t kLeaf = 8, kFan = 4;
constexpr std::size_t kMostLevels = 16;  // of balls: 2^32 segments
constexpr std::size_t kMostLooked = 16;  // balls, for a reach
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
  findBalls();
  if (p.type != skeleton::PrimitiveType::Points && segments_.size() >= kFewest) findStops();
}

void LineFinder::findBalls() {
  const auto enclose = [](std::size_t begin, std::size_t end, auto&& extend, auto&& reach) {
    Box box;
    for (std::size_t i = begin; i < end; ++i) extend(box, i);
    Ball ball{box.center(), 0};
    for (std::size_t i = begin; i < end; ++i) ball.radius = std::max(ball.radius, reach(ball.centre, i));
    ball.radius *= kRounding;
    return ball;
  };
  std::vector<Ball> leaves;
  for (std::size_t begin = 0; begin < segments_.size(); begin += kLeaf)
    leaves.push_back(enclose(begin, std::min(segments_.size(), begin + kLeaf),
                             [&](Box& box, std::size_t i) { box.extend(segments_[i].a), box.extend(segments_[i].b); },
                             [&](const Vec3& centre, std::size_t i) { return std::max((segments_[i].a - centre).norm(), (segments_[i].b - centre).norm()); }));
  balls_.push_back(std::move(leaves));
  while (balls_.back().size() > 1) {
    const std::vector<Ball>& below = balls_.back();
    std::vector<Ball> level;
    for (std::size_t begin = 0; begin < below.size(); begin += kFan)
      level.push_back(enclose(begin, std::min(below.size(), begin + kFan), [&](Box& box, std::size_t i) { box.extend(below[i].centre); },
                              [&](const Vec3& centre, std::size_t i) { return (below[i].centre - centre).norm() + below[i].radius; }));
    balls_.push_back(std::move(level));
  }
}

void LineFinder::findStops() {
  const double size = 2 * balls_.back()[0].radius;
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

// The nearest segment and its squared distance, nearer balls first.
void LineFinder::findNearest(const Vec3& centre, Nearby& out, double& square) const {
  struct Entry {
    std::size_t level, i;
    double least;  // distance
  };
  Entry stack[kMostLevels * kFan];
  std::size_t top = 0;
  double best = kInfinity;  // distance
  stack[top++] = {balls_.size() - 1, 0, 0};
  while (top > 0) {
    const Entry at = stack[--top];
    if (at.least > best) continue;
    if (at.level == 0) {
      const std::size_t end = std::min(segments_.size(), (at.i + 1) * kLeaf);
      for (std::size_t i = at.i * kLeaf; i < end; ++i)
        if (const double s = squareTo(segments_[i], centre); s < square) square = s, out.start = static_cast<Index>(i);
      best = std::sqrt(square) * kRounding;
      continue;
    }
    const std::vector<Ball>& below = balls_[at.level - 1];
    const std::size_t end = std::min(below.size(), (at.i + 1) * kFan), bottom = top;
    for (std::size_t i = at.i * kFan; i < end; ++i) {
      const Entry e{at.level - 1, i, (centre - below[i].centre).norm() - below[i].radius};
      std::size_t place = top++;
      for (; place > bottom && stack[place - 1].least < e.least; --place) stack[place] = stack[place - 1];
      stack[place] = e;
    }
  }
}

// The first, or the last, of the leaves below a ball that come as near as this; none: how many there are.
std::size_t LineFinder::outermost(bool last, std::size_t level, std::size_t i, const Vec3& centre, double distance) const {
  const std::size_t none = balls_[0].size();
  const Ball& ball = balls_[level][i];
  if (!((centre - ball.centre).norm() - ball.radius <= distance)) return none;
  if (level == 0) return i;
  const std::size_t begin = i * kFan, end = std::min(balls_[level - 1].size(), begin + kFan);
  for (std::size_t k = 0; k < end - begin; ++k)
    if (const std::size_t leaf = outermost(last, level - 1, last ? end - 1 - k : begin + k, centre, distance); leaf != none) return leaf;
  return none;
}

// No point of a ball is farther than this from a point of those leaves.
double LineFinder::reachOf(std::size_t first, std::size_t last, const Vec3& centre, double radius) const {
  std::size_t level = 0;
  for (; last - first >= kMostLooked; ++level) first /= kFan, last /= kFan;
  double reach = 0;
  for (std::size_t i = first; i <= last; ++i) reach = std::max(reach, (centre - balls_[level][i].centre).norm() + balls_[level][i].radius);
  return (reach + radius) * kRounding;
}

LineFinder::Nearby LineFinder::nearby(const Vec3& centre, double radius) const {
  Nearby out;
  double square = kInfinity;
  findNearest(centre, out, square);
  const double distance = std::sqrt(square), limit = (distance + 2 * radius) * kRounding;
  out.least = distance / kRounding - radius;
  const std::size_t leaves = balls_[0].size(), top = balls_.size() - 1;
  const std::size_t first = outermost(false, top, 0, centre, limit), last = outermost(true, top, 0, centre, limit);
  out.end = static_cast<Index>(segments_.size());
  if (first == leaves) return out;  // no number: every comparison failed
  out.begin = static_cast<Index>(first * kLeaf);
  out.end = static_cast<Index>(std::min(segments_.size(), (last + 1) * kLeaf));
  // Around the seam of a closed line the nearest segments are at both ends of the list.
  const bool seam = closed_ && (first == 0 || last + 1 == leaves);
  if (!seam && !stops_.empty()) out.stops = stopsFor(reachOf(first, last, centre, radius));
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
