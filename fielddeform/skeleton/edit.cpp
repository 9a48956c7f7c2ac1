#include <fielddeform/core/error.h>
#include <fielddeform/numeric/elementary.h>
#include <fielddeform/skeleton/detail/edit_target.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

namespace fielddeform::skeleton {
namespace {

Quat turnAbout(const Vec3& axis, double angle) {
  const numeric::SinCos h = numeric::sincos(0.5 * angle);
  const Vec3 v = h.sin * axis;
  return Quat(h.cos, v.x(), v.y(), v.z());
}

// The part of a twist that turns about a polyline's own tangent. From the point nearest to the unturned section, each
// segment adds its share of the turn times the cosine between tangent and axis: a line along the axis takes up all of
// it, a line across nothing. The result does not depend on the line's direction, but for the sign of the tangent.
void addRoll(Primitive& p, const std::vector<Vec3>& before, const EditMap& map) {
  const std::size_t n = p.points.size();
  std::vector<double> angle(n), roll(n, 0.0);
  std::size_t anchor = 0;
  for (std::size_t i = 0; i < n; ++i) {
    angle[i] = map.turnAngle(before[i]);
    if (std::abs(angle[i]) < std::abs(angle[anchor])) anchor = i;
  }
  const auto cosine = [&](std::size_t i) {  // of segment i, from point i on
    const Vec3 d = p.points[i + 1] - p.points[i];
    const double length = d.norm();
    return length > 0 ? map.turnAxis().dot(d) / length : 0.0;
  };
  const std::size_t in = anchor == 0 ? 0 : anchor - 1, out = anchor + 1 == n ? n - 2 : anchor;
  roll[anchor] = angle[anchor] * 0.5 * (cosine(in) + cosine(out));
  for (std::size_t i = anchor + 1; i < n; ++i) roll[i] = roll[i - 1] + (angle[i] - angle[i - 1]) * cosine(i - 1);
  for (std::size_t i = anchor; i > 0; --i) roll[i - 1] = roll[i] + (angle[i - 1] - angle[i]) * cosine(i - 1);
  if (std::all_of(roll.begin(), roll.end(), [](double r) { return r == 0; })) return;
  if (p.roll.empty()) p.roll.assign(n, 0.0);
  for (std::size_t i = 0; i < n; ++i) p.roll[i] += roll[i];
}

// Orientation of point sets: a rotation turns all, a bend or twist a single point.
void addRotation(Primitive& p, const Vec3& before, const EditMap& map, bool rigid) {
  if (!rigid && p.points.size() != 1) return;
  const double angle = map.turnAngle(before);
  if (angle == 0) return;
  p.rotation = (turnAbout(map.turnAxis(), angle) * p.rotation.value_or(Quat::Identity())).normalized();
}

void scaleRadii(Primitive& p, const std::vector<Vec3>& before, const EditMap& map, bool sections) {
  std::vector<double> factor;
  bool any = false;
  for (const Vec3& x : before) {
    factor.push_back(map.spread(x));
    any = any || factor.back() != 1;
  }
  if (!any) return;
  if (!p.radius && p.pointRadius.empty())
    throw std::invalid_argument(fmt::format("primitive \"{}\" has no radius that could be scaled (fillRadius gives one)", p.name));
  if (sections) {
    if (p.pointRadius.empty()) p.pointRadius.assign(p.points.size(), *p.radius);
  } else if (p.radius) {
    *p.radius *= factor[0];
  }
  for (std::size_t i = 0; i < p.pointRadius.size(); ++i) p.pointRadius[i] *= factor[i];
}

void applyMap(Primitive& p, const EditMap& map, const Edit& edit) {
  const std::vector<Vec3> before = p.points;
  for (Vec3& x : p.points) x = map(x);
  const bool twist = std::holds_alternative<Twist>(edit.operation), bend = std::holds_alternative<Bend>(edit.operation);
  const bool rigid = std::holds_alternative<Rotate>(edit.operation), taper = std::holds_alternative<Taper>(edit.operation);
  if (p.type == PrimitiveType::Polyline && twist) addRoll(p, before, map);
  if (p.type == PrimitiveType::Points && (twist || bend || rigid)) addRotation(p, before[0], map, rigid);
  if (taper || std::holds_alternative<Scale>(edit.operation)) scaleRadii(p, before, map, taper);
}

void applyMove(Primitive& p, const MovePoints& move, double t) {
  for (const Index i : move.points)  // an edit before this one may have replaced the primitive
    if (i >= p.points.size())
      throw std::invalid_argument(fmt::format("move of \"{}\": point {}, the last one is {}", p.name, i, p.points.size() - 1));
  for (std::size_t k = 0; k < move.points.size(); ++k) p.points[move.points[k]] += t * move.by[move.by.size() == 1 ? 0 : k];
}

void applyReplace(Primitive& p, const Replace& replace, double t) {
  Primitive with = replace.with;
  with.name = p.name;
  if (t < 1 && with.type == p.type && with.points.size() == p.points.size())
    for (std::size_t i = 0; i < p.points.size(); ++i) with.points[i] = (1 - t) * p.points[i] + t * with.points[i];
  p = std::move(with);
}

Primitive subdivided(const Primitive& p, double maxLength, std::size_t& budget) {
  if (p.type != PrimitiveType::Polyline) return p;
  Primitive out = p;
  out.points.clear(), out.pointRadius.clear(), out.roll.clear();
  const std::size_t n = p.points.size(), segments = p.closed ? n : n - 1;
  const auto add = [&](std::size_t a, std::size_t b, double w) {
    const auto mix = [w](const auto& x, const auto& y) { return x + w * (y - x); };
    out.points.push_back(w == 0 ? p.points[a] : Vec3(mix(p.points[a], p.points[b])));
    if (!p.pointRadius.empty()) out.pointRadius.push_back(w == 0 ? p.pointRadius[a] : mix(p.pointRadius[a], p.pointRadius[b]));
    if (!p.roll.empty()) out.roll.push_back(w == 0 ? p.roll[a] : mix(p.roll[a], p.roll[b]));
  };
  for (std::size_t i = 0; i < segments; ++i) {
    const std::size_t next = (i + 1) % n;
    // The last digits of a length must not decide between n and n + 1 parts.
    const double parts = std::max(1.0, std::ceil((p.points[next] - p.points[i]).norm() / maxLength * (1 - 1e-12)));
    if (!(parts <= static_cast<double>(budget)))
      throw std::invalid_argument(fmt::format("subdivide: maxLength is {}, too short: more than 10 million points", maxLength));
    budget -= static_cast<std::size_t>(parts);
    for (double k = 0; k < parts; ++k) add(i, next, k / parts);
  }
  if (!p.closed) add(n - 1, n - 1, 0);
  return out;
}

}  // namespace

std::string_view operationName(const Edit& edit) noexcept {
  constexpr std::array<std::string_view, 10> names = {"bend",   "twist", "taper", "stretch", "translate",
                                                      "rotate", "scale", "move",  "press",   "replace"};
  return names[edit.operation.index()];
}

std::vector<Edit> resolve(const Skeleton& rest, std::span<const Edit> edits) {
  std::vector<Edit> resolved;
  for (const Edit& edit : edits) resolved.push_back(detail::prepare(rest, edit).edit);
  return resolved;
}

Skeleton applyEdits(const Skeleton& rest, std::span<const Edit> edits) { return applyEditsAt(rest, edits, 1); }

Skeleton applyEditsAt(const Skeleton& rest, std::span<const Edit> edits, double t) {
  requireInRange("t", t, 0, 1);
  Skeleton posed = rest;
  for (const Edit& edit : edits) {
    // Checked at every time, so that a sequence does not fail after its first frames.
    const Edit prepared = detail::prepare(rest, edit).edit;
    if (t == 0) continue;
    for (const Index i : detail::targetsOf(rest, edit)) {
      Primitive& p = posed.primitives[i];
      if (const auto* move = std::get_if<MovePoints>(&prepared.operation)) applyMove(p, *move, t);
      else if (const auto* replace = std::get_if<Replace>(&prepared.operation)) applyReplace(p, *replace, t);
      else applyMap(p, EditMap(rest, prepared, t), prepared);
    }
  }
  validate(posed);
  return posed;
}

void fillRadius(Skeleton& skeleton, double radius) {
  requirePositive("radius", radius);
  for (Primitive& p : skeleton.primitives)
    if (!p.radius && p.pointRadius.empty()) p.radius = radius;
}

Skeleton subdivide(const Skeleton& skeleton, double maxLength) {
  requirePositive("maxLength", maxLength);
  Skeleton out;
  out.extras = skeleton.extras;
  std::size_t budget = 10'000'000;
  for (const Primitive& p : skeleton.primitives) out.primitives.push_back(subdivided(p, maxLength, budget));
  return out;
}

}  // namespace fielddeform::skeleton
