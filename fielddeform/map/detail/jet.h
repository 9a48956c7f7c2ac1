#pragma once

#include <fielddeform/core/types.h>
#include <fielddeform/numeric/elementary.h>

#include <array>
#include <cmath>

namespace fielddeform::map::detail {

/// A number with its gradient by the point: forward differentiation, for formulas whose derivatives by hand would be
/// a page of terms.
struct Jet {
  double v = 0;
  Vec3 g = Vec3::Zero();
};

inline Jet operator+(const Jet& a, const Jet& b) { return {a.v + b.v, a.g + b.g}; }
inline Jet operator-(const Jet& a, const Jet& b) { return {a.v - b.v, a.g - b.g}; }
inline Jet operator-(const Jet& a) { return {-a.v, -a.g}; }
inline Jet operator*(const Jet& a, const Jet& b) { return {a.v * b.v, a.v * b.g + b.v * a.g}; }
inline Jet operator/(const Jet& a, const Jet& b) {
  const double q = a.v / b.v;
  return {q, (a.g - q * b.g) / b.v};
}
inline Jet operator+(const Jet& a, double b) { return {a.v + b, a.g}; }
inline Jet operator-(const Jet& a, double b) { return {a.v - b, a.g}; }
inline Jet operator*(double a, const Jet& b) { return {a * b.v, a * b.g}; }

/// A vector with its derivative by the point, row = component.
struct JetVec {
  Vec3 v = Vec3::Zero();
  Mat3 j = Mat3::Zero();
};

inline JetVec operator+(const JetVec& a, const JetVec& b) { return {a.v + b.v, a.j + b.j}; }
inline JetVec operator-(const JetVec& a, const JetVec& b) { return {a.v - b.v, a.j - b.j}; }
inline JetVec operator*(const Jet& s, const JetVec& a) { return {s.v * a.v, s.v * a.j + a.v * s.g.transpose()}; }
inline JetVec operator*(double s, const JetVec& a) { return {s * a.v, s * a.j}; }
inline Jet dot(const JetVec& a, const JetVec& b) { return {a.v.dot(b.v), a.j.transpose() * b.v + b.j.transpose() * a.v}; }

inline Mat3 crossMatrix(const Vec3& a) {
  Mat3 m;
  m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return m;
}
inline JetVec cross(const JetVec& a, const JetVec& b) {
  return {a.v.cross(b.v), crossMatrix(a.v) * b.j - crossMatrix(b.v) * a.j};
}

/// Length; at zero its gradient is taken as zero.
inline Jet norm(const JetVec& a) {
  const double n = a.v.norm();
  return {n, n > 0 ? Vec3(a.j.transpose() * a.v / n) : Vec3::Zero()};
}
inline Jet exp(const Jet& a) {
  const double e = numeric::exp(a.v);
  return {e, e * a.g};
}

/// 2 vec(dual * conj(real)) / |real|^2: the translation of a sum of dual quaternions (x, y, z, w); zero where they cancel.
inline JetVec translationOf(const std::array<Jet, 4>& real, const std::array<Jet, 4>& dual) {
  Jet n;
  for (const Jet& r : real) n = n + r * r;
  JetVec out;
  if (!(n.v > 1e-24)) return out;
  const std::array<Jet, 3> v{dual[0] * real[3] - dual[3] * real[0] - dual[1] * real[2] + dual[2] * real[1],
                             dual[1] * real[3] - dual[3] * real[1] - dual[2] * real[0] + dual[0] * real[2],
                             dual[2] * real[3] - dual[3] * real[2] - dual[0] * real[1] + dual[1] * real[0]};
  for (int c = 0; c < 3; ++c) {
    const Jet d = 2.0 * v[static_cast<std::size_t>(c)] / n;
    out.v[c] = d.v;
    out.j.row(c) = d.g.transpose();
  }
  return out;
}

/// cos(angle) - 1 and sin(angle), the first without cancellation.
struct Turn {
  Jet cosLess1, sin;
};
inline Turn turnOf(const Jet& angle) {
  const auto half = numeric::sincos(0.5 * angle.v), whole = numeric::sincos(angle.v);
  return {{-2 * half.sin * half.sin, -whole.sin * angle.g}, {whole.sin, whole.cos * angle.g}};
}
/// What turning `a` by `angle` about the unit vector `axis` adds to it.
inline JetVec turnBy(const JetVec& a, const JetVec& axis, const Jet& angle) {
  const Turn t = turnOf(angle);
  return t.cosLess1 * (a - dot(axis, a) * axis) + t.sin * cross(axis, a);
}

}  // namespace fielddeform::map::detail
