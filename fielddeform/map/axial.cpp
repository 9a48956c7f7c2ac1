#include <fielddeform/core/error.h>
#include <fielddeform/core/rigid.h>
#include <fielddeform/map/axial.h>
#include <fielddeform/map/detail/feet.h>
#include <fielddeform/map/detail/jet_curve.h>
#include <fielddeform/map/detail/line_curves.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace fielddeform::map {
namespace {

using namespace detail;

constexpr int kSteps = 8;  // rotations a span

Quat turnAbout(const Vec3& unitAxis, double angle) {
  const auto half = numeric::sincos(0.5 * angle);
  return Quat(half.cos, half.sin * unitAxis.x(), half.sin * unitAxis.y(), half.sin * unitAxis.z());
}

Vec3 tangent(const SplineCurve::Place& p) {
  const double speed = p.first.norm();
  return speed > 0 ? Vec3(p.first / speed) : Vec3::Zero();
}

// How the rotation-minimising frame of a curve turns: T x dT/dt.
Vec3 turning(const SplineCurve::Place& p) {
  const double speed = p.first.norm();
  return speed > 0 ? Vec3(p.first.cross(p.second) / (speed * speed)) : Vec3::Zero();
}

// A rotation along the axis: unit quaternions and their derivatives at even steps, cubic between.
struct Rotations {
  std::vector<double> t;
  std::vector<Eigen::Vector4d> q, slope;

  // q of unit length and dq/dt.
  std::pair<Quat, Quat> at(double x) const {
    const auto above = std::upper_bound(t.begin() + 1, t.end() - 1, x);
    const auto i = static_cast<std::size_t>(above - t.begin()) - 1;
    const double h = t[i + 1] - t[i], u = std::clamp((x - t[i]) / h, 0.0, 1.0), v = 1 - u;
    const Eigen::Vector4d p = v * v * (1 + 2 * u) * q[i] + u * u * (3 - 2 * u) * q[i + 1] + h * u * v * (v * slope[i] - u * slope[i + 1]);
    const Eigen::Vector4d d = 6 * u * v / h * (q[i + 1] - q[i]) + v * (v - 2 * u) * slope[i] + u * (u - 2 * v) * slope[i + 1];
    const double n = p.norm();
    const Eigen::Vector4d unit = p / n;
    return {Quat(unit), Quat(Eigen::Vector4d((d - unit.dot(d) * unit) / n))};
  }
};

Quat product(const Vec3& turn, const Quat& q) { return Quat(0, turn.x(), turn.y(), turn.z()) * q; }

Rotations rotationsOf(const LineCurves& c, const Quat& start) {
  Rotations r;
  const std::vector<double>& spans = c.rest.parameter();
  for (std::size_t i = 0; i + 1 < spans.size(); ++i)
    for (int k = 0; k < kSteps; ++k) r.t.push_back(spans[i] + (spans[i + 1] - spans[i]) * k / kSteps);
  r.t.push_back(spans.back());
  const std::size_t n = r.t.size();
  // A closed curve's end is its start, where at() goes round.
  const auto place = [&](const SplineCurve& curve, std::size_t i) { return curve.at(i + 1 == n && curve.closed() ? r.t[0] : r.t[i]); };
  std::vector<Quat> q(n);
  Vec3 t0 = tangent(place(c.rest, 0)), t1 = tangent(place(c.posed, 0));
  q[0] = (minimalRotation(start * t0, t1) * start).normalized();
  for (std::size_t i = 1; i < n; ++i) {
    const Vec3 u0 = tangent(place(c.rest, i)), u1 = tangent(place(c.posed, i));
    q[i] = minimalRotation(t1, u1) * q[i - 1] * minimalRotation(t0, u0).conjugate();
    q[i] = (minimalRotation(q[i] * u0, u1) * q[i]).normalized();
    t0 = u0;
    t1 = u1;
  }
  double closing = 0;  // what a closed line's frames miss after one round
  if (c.rest.closed()) {
    const Quat gap = q[0] * q[n - 1].conjugate();
    closing = 2 * numeric::atan2(gap.vec().dot(tangent(place(c.posed, 0))), gap.w());
    closing -= 2 * 3.14159265358979323846 * std::round(closing / (2 * 3.14159265358979323846));
  }
  const double length = r.t.back() - r.t.front(), first = c.numbers.at(r.t[0]).point[0];
  for (std::size_t i = 0; i < n; ++i) {
    const SplineCurve::Place p0 = place(c.rest, i), p1 = place(c.posed, i), roll = place(c.numbers, i);
    const double share = closing * (r.t[i] - r.t[0]) / length;
    q[i] = (turnAbout(tangent(p1), share + roll.point[0] - first) * q[i]).normalized();
    if (i > 0 && q[i].dot(q[i - 1]) < 0) q[i].coeffs() = -q[i].coeffs();
    const Vec3 turn1 = turning(p1) + (roll.first[0] + closing / length) * tangent(p1);
    r.q.push_back(q[i].coeffs());
    r.slope.push_back(0.5 * (product(turn1, q[i]).coeffs() - (q[i] * product(turning(p0), Quat::Identity())).coeffs()));
  }
  return r;
}

}  // namespace

struct AxialMap::Axis {
  LineCurves curves;
  Rotations rotations;

  struct Motion {
    JetVec move;                 // displacement of x
    Jet nearness;                // d / r
    std::array<Jet, 4> rotation; // x, y, z, w
  };

  Motion at(const Vec3& rest, const SplineCurve::Foot* foot) const {
    const JetVec x{rest, Mat3::Identity()};
    const Jet t = foot ? closestAt(curves.rest, x, *foot) : closestAt(curves.rest, x);
    const SplineCurve::Place p0 = curves.rest.at(t.v), p1 = curves.posed.at(t.v), number = curves.numbers.at(t.v);
    const auto [q, slope] = rotations.at(t.v - wraps(t.v));
    const JetVec offset = x - pointAt(p0, t);
    const Jet scale{number.point[1], number.first[1] * t.g}, radius{number.point[2], number.first[2] * t.g};
    const Vec3 turned = q * offset.v;
    const Vec3 change = 2 * (slope * Quat(0, offset.v.x(), offset.v.y(), offset.v.z()) * q.conjugate()).vec();
    const JetVec rotated{turned, q.toRotationMatrix() * offset.j + change * t.g.transpose()};
    const JetVec move{p1.point - p0.point, (p1.first - p0.first) * t.g.transpose()};
    Motion m{move + (scale * rotated - offset), norm(offset) / radius, {}};
    for (int c = 0; c < 4; ++c) m.rotation[static_cast<std::size_t>(c)] = {q.coeffs()[c], slope.coeffs()[c] * t.g};
    return m;
  }

  double wraps(double t) const {
    if (!curves.rest.closed()) return 0;
    const double length = curves.rest.end() - curves.rest.begin();
    return length * std::floor((t - curves.rest.begin()) / length);
  }
};

// Quaternions of one sign where axes are nearest, so that their mean turns the short way.
void AxialMap::alignSigns(std::vector<Axis>& axes) {
  Axis& last = axes.back();
  const Vec3 start = last.curves.rest.at(last.curves.rest.begin()).point;
  double nearest = std::numeric_limits<double>::infinity(), dot = 0;
  for (std::size_t i = 0; i + 1 < axes.size(); ++i) {
    const SplineCurve::Foot foot = axes[i].curves.rest.closest(start);
    const double d = (axes[i].curves.rest.at(foot.t).point - start).norm();
    if (!(d < nearest)) continue;
    nearest = d;
    dot = axes[i].rotations.at(foot.t - axes[i].wraps(foot.t)).first.coeffs().dot(last.rotations.q[0]);
  }
  if (dot >= 0) return;
  for (auto& q : last.rotations.q) q = -q;
  for (auto& q : last.rotations.slope) q = -q;
}

AxialMap::~AxialMap() = default;

AxialMap::AxialMap(const SkeletonMotion& motion, double sharpness) : sharpness_(sharpness), identity_(motion.unedited) {
  if (!(sharpness > 0 && std::isfinite(sharpness))) throw std::invalid_argument("sharpness must be finite and > 0");
  auto axes = std::make_shared<std::vector<Axis>>();
  for (Index i = 0; i < motion.rest.primitives.size(); ++i) {
    LineCurves curves = lineCurves(motion, i, "axial");
    const Quat start = motion.samples.rotation[motion.samples.set.vertexSample[i][curves.points[0]]];
    Rotations rotations = rotationsOf(curves, start);
    axes->push_back({std::move(curves), std::move(rotations)});
    if (i > 0) alignSigns(*axes);
  }
  axes_ = std::move(axes);
  restNumbers_ = restNumbers(motion);
}

std::shared_ptr<RestSide> AxialMap::keepRest(Points rest) const {
  return feetOf(rest, axes_->size(), [&](std::size_t i) -> const SplineCurve& { return (*axes_)[i].curves.rest; });
}

Vec3 AxialMap::displacementOf(const RestSide& side, std::size_t i, const Vec3& rest) const {
  return identity_ ? Vec3(Vec3::Zero()) : moveOf(rest, static_cast<const Feet&>(side).of(i)).v;
}

// The mean of the axes' motions as dual quaternions, weighted by exp(-k u), the least u taken off. In coordinates whose
// origin is the point, the mean motion's translation is its displacement.
detail::JetVec AxialMap::moveOf(const Vec3& rest, const SplineCurve::Foot* feet) const {
  if (axes_->size() == 1) return axes_->front().at(rest, feet).move;
  std::vector<Axis::Motion> all;
  double least = std::numeric_limits<double>::infinity();
  for (const Axis& axis : *axes_) {
    all.push_back(axis.at(rest, feet ? feet + all.size() : nullptr));
    least = std::min(least, all.back().nearness.v);
  }
  std::array<Jet, 4> real{}, dual{};
  for (const Axis::Motion& m : all) {
    const Jet w = exp(-sharpness_ * (m.nearness - least));
    const auto& [x, y, z, s] = m.rotation;
    std::array<Jet, 3> t;
    for (int c = 0; c < 3; ++c) t[static_cast<std::size_t>(c)] = {0.5 * m.move.v[c], 0.5 * m.move.j.row(c).transpose()};
    const std::array<Jet, 4> product{t[0] * s + t[1] * z - t[2] * y, t[1] * s + t[2] * x - t[0] * z, t[2] * s + t[0] * y - t[1] * x,
                                     -(t[0] * x + t[1] * y + t[2] * z)};
    for (std::size_t c = 0; c < 4; ++c) {
      real[c] = real[c] + w * m.rotation[c];
      dual[c] = dual[c] + w * product[c];
    }
  }
  return translationOf(real, dual);
}

Vec3 AxialMap::displacement(const Vec3& rest) const { return identity_ ? Vec3(Vec3::Zero()) : moveOf(rest).v; }
Mat3 AxialMap::jacobian(const Vec3& rest) const { return identity_ ? Mat3(Mat3::Identity()) : Mat3(Mat3::Identity() + moveOf(rest).j); }

}  // namespace fielddeform::map
