#pragma once

#include <fielddeform/core/detail/simd.h>

#include <array>
#include <cstddef>

/// The arithmetic of the generalised de Casteljau map over any scalar, so that a test can count its operations.
namespace fielddeform::map::detail {

template <class T>
using Triple = std::array<T, 3>;

/// One affine step, p + u (q - p) + v s + w t: 9 multiplications, 9 additions, 3 subtractions. [Chang & Rockwood 1994, the matrix]
template <class T>
Triple<T> affineStep(const Triple<T>& p, const Triple<T>& q, const Triple<T>& s, const Triple<T>& t, const Triple<T>& uvw) {
  Triple<T> out;
  for (std::size_t c = 0; c < 3; ++c) out[c] = p[c] + (q[c] - p[c]) * uvw[0] + s[c] * uvw[1] + t[c] * uvw[2];
  return out;
}

/// x_i^{j-1} -> x_i^j in place, i = 0 .. count - 2.
template <class T>
void nextLevel(Triple<T>* x, std::size_t count, const Triple<T>* s, const Triple<T>* t, const Triple<T>& uvw) {
  for (std::size_t i = 0; i + 1 < count; ++i) x[i] = affineStep(x[i], x[i + 1], s[i], t[i], uvw);
}

/// Bernstein weights of degree n by the triangle of lerps. @param b n + 1
template <class T>
FIELDDEFORM_SIMD_INLINE void bernstein(std::size_t n, const T& u, const T& oneMinusU, T* b) {
  b[0] = T(1);
  if (n > 0) b[0] = oneMinusU, b[1] = u;
  for (std::size_t k = 2; k <= n; ++k) {
    b[k] = u * b[k - 1];
    for (std::size_t i = k - 1; i > 0; --i) b[i] = oneMinusU * b[i] + u * b[i - 1];
    b[0] = oneMinusU * b[0];
  }
}

/// The same image in closed form: the levels' handles enter linearly, so that the image is c(u) + v S(u) + w T(u), c of degree n and
/// S, T of degree n - 1.
/// @param c n + 1    @param s, t n    @param b n + 1, scratch    @param out the image
template <class T, class Control>
FIELDDEFORM_SIMD_INLINE void sweep(std::size_t n, const Triple<Control>* c, const Triple<Control>* s, const Triple<Control>* t, const Triple<T>& uvw, T* b, Triple<T>& out) {
  const T rest = T(1) - uvw[0];
  bernstein(n - 1, uvw[0], rest, b);
  Triple<T> a, d;
  for (std::size_t k = 0; k < 3; ++k) a[k] = b[0] * s[0][k], d[k] = b[0] * t[0][k];
  for (std::size_t i = 1; i < n; ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      a[k] = a[k] + b[i] * s[i][k];
      d[k] = d[k] + b[i] * t[i][k];
    }
  b[n] = uvw[0] * b[n - 1];
  for (std::size_t i = n - 1; i > 0; --i) b[i] = rest * b[i] + uvw[0] * b[i - 1];
  b[0] = rest * b[0];
  for (std::size_t k = 0; k < 3; ++k) out[k] = b[0] * c[0][k];
  for (std::size_t i = 1; i <= n; ++i)
    for (std::size_t k = 0; k < 3; ++k) out[k] = out[k] + b[i] * c[i][k];
  for (std::size_t k = 0; k < 3; ++k) out[k] = out[k] + uvw[1] * a[k] + uvw[2] * d[k];
}

}  // namespace fielddeform::map::detail
