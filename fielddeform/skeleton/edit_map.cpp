// Barr, "Global and local deformations of solid primitives", 1984: bend and twist, here about any line, rooted at a
// pivot and exact in length along the line. All are written as x + displacement, zero without rounding where nothing moves.
#include <fielddeform/numeric/elementary.h>
#include <fielddeform/skeleton/detail/edit_target.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace fielddeform::skeleton {
namespace {

using numeric::sincos;

// sin(x) / x
double sinc(double x) { return std::abs(x) < 1e-4 ? 1 - x * x / 6 : sincos(x).sin / x; }

// (1 - cos x) / x
double versine(double x) {
  const double s = sinc(0.5 * x);
  return 0.5 * x * s * s;
}

// cos(x) - 1 without cancellation
double cosLess1(double x) {
  const double s = sincos(0.5 * x).sin;
  return -2 * s * s;
}

Vec3 turned(const Vec3& across, const Vec3& axis, double angle) {
  return cosLess1(angle) * across + sincos(angle).sin * axis.cross(across);
}

double grown(double factor, double t) { return t == 1 ? factor : 1 + (factor - 1) * t; }

}  // namespace

EditMap::EditMap(const Skeleton& rest, const Edit& edit, double t) : time_(t) {
  const detail::Prepared p = detail::prepare(rest, edit);
  begin_ = p.begin;
  end_ = p.end;
  const auto spine = [&](const Spine& s) {
    axis_ = *s.axis;
    pivot_ = *s.pivot;
    about_ = axis_;
  };
  if (const auto* b = std::get_if<Bend>(&p.edit.operation)) {
    kind_ = Kind::Bend;
    spine(b->spine);
    about_ = *b->about;
    amount_ = *b->angle * t;
  } else if (const auto* w = std::get_if<Twist>(&p.edit.operation)) {
    kind_ = Kind::Twist;
    spine(w->spine);
    amount_ = w->angle * t;
  } else if (const auto* a = std::get_if<Taper>(&p.edit.operation)) {
    kind_ = Kind::Taper;
    spine(a->spine);
    amount_ = grown(a->factor, t);
  } else if (const auto* s = std::get_if<Stretch>(&p.edit.operation)) {
    kind_ = Kind::Stretch;
    spine(s->spine);
    amount_ = grown(s->factor, t);
  } else if (const auto* m = std::get_if<Translate>(&p.edit.operation)) {
    kind_ = Kind::Translate;
    vector_ = t * m->by;
  } else if (const auto* r = std::get_if<Rotate>(&p.edit.operation)) {
    kind_ = Kind::Rotate;
    axis_ = about_ = *r->axis;
    pivot_ = *r->pivot;
    amount_ = r->angle * t;
  } else if (const auto* c = std::get_if<Scale>(&p.edit.operation)) {
    kind_ = Kind::Scale;
    pivot_ = *c->pivot;
    for (int k = 0; k < 3; ++k) vector_[k] = grown(c->factor[k], t);
  } else if (const auto* q = std::get_if<Press>(&p.edit.operation)) {
    kind_ = Kind::Press;
    pivot_ = q->point;
    axis_ = q->normal;
    amount_ = q->softness;
  } else {
    throw std::invalid_argument("EditMap: moved points and replacements are no maps of space");
  }
}

double EditMap::share(double s) const {
  return (std::clamp(s, begin_, end_) - std::clamp(0.0, begin_, end_)) / (end_ - begin_);
}

double EditMap::turnAngle(const Vec3& x) const {
  if (kind_ == Kind::Rotate) return amount_;
  return kind_ == Kind::Bend || kind_ == Kind::Twist ? amount_ * share(along(x)) : 0;
}

double EditMap::spread(const Vec3& x) const {
  if (kind_ == Kind::Scale) return vector_[0] == vector_[1] && vector_[1] == vector_[2] ? vector_[0] : 1;
  if (kind_ != Kind::Taper) return 1;
  const double s = std::clamp(along(x), begin_, end_);
  return s == end_ ? amount_ : 1 + (amount_ - 1) * ((s - begin_) / (end_ - begin_));
}

// The section at s turns by phi = angle * share; the line up to it is an arc of length d, then straight.
Vec3 EditMap::bend(double s, const Vec3& across) const {
  const double phi = amount_ * share(s), d = share(s) * (end_ - begin_), beyond = s - std::clamp(s, begin_, end_);
  const Vec3 inward = about_.cross(axis_);
  const double offset = inward.dot(across), sine = sincos(phi).sin, less = cosLess1(phi);
  const double forward = d * (sinc(phi) - 1) + beyond * less - sine * offset;
  const double sideways = d * versine(phi) + beyond * sine + less * offset;
  return forward * axis_ + sideways * inward;
}

Vec3 EditMap::displacement(const Vec3& x) const {
  const Vec3 from = x - pivot_;
  const double s = axis_.dot(from);
  const Vec3 across = from - s * axis_;
  switch (kind_) {
    case Kind::Bend: return bend(s, across);
    case Kind::Twist: return turned(across, axis_, turnAngle(x));
    case Kind::Taper: return (spread(x) - 1) * across;
    case Kind::Stretch: return (amount_ - 1) * share(s) * (end_ - begin_) * axis_;
    case Kind::Translate: return vector_;
    case Kind::Rotate: return turned(across, axis_, amount_);
    case Kind::Scale: return (vector_ - Vec3::Ones()).cwiseProduct(from);
    case Kind::Press: break;
  }
  // Height h above the plane becomes min(h, 0); within the softness w the parabola that joins both smoothly.
  const double w = amount_;
  if (s <= -w) return Vec3::Zero();
  return (-time_ * (s < w ? (s + w) * (s + w) / (4 * w) : s)) * axis_;
}

Vec3 EditMap::operator()(const Vec3& x) const {
  const Vec3 d = displacement(x);
  return d == Vec3::Zero() ? x : Vec3(x + d);  // keeps the sign of zeros, too
}

}  // namespace fielddeform::skeleton
