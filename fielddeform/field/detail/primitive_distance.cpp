#include <fielddeform/field/detail/primitive_distance.h>
#include <fielddeform/skeleton/io.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace fielddeform::field::detail {
namespace {

using skeleton::PrimitiveType;

// Nearer to a solid's surface than this, in radii, the offset is rounding and the triangle's normal tells the direction.
constexpr double kOnSurface = 1e-11;

std::vector<std::array<Index, 3>> elementsOf(const skeleton::Primitive& p) {
  std::vector<std::array<Index, 3>> elements;
  const Index count = static_cast<Index>(p.points.size());
  switch (p.type) {
    case PrimitiveType::Points:
      for (Index i = 0; i < count; ++i) elements.push_back({i, kNoIndex, kNoIndex});
      break;
    case PrimitiveType::Polyline:
      for (Index i = 0; i + 1 < count; ++i) elements.push_back({i, i + 1, kNoIndex});
      if (p.closed && count > 2) elements.push_back({count - 1, 0, kNoIndex});
      break;
    case PrimitiveType::Mesh:
      for (const auto& f : p.faces)
        for (std::size_t k = 2; k < f.size(); ++k) elements.push_back({f[0], f[k - 1], f[k]});
  }
  return elements;
}

spatial::ClosestTree treeOf(const skeleton::Primitive& p, const std::vector<std::array<Index, 3>>& elements) {
  if (p.type == PrimitiveType::Points) return spatial::ClosestTree::ofPoints(p.points);
  if (p.type == PrimitiveType::Mesh) return spatial::ClosestTree::ofTriangles(p.points, elements);
  std::vector<std::array<Index, 2>> segments;
  for (const auto& e : elements) segments.push_back({e[0], e[1]});
  return spatial::ClosestTree::ofSegments(p.points, segments);
}

// Six times the volume's sign, about the mean point so that a distant mesh loses nothing.
double orientationOf(const std::vector<Vec3>& points, const std::vector<std::array<Index, 3>>& triangles) {
  double largest = 0;
  for (const Vec3& p : points) largest = std::max(largest, (p - points[0]).cwiseAbs().maxCoeff());
  if (!(largest > 0)) return 1;
  // Coordinates near one: products of huge or tiny ones would leave the range of doubles.
  const double unit = std::ldexp(1.0, -std::clamp(std::ilogb(largest), -1000, 1000));
  Vec3 centre = Vec3::Zero();
  for (const Vec3& p : points) centre += (p - points[0]) * unit;
  centre /= static_cast<double>(points.size());
  double volume = 0;
  for (const auto& t : triangles) {
    const auto at = [&](int k) { return Vec3((points[t[static_cast<std::size_t>(k)]] - points[0]) * unit - centre); };
    volume += at(0).dot(at(1).cross(at(2)));
  }
  return volume < 0 ? -1 : 1;
}

}  // namespace

PrimitiveDistance::PrimitiveDistance(const skeleton::Primitive& p)
    : corners_(p.type == PrimitiveType::Points ? 1 : p.type == PrimitiveType::Polyline ? 2 : 3),
      points_(p.points),
      elements_(elementsOf(p)),
      pointRadius_(p.pointRadius) {
  if (!p.radius && p.pointRadius.empty())
    throw std::invalid_argument(fmt::format("primitive \"{}\": no radius, needs one > 0", p.name));
  if (elements_.empty())
    throw std::invalid_argument(fmt::format("primitive \"{}\": no triangle, needs at least 1", p.name));
  greatestRadius_ = pointRadius_.empty() ? *p.radius : *std::max_element(pointRadius_.begin(), pointRadius_.end());
  leastRadius_ = pointRadius_.empty() ? *p.radius : *std::min_element(pointRadius_.begin(), pointRadius_.end());
  tree_.emplace(treeOf(p, elements_));
  for (const Vec3& x : p.points) box_.extend(x);
  if (p.type == PrimitiveType::Mesh && p.closed) {
    winding_.emplace(p.points, elements_);
    watertight_ = skeleton::boundsSolid(p.faces);
    orientation_ = orientationOf(p.points, elements_);
  }
}

std::optional<PrimitiveHit> PrimitiveDistance::closest(const Vec3& point, double maxDistance, const ClosestHint& hint) const {
  spatial::ClosestTree::QueryOptions query;
  query.hint = hint.element;
  if (!isSigned() || hint.inside) query.maxDistance = maxDistance;
  const spatial::ClosestPoint c = tree_->closest(point, query);
  if (c.element == kNoIndex) return std::nullopt;
  return hitOf(c, isSigned() && (hint.inside ? *hint.inside : contains(point)));
}

bool PrimitiveDistance::reaches(const Vec3& point, double distance) const {
  return tree_->closest(point, {distance}).element != kNoIndex;
}

void PrimitiveDistance::closestTogether(Points points, double maxDistance, std::span<PrimitiveHit> out,
                                        spatial::ClosestTree::BlockHint& hint) const {
  closestWithin(points, isSigned() ? std::numeric_limits<double>::infinity() : maxDistance, out, hint);
}

void PrimitiveDistance::closestWithin(Points points, double bound, std::span<PrimitiveHit> out,
                                      spatial::ClosestTree::BlockHint& hint) const {
  std::array<spatial::ClosestPoint, kTogether> found;
  std::array<double, kTogether> distance;
  std::array<bool, kTogether> inside{};
  SignedBall known;
  for (std::size_t begin = 0; begin < points.size(); begin += kTogether) {
    const std::size_t n = std::min(kTogether, points.size() - begin);
    const Points some = points.subspan(begin, n);
    tree_->closestTogether(some, std::span(found).first(n), hint, bound);
    for (std::size_t i = 0; i < n; ++i) distance[i] = found[i].element == kNoIndex ? -1 : found[i].distance;
    if (isSigned()) signsOf(some, std::span(distance).first(n), std::span(inside).first(n), known);
    for (std::size_t i = 0; i < n; ++i) {
      if (found[i].element == kNoIndex) out[begin + i].element = kNoIndex;
      else out[begin + i] = hitOf(found[i], inside[i]);
    }
  }
}

// Where the sign changes at the surface alone, the ball around a point that holds no surface has one sign. The farthest points
// come first: their balls hold most of the others, and few ask for a winding number.
void PrimitiveDistance::signsOf(Points points, std::span<const double> distance, std::span<bool> inside, SignedBall& known) const {
  constexpr double kRounding = 1 - 1e-9;
  std::array<std::uint8_t, kTogether> order{};
  std::array<SignedBall, kTogether + 1> balls;
  std::size_t count = 0, made = 0;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (distance[i] >= 0) order[count++] = static_cast<std::uint8_t>(i);
  if (watertight_) {
    std::sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count), [&](std::uint8_t a, std::uint8_t b) {
      return distance[a] != distance[b] ? distance[a] > distance[b] : a < b;
    });
    if (known.clear > 0) balls[made++] = known;
  }
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = order[k];
    const Vec3& p = points[i];
    const auto holds = [&](const SignedBall& b) {
      const Vec3 offset = p - b.centre;
      const double square = offset.squaredNorm();
      return square > 0x1p-960 ? square < b.clear * b.clear : offset.stableNorm() < b.clear;  // below, squares leave the doubles
    };
    const auto end = balls.begin() + static_cast<std::ptrdiff_t>(made), ball = std::find_if(balls.begin(), end, holds);
    inside[i] = ball != end ? ball->inside : contains(p);
    if (!watertight_) continue;
    balls[made++] = {p, distance[i] * kRounding, inside[i]};
    if (k == 0) known = balls[made - 1];
  }
}

PrimitiveHit PrimitiveDistance::hitOf(const spatial::ClosestPoint& c, bool inside) const {
  PrimitiveHit hit;
  hit.point = c.point;
  hit.distance = inside ? -c.distance : c.distance;
  hit.direction = signedDirection(c, inside);
  hit.element = c.element;
  for (int k = 0; k < 3; ++k) hit.vertex[k] = elements_[c.element][static_cast<std::size_t>(k)];
  hit.weight = c.weight;
  return hit;
}

Vec3 PrimitiveDistance::signedDirection(const spatial::ClosestPoint& c, bool inside) const {
  if (isSigned() && c.distance <= kOnSurface * greatestRadius_) {
    const auto& t = elements_[c.element];
    const Vec3 ab = (points_[t[1]] - points_[t[0]]).stableNormalized(), ac = (points_[t[2]] - points_[t[0]]).stableNormalized();
    return orientation_ * ab.cross(ac).stableNormalized();
  }
  const Vec3 away = c.distance > 0x1p-400 && c.distance < 0x1p400 ? Vec3(c.offset / c.distance) : Vec3(c.offset.stableNormalized());
  return inside ? Vec3(-away) : away;
}

double PrimitiveDistance::radiusAt(Index element, const Vec3& weight) const {
  if (pointRadius_.empty() || element == kNoIndex) return greatestRadius_;
  double r = 0;
  for (int k = 0; k < corners_; ++k)
    if (weight[k] != 0) r += weight[k] * pointRadius_[elements_[element][static_cast<std::size_t>(k)]];
  return r;
}

// How the interpolated radius changes as the closest point moves: along the segment or edge, in the plane of the
// triangle, not at all at a corner.
Vec3 PrimitiveDistance::radiusGradient(const PrimitiveHit& hit) const {
  int used[3], count = 0;
  for (int k = 0; k < corners_; ++k)
    if (hit.weight[k] > 0) used[count++] = k;
  if (count < 2) return Vec3::Zero();
  const Vec3& a = points_[hit.vertex[used[0]]];
  const double ra = pointRadius_[hit.vertex[used[0]]];
  const Vec3 e = points_[hit.vertex[used[1]]] - a;
  const double de = pointRadius_[hit.vertex[used[1]]] - ra;
  if (count == 2) {
    const double length = e.stableNorm();
    return length > 0 ? Vec3(e / length * (de / length)) : Vec3::Zero();
  }
  const Vec3 f = points_[hit.vertex[used[2]]] - a;
  const double df = pointRadius_[hit.vertex[used[2]]] - ra;
  const double unit = std::max(e.cwiseAbs().maxCoeff(), f.cwiseAbs().maxCoeff());
  if (!(unit > 0)) return Vec3::Zero();
  const Vec3 eu = e / unit, fu = f / unit, n = eu.cross(fu);
  const double n2 = n.squaredNorm();
  if (!(n2 > 0)) return Vec3::Zero();
  return (de * fu.cross(n) + df * n.cross(eu)) / (n2 * unit);
}

Vec3 PrimitiveDistance::relativeGradient(const PrimitiveHit& hit, double radius) const {
  Vec3 g = hit.direction;
  if (!pointRadius_.empty()) g -= (hit.distance / radius) * radiusGradient(hit);
  return g / radius;
}

}  // namespace fielddeform::field::detail
