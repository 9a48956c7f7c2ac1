// Written as x + displacement, zero without rounding where nothing moves; the arcs as in skeleton/edit_map.cpp.
#include <fielddeform/map/barr.h>
#include <fielddeform/core/error.h>
#include <fielddeform/numeric/elementary.h>
#include <fielddeform/skeleton/detail/edit_target.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace fielddeform::map {
namespace {

using numeric::sincos;

constexpr std::array<std::string_view, 5> kKinds{"scale", "stretch", "taper", "twist", "bend"};

double sinc(double x) { return std::abs(x) < 1e-4 ? 1 - x * x / 6 : sincos(x).sin / x; }
double versine(double x) {  // (1 - cos x) / x
  const double s = sinc(0.5 * x);
  return 0.5 * x * s * s;
}
double cosLess1(double x) {
  const double s = sincos(0.5 * x).sin;
  return -2 * s * s;
}
Vec3 turned(const Vec3& across, const Vec3& axis, double angle) {
  return cosLess1(angle) * across + sincos(angle).sin * axis.cross(across);
}
Mat3 rotation(const Vec3& axis, double angle) {
  Mat3 r = Mat3::Identity();
  for (int k = 0; k < 3; ++k) {
    const Vec3 e = Vec3::Unit(k);
    r.col(k) += turned(e - axis.dot(e) * axis, axis, angle);
  }
  return r;
}

void requireUnit(const char* name, const Vec3& v) {
  if (!(std::abs(v.norm() - 1) <= 1e-9))
    throw std::invalid_argument(fmt::format("{} has length {}, must be 1", name, v.norm()));
}

}  // namespace

std::string_view toString(BarrKind kind) noexcept { return kKinds[static_cast<std::size_t>(kind)]; }

void BarrEdit::validate() const {
  if (!pivot.allFinite()) throw std::invalid_argument("pivot is not finite");
  requireUnit("axis", axis);
  requireUnit("about", about);
  if (!(std::abs(axis.dot(about)) <= 1e-9)) throw std::invalid_argument("about is not across the axis");
  requireFinite("begin", begin);
  requireFinite("end", end);
  if (!(begin < end)) throw std::invalid_argument(fmt::format("begin is {}, must be < end, {}", begin, end));
  requireFinite("angle", angle);
  for (int k = 0; k < 3; ++k)
    if (!(factor[k] > 0 && factor[k] < std::numeric_limits<double>::infinity()))
      throw std::invalid_argument(fmt::format("factor[{}] is {}, must be finite and > 0", k, factor[k]));
}

std::optional<BarrEdit> barrEditOf(const skeleton::Skeleton& rest, const skeleton::Edit& edit) {
  const skeleton::detail::Prepared p = skeleton::detail::prepare(rest, edit);
  BarrEdit b;
  b.begin = p.begin;
  b.end = p.end;
  const auto spine = [&](const skeleton::Spine& s, BarrKind kind) {
    b.kind = kind;
    b.axis = s.axis->normalized();
    b.pivot = *s.pivot;
    b.about = anyPerpendicular(b.axis);
  };
  if (const auto* bend = std::get_if<skeleton::Bend>(&p.edit.operation)) {
    spine(bend->spine, BarrKind::Bend);
    b.about = (*bend->about - b.axis.dot(*bend->about) * b.axis).normalized();
    b.angle = *bend->angle;
  } else if (const auto* twist = std::get_if<skeleton::Twist>(&p.edit.operation)) {
    spine(twist->spine, BarrKind::Twist);
    b.angle = twist->angle;
  } else if (const auto* taper = std::get_if<skeleton::Taper>(&p.edit.operation)) {
    spine(taper->spine, BarrKind::Taper);
    b.factor = Vec3(taper->factor, taper->factor, 1);
  } else if (const auto* stretch = std::get_if<skeleton::Stretch>(&p.edit.operation)) {
    spine(stretch->spine, BarrKind::Stretch);
    b.factor = Vec3(stretch->factor, 1, 1);
  } else if (const auto* scale = std::get_if<skeleton::Scale>(&p.edit.operation)) {
    b.kind = BarrKind::Scale;
    b.pivot = *scale->pivot;
    b.factor = scale->factor;
    b.begin = 0;
    b.end = 1;
  } else {
    return std::nullopt;
  }
  b.validate();
  return b;
}

BarrMap::BarrMap(const BarrEdit& edit, const Quat& turn, const Vec3& shift) : edit_(edit), turn_(turn), shift_(shift) {
  edit_.validate();
  if (!(std::abs(turn.norm() - 1) <= 1e-9) || !shift.allFinite())
    throw std::invalid_argument("turn must be a unit quaternion and shift finite");
  second_ = edit_.axis.cross(edit_.about);
  moved_ = !shift.isZero(0) || !turn.vec().isZero(0);
}

double BarrMap::share(double s) const {
  return (std::clamp(s, edit_.begin, edit_.end) - std::clamp(0.0, edit_.begin, edit_.end)) / (edit_.end - edit_.begin);
}

double BarrMap::slope(double s) const { return s >= edit_.begin && s <= edit_.end ? 1 / (edit_.end - edit_.begin) : 0; }

Eigen::Vector2d BarrMap::growth(double s, Eigen::Vector2d* derivative) const {
  const double range = edit_.end - edit_.begin, t = (std::clamp(s, edit_.begin, edit_.end) - edit_.begin) / range;
  const double inside = slope(s);
  Eigen::Vector2d g(1 + (edit_.factor[0] - 1) * t, 1 + (edit_.factor[1] - 1) * t);
  Eigen::Vector2d d((edit_.factor[0] - 1) * inside, (edit_.factor[1] - 1) * inside);
  if (edit_.law == TaperLaw::AreaPreserving) {
    g[1] = 1 / g[0];
    d[1] = -d[0] * g[1] * g[1];
  }
  if (derivative) *derivative = d;
  return g;
}

Vec3 BarrMap::barr(const Vec3& from) const {
  const double s = edit_.axis.dot(from);
  const Vec3 across = from - s * edit_.axis;
  switch (edit_.kind) {
    case BarrKind::Scale: {
      Vec3 d = Vec3::Zero();
      if (edit_.factor[0] != 1) d += (edit_.factor[0] - 1) * edit_.about.dot(from) * edit_.about;
      if (edit_.factor[1] != 1) d += (edit_.factor[1] - 1) * second_.dot(from) * second_;
      if (edit_.factor[2] != 1) d += (edit_.factor[2] - 1) * s * edit_.axis;
      return d;
    }
    case BarrKind::Stretch: return (edit_.factor[0] - 1) * share(s) * (edit_.end - edit_.begin) * edit_.axis;
    case BarrKind::Taper: {
      const Eigen::Vector2d g = growth(s, nullptr);
      return (g[0] - 1) * edit_.about.dot(across) * edit_.about + (g[1] - 1) * second_.dot(across) * second_;
    }
    case BarrKind::Twist: return turned(across, edit_.axis, edit_.angle * share(s));
    case BarrKind::Bend: break;
  }
  const double phi = edit_.angle * share(s), arc = share(s) * (edit_.end - edit_.begin);
  const double beyond = s - std::clamp(s, edit_.begin, edit_.end);
  const Vec3 inward = edit_.about.cross(edit_.axis);
  const double offset = inward.dot(across), sine = sincos(phi).sin, less = cosLess1(phi);
  return (arc * (sinc(phi) - 1) + beyond * less - sine * offset) * edit_.axis +
         (arc * versine(phi) + beyond * sine + less * offset) * inward;
}

Mat3 BarrMap::barrJacobian(const Vec3& from) const {
  const Vec3& a = edit_.axis;
  const double s = a.dot(from);
  const Vec3 across = from - s * a;
  switch (edit_.kind) {
    case BarrKind::Scale:
      return edit_.factor[0] * edit_.about * edit_.about.transpose() + edit_.factor[1] * second_ * second_.transpose() +
             edit_.factor[2] * a * a.transpose();
    case BarrKind::Stretch:
      return Mat3::Identity() + (edit_.factor[0] - 1) * slope(s) * (edit_.end - edit_.begin) * a * a.transpose();
    case BarrKind::Taper: {
      Eigen::Vector2d d;
      const Eigen::Vector2d g = growth(s, &d);
      const Vec3 drift = d[0] * edit_.about.dot(across) * edit_.about + d[1] * second_.dot(across) * second_;
      return g[0] * edit_.about * edit_.about.transpose() + g[1] * second_ * second_.transpose() + (a + drift) * a.transpose();
    }
    case BarrKind::Twist: {
      const Mat3 r = rotation(a, edit_.angle * share(s));
      return r + edit_.angle * slope(s) * (r * a.cross(across)) * a.transpose();
    }
    case BarrKind::Bend: break;
  }
  const Mat3 r = rotation(edit_.about, edit_.angle * share(s));
  return r + edit_.angle * slope(s) * (r * edit_.about.cross(across)) * a.transpose();
}

Vec3 BarrMap::displacement(const Vec3& rest) const {
  const Vec3 from = rest - edit_.pivot, d = barr(from);
  if (!moved_) return d;
  const Vec3 x = from + d;
  return d + shift_ + (turn_ * x - x);
}

Mat3 BarrMap::jacobian(const Vec3& rest) const {
  const Mat3 j = barrJacobian(rest - edit_.pivot);
  return moved_ ? Mat3(turn_.toRotationMatrix() * j) : j;
}

Vec3 BarrMap::normal(const Vec3& rest, const Vec3& n) const {
  const Mat3 j = jacobian(rest);
  Mat3 cofactor;  // det J J^-T, also where J is singular
  for (int k = 0; k < 3; ++k) cofactor.col(k) = j.col((k + 1) % 3).cross(j.col((k + 2) % 3));
  const Vec3 image = cofactor * n;
  const double length = image.norm();
  return length > 0 ? Vec3(image / length) : n;
}

Vec3 BarrMap::inverse(const Vec3& image) const {
  Vec3 x = image - edit_.pivot;
  if (moved_) x = turn_.conjugate() * (x - shift_);
  return edit_.pivot + barrInverse(x);
}

Vec3 BarrMap::barrInverse(const Vec3& image) const {
  const Vec3& a = edit_.axis;
  const double s = a.dot(image);
  const Vec3 across = image - s * a;
  switch (edit_.kind) {
    case BarrKind::Scale:
      return edit_.about.dot(image) / edit_.factor[0] * edit_.about + second_.dot(image) / edit_.factor[1] * second_ +
             s / edit_.factor[2] * a;
    case BarrKind::Stretch: {
      const double origin = std::clamp(0.0, edit_.begin, edit_.end), f = edit_.factor[0];
      const double low = origin + f * (edit_.begin - origin), high = origin + f * (edit_.end - origin);
      const double back = s < low ? edit_.begin + (s - low) : s > high ? edit_.end + (s - high) : origin + (s - origin) / f;
      return across + back * a;
    }
    case BarrKind::Taper: {
      const Eigen::Vector2d g = growth(s, nullptr);
      return edit_.about.dot(across) / g[0] * edit_.about + second_.dot(across) / g[1] * second_ + s * a;
    }
    case BarrKind::Twist: return image + turned(across, a, -edit_.angle * share(s));
    case BarrKind::Bend: break;
  }
  return unbend(image);
}

// Three candidates, straight before the range, the arc, straight behind it: that whose image is nearest.
Vec3 BarrMap::unbend(const Vec3& image) const {
  const Vec3 &a = edit_.axis, inward = edit_.about.cross(a);
  const double curvature = edit_.angle / (edit_.end - edit_.begin), origin = std::clamp(0.0, edit_.begin, edit_.end);
  const double side = edit_.about.dot(image);
  Vec3 best = image;
  double least = std::numeric_limits<double>::infinity();
  const auto consider = [&](double s, double offset) {
    const Vec3 x = s * a + offset * inward + side * edit_.about;
    const double miss = (x + barr(x) - image).norm();
    if (miss < least) least = miss, best = x;
  };
  for (const double end : {edit_.begin, edit_.end}) {
    const double phi = curvature * (end - origin), arc = end - origin;
    const Vec3 from = image - (origin + arc * sinc(phi)) * a - arc * versine(phi) * inward;
    const Vec3 back = from + turned(from - edit_.about.dot(from) * edit_.about, edit_.about, -phi);
    const double s = end + a.dot(back);
    if (end == edit_.begin ? s <= end : s >= end) consider(s, inward.dot(back));
  }
  if (curvature != 0) {
    const Vec3 v = image - origin * a - inward / curvature;
    const double x = -inward.dot(v) * (curvature > 0 ? 1 : -1), y = a.dot(v) * (curvature > 0 ? 1 : -1);
    const double turnFull = 2 * 3.14159265358979323846;
    double phi = numeric::atan2(y, x) * 1.0;
    const double middle = curvature * (0.5 * (edit_.begin + edit_.end) - origin);
    phi += turnFull * std::round((middle - phi) / turnFull);
    const double s = origin + phi / curvature;
    if (s >= edit_.begin && s <= edit_.end) consider(s, 1 / curvature - std::hypot(x, y) * (curvature > 0 ? 1 : -1));
  } else {
    consider(a.dot(image), inward.dot(image));
  }
  return best;
}

}  // namespace fielddeform::map
