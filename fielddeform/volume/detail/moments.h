#pragma once

#include <fielddeform/volume/surface_volume.h>

#include <array>

namespace fielddeform::volume::detail {

/// A number and its derivative along one direction.
struct Dual {
  double a = 0, d = 0;
  Dual() = default;
  Dual(double value) : a(value) {}  // NOLINT: constants mix with duals
  Dual(double value, double slope) : a(value), d(slope) {}
  Dual& operator+=(const Dual& o) { return a += o.a, d += o.d, *this; }
};
inline Dual operator+(const Dual& x, const Dual& y) { return {x.a + y.a, x.d + y.d}; }
inline Dual operator-(const Dual& x, const Dual& y) { return {x.a - y.a, x.d - y.d}; }
inline Dual operator*(const Dual& x, const Dual& y) { return {x.a * y.a, x.d * y.a + x.a * y.d}; }
inline Dual operator/(const Dual& x, const Dual& y) { return {x.a / y.a, (x.d - x.a / y.a * y.d) / y.a}; }

template <class T>
using Triple = std::array<T, 3>;

template <class T>
Triple<T> cross(const Triple<T>& a, const Triple<T>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
template <class T>
T dot(const Triple<T>& a, const Triple<T>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// Integrals over a solid about some centre: of 1, x, and x x^T (xx, yy, zz, yz, xz, xy).
template <class T>
struct Totals {
  T volume{};
  Triple<T> first{};
  std::array<T, 6> second{};
};

/// Symmetric 3 by 3, in the order of Totals::second.
template <class T>
Triple<T> times(const std::array<T, 6>& m, const Triple<T>& v) {
  return {m[0] * v[0] + m[5] * v[1] + m[4] * v[2], m[5] * v[0] + m[1] * v[1] + m[3] * v[2], m[4] * v[0] + m[3] * v[1] + m[2] * v[2]};
}

/// The tetrahedron between the centre and a triangle: with D = a . (b x c), s = a + b + c,
/// integral of 1 = D / 6, of x = D s / 24, of x x^T = D (aa^T + bb^T + cc^T + ss^T) / 120.
template <class T>
void addTriangle(const Triple<T>& a, const Triple<T>& b, const Triple<T>& c, Totals<T>& sum) {
  const T det = dot(a, cross(b, c));
  const Triple<T> s{a[0] + b[0] + c[0], a[1] + b[1] + c[1], a[2] + b[2] + c[2]};
  sum.volume += det * T(1.0 / 6);
  for (std::size_t k = 0; k < 3; ++k) sum.first[k] += det * T(1.0 / 24) * s[k];
  const T weight = det * T(1.0 / 120);
  constexpr std::size_t u[6] = {0, 1, 2, 1, 0, 0}, v[6] = {0, 1, 2, 2, 2, 1};
  for (std::size_t k = 0; k < 6; ++k)
    sum.second[k] += weight * (a[u[k]] * a[v[k]] + b[u[k]] * b[v[k]] + c[u[k]] * c[v[k]] + s[u[k]] * s[v[k]]);
}

/// A function of the totals, by its derivatives: weight of the volume, of the first and of the second moments (symmetric matrix W
/// with the function's differential W : dS).
template <class T>
struct TotalsWeight {
  T volume{};
  Triple<T> first{};
  std::array<T, 6> second{};
};

/// Its derivative by corner a of the triangle (a, b, c).
template <class T>
Triple<T> cornerGradient(const TotalsWeight<T>& w, const Triple<T>& a, const Triple<T>& b, const Triple<T>& c) {
  const Triple<T> normal = cross(b, c);
  const T det = dot(a, normal);
  const Triple<T> s{a[0] + b[0] + c[0], a[1] + b[1] + c[1], a[2] + b[2] + c[2]};
  const Triple<T> wa = times(w.second, a), wb = times(w.second, b), wc = times(w.second, c), ws = times(w.second, s);
  const T q = dot(a, wa) + dot(b, wb) + dot(c, wc) + dot(s, ws);
  const T along = w.volume * T(1.0 / 6) + dot(w.first, s) * T(1.0 / 24) + q * T(1.0 / 120);
  Triple<T> out;
  for (std::size_t k = 0; k < 3; ++k)
    out[k] = normal[k] * along + det * (w.first[k] * T(1.0 / 24) + (wa[k] + ws[k]) * T(1.0 / 60));
  return out;
}

/// Totals of one region about its centre; with p also their derivatives along p.
Totals<double> regionTotals(const SurfaceVolume& surface, Points x, std::size_t region);
Totals<Dual> regionTotals(const SurfaceVolume& surface, Points x, Points p, std::size_t region);
/// The gradient of a function of a region's totals at the region's vertices, in their order; with p its derivative along p.
void regionGradient(const SurfaceVolume& surface, Points x, std::size_t region, const TotalsWeight<double>& w, std::span<Vec3> out);
void regionGradient(const SurfaceVolume& surface, Points x, Points p, std::size_t region, const TotalsWeight<Dual>& w, std::span<Vec3> out);

}  // namespace fielddeform::volume::detail
