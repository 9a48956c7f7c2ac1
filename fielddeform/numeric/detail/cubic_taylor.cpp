// With d = origin - c, s = |d + t|^2 and f = s^(3/2), Euler's operator gives (t grad f) s = 3 (t d + |t|^2) f, so that the
// coefficients a_k of t^k, n = |k|, follow from those of lower degree:
//   n |d|^2 a_k = -(2 n - 5) sum_i d_i a_(k - e_i) - (n - 5) sum_i a_(k - 2 e_i).
// Lanes never meet but in sums of eight in a fixed order: the same bits on every processor.
#include <fielddeform/core/detail/simd.h>
#include <fielddeform/numeric/detail/cubic_sum.h>
#include <fielddeform/numeric/detail/cubic_taylor.h>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>

namespace fielddeform::numeric::detail {
namespace {

using fielddeform::detail::Baseline, fielddeform::detail::Avx2, fielddeform::detail::Avx512;
using fielddeform::detail::SimdLevel, fielddeform::detail::simdLevel;

constexpr std::size_t kSide = kTaylorDegree + 1;

// Where the row of x^i y^j begins.
constexpr auto kRows = [] {
  std::array<std::array<std::size_t, kSide>, kSide> begin{};
  std::size_t at = 0;
  for (std::size_t i = 0; i < kSide; ++i)
    for (std::size_t j = 0; i + j < kSide; ++j) {
      begin[i][j] = at;
      at += kSide - i - j;
    }
  return begin;
}();

// The degree n part of |d + t|^3 is at most bound[n] |d|^(3 - n) |t|^n: with t at the angle g to -d and u = |t| / |d| it is
// ((1 - e^(ig) u) (1 - e^(-ig) u))^(3/2), a product of two series of the coefficients of (1 - u)^(3/2).
constexpr double kNextBound = [] {
  std::array<double, kSide + 1> size{1};
  for (std::size_t m = 1; m <= kSide; ++m) {
    const double up = static_cast<double>(m) - 2.5;
    size[m] = size[m - 1] * (up < 0 ? -up : up) / static_cast<double>(m);
  }
  double sum = 0;
  for (std::size_t m = 0; m <= kSide; ++m) sum += size[m] * size[kSide - m];
  return sum;
}();

struct AddTask {
  const double* blocks;
  std::size_t count;
  Vec3 origin;
  double* terms;
};

FIELDDEFORM_SIMD_INLINE double total(const double* v) {
  return ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]));
}

template <class L>
FIELDDEFORM_SIMD_INLINE void root(const typename L::Pack& x, typename L::Pack& r) {
  for (std::size_t l = 0; l < sizeof(x) / 8; ++l) r[l] = std::sqrt(x[l]);
}

// The coefficients of one pack of centres, at d from them.
template <class L>
FIELDDEFORM_SIMD_INLINE void coefficients(const typename L::Pack* d, const typename L::Pack* none, typename L::Pack* a) {
  using Pack = typename L::Pack;
  const Pack dx = d[0], dy = d[1], dz = d[2];
  const Pack r2 = dx * dx + dy * dy + dz * dz, inverse = 1.0 / r2;
  const Pack ux = dx * inverse, uy = dy * inverse;
  Pack along[kSide], before[kSide];
  double across[kSide];
  across[0] = 0;
  for (std::size_t n = 1; n < kSide; ++n) {
    const double degree = static_cast<double>(n);
    across[n] = -(2 * degree - 5) / degree;
    along[n] = across[n] * (dz * inverse);
    before[n] = -(degree - 5) / degree * inverse;
  }
  for (std::size_t i = 0; i < kSide; ++i)
    for (std::size_t j = 0; i + j < kSide; ++j) {
      Pack* row = a + kRows[i][j];
      const Pack* left = i > 0 ? a + kRows[i - 1][j] : none;
      const Pack* left2 = i > 1 ? a + kRows[i - 2][j] : none;
      const Pack* down = j > 0 ? a + kRows[i][j - 1] : none;
      const Pack* down2 = j > 1 ? a + kRows[i][j - 2] : none;
      Pack one{}, two{};
      std::size_t k = 0;
      if (i + j == 0) {
        root<L>(r2, one);
        row[k++] = one = r2 * one;
      }
      for (; i + j + k < kSide; ++k) {
        const std::size_t n = i + j + k;
        const Pack next = across[n] * (ux * left[k] + uy * down[k]) + before[n] * ((left2[k] + down2[k]) + two) + along[n] * one;
        row[k] = next;
        two = one;
        one = next;
      }
    }
}

template <class L, std::size_t Components>
FIELDDEFORM_SIMD_INLINE void addKernel(const AddTask& task) {
  using Pack = typename L::Pack;
  constexpr std::size_t lanes = sizeof(Pack) / 8, packs = kCubicLanes / lanes;
  double all[Components * kTaylorTerms][kCubicLanes];
  for (std::size_t k = 0; k < packs; ++k) {
    Pack sums[Components * kTaylorTerms] = {}, a[kTaylorTerms], none[kSide] = {};
    const double* at = task.blocks + k * lanes;
    for (std::size_t b = 0; b < task.count; ++b, at += kCubicBlock) {
      Pack d[3];
      for (int i = 0; i < 3; ++i) d[i] = task.origin[i] - *reinterpret_cast<const Pack*>(at + static_cast<std::size_t>(i) * kCubicLanes);
      coefficients<L>(d, none, a);
      for (std::size_t c = 0; c < Components; ++c) {
        const Pack w = *reinterpret_cast<const Pack*>(at + (3 + c) * kCubicLanes);
        for (std::size_t m = 0; m < kTaylorTerms; ++m) sums[c * kTaylorTerms + m] += w * a[m];
      }
    }
    for (std::size_t m = 0; m < Components * kTaylorTerms; ++m) std::memcpy(all[m] + k * lanes, &sums[m], sizeof(Pack));
  }
  for (std::size_t m = 0; m < Components * kTaylorTerms; ++m) task.terms[m] += total(all[m]);
}

struct SumTask {
  CubicNear near;
  CubicPoints points;
  double* out;
};

template <class L, std::size_t Packs>
FIELDDEFORM_SIMD_INLINE void load(const double* from, typename L::Pack* x) {
  std::memcpy(x, from, Packs * sizeof(typename L::Pack));
}
template <class L, std::size_t Packs>
FIELDDEFORM_SIMD_INLINE void subtract(const typename L::Pack* x, double origin, typename L::Pack* t) {
  for (std::size_t p = 0; p < Packs; ++p) t[p] = x[p] - origin;
}

// Horner's rule for a few packs of points at once, and the derivatives with it: v, dv/dx, dv/dy, dv/dz.
template <class L, std::size_t Packs>
FIELDDEFORM_SIMD_INLINE void polynomial(const double* terms, const typename L::Pack* x, const typename L::Pack* y,
                                        const typename L::Pack* z, typename L::Pack (*v)[Packs]) {
  using Pack = typename L::Pack;
  for (std::size_t i = kSide; i-- > 0;) {
    Pack u[3][Packs] = {};
    for (std::size_t j = kSide - i; j-- > 0;) {
      const double* row = terms + kRows[i][j];
      Pack r[Packs], rz[Packs] = {};
      for (std::size_t p = 0; p < Packs; ++p) r[p] = Pack{} + row[kSide - 1 - i - j];
      for (std::size_t k = kSide - 1 - i - j; k-- > 0;) {
        const double term = row[k];
        for (std::size_t p = 0; p < Packs; ++p) {
          rz[p] = rz[p] * z[p] + r[p];
          r[p] = r[p] * z[p] + term;
        }
      }
      for (std::size_t p = 0; p < Packs; ++p) {
        u[1][p] = u[1][p] * y[p] + u[0][p];
        u[0][p] = u[0][p] * y[p] + r[p];
        u[2][p] = u[2][p] * y[p] + rz[p];
      }
    }
    for (std::size_t p = 0; p < Packs; ++p) {
      v[1][p] = v[1][p] * x[p] + v[0][p];
      v[0][p] = v[0][p] * x[p] + u[0][p];
      v[2][p] = v[2][p] * x[p] + u[1][p];
      v[3][p] = v[3][p] * x[p] + u[2][p];
    }
  }
}

// The same without derivatives.
template <class L, std::size_t Packs>
FIELDDEFORM_SIMD_INLINE void polynomialValue(const double* terms, const typename L::Pack* x, const typename L::Pack* y,
                                             const typename L::Pack* z, typename L::Pack* v) {
  using Pack = typename L::Pack;
  for (std::size_t i = kSide; i-- > 0;) {
    Pack u[Packs] = {};
    for (std::size_t j = kSide - i; j-- > 0;) {
      const double* row = terms + kRows[i][j];
      Pack r[Packs] = {};
      for (std::size_t k = kSide - i - j; k-- > 0;)
        for (std::size_t p = 0; p < Packs; ++p) r[p] = r[p] * z[p] + row[k];
      for (std::size_t p = 0; p < Packs; ++p) u[p] = u[p] * y[p] + r[p];
    }
    for (std::size_t p = 0; p < Packs; ++p) v[p] = v[p] * x[p] + u[p];
  }
}

template <class L>
FIELDDEFORM_SIMD_INLINE void firstKernel(const SumTask& task) {
  using Pack = typename L::Pack;
  constexpr std::size_t lanes = sizeof(Pack) / 8, packs = 4;
  static_assert(kCubicTogether % (packs * lanes) == 0);
  const std::size_t n = task.points.count;
  for (std::size_t at = 0; at < n; at += packs * lanes) {
    Pack x[packs], y[packs], z[packs], v[4][packs] = {};
    load<L, packs>(task.points.x + at, x);
    load<L, packs>(task.points.y + at, y);
    load<L, packs>(task.points.z + at, z);
    if (task.near.terms) {
      Pack tx[packs], ty[packs], tz[packs];
      subtract<L, packs>(x, task.near.origin[0], tx);
      subtract<L, packs>(y, task.near.origin[1], ty);
      subtract<L, packs>(z, task.near.origin[2], tz);
      polynomial<L, packs>(task.near.terms, tx, ty, tz, v);
    }
    for (std::size_t p = 0; p < packs; p += 2) {
      const double* c = task.near.centres;
      Pack value[2] = {}, gx[2] = {}, gy[2] = {}, gz[2] = {};
      for (std::size_t j = task.near.count; j-- > 0; c += 4)
        for (std::size_t q = 0; q < 2; ++q) {
          const Pack dx = x[p + q] - c[0], dy = y[p + q] - c[1], dz = z[p + q] - c[2], r2 = dx * dx + dy * dy + dz * dz;
          Pack r;
          root<L>(r2, r);
          const Pack s = c[3] * r;
          value[q] += s * r2;
          gx[q] += s * dx;
          gy[q] += s * dy;
          gz[q] += s * dz;
        }
      for (std::size_t q = 0; q < 2; ++q) {
        const Pack sums[4] = {v[0][p + q] + value[q], v[1][p + q] + 3.0 * gx[q], v[2][p + q] + 3.0 * gy[q], v[3][p + q] + 3.0 * gz[q]};
        for (std::size_t s = 0; s < 4; ++s) std::memcpy(task.out + s * n + at + (p + q) * lanes, &sums[s], sizeof(Pack));
      }
    }
  }
}

template <class L>
FIELDDEFORM_SIMD_INLINE void threeKernel(const SumTask& task) {
  using Pack = typename L::Pack;
  constexpr std::size_t lanes = sizeof(Pack) / 8, packs = 4;
  const std::size_t n = task.points.count;
  for (std::size_t at = 0; at < n; at += packs * lanes) {
    Pack x[packs], y[packs], z[packs], v[3][packs] = {};
    load<L, packs>(task.points.x + at, x);
    load<L, packs>(task.points.y + at, y);
    load<L, packs>(task.points.z + at, z);
    if (task.near.terms) {
      Pack tx[packs], ty[packs], tz[packs];
      subtract<L, packs>(x, task.near.origin[0], tx);
      subtract<L, packs>(y, task.near.origin[1], ty);
      subtract<L, packs>(z, task.near.origin[2], tz);
      for (std::size_t c = 0; c < 3; ++c) polynomialValue<L, packs>(task.near.terms + c * kTaylorTerms, tx, ty, tz, v[c]);
    }
    for (std::size_t p = 0; p < packs; ++p) {
      const double* c = task.near.centres;
      Pack sums[3] = {};
      for (std::size_t j = task.near.count; j-- > 0; c += 6) {
        const Pack dx = x[p] - c[0], dy = y[p] - c[1], dz = z[p] - c[2], r2 = dx * dx + dy * dy + dz * dz;
        Pack r;
        root<L>(r2, r);
        const Pack r3 = r2 * r;
        for (std::size_t k = 0; k < 3; ++k) sums[k] += c[3 + k] * r3;
      }
      for (std::size_t s = 0; s < 3; ++s) {
        const Pack sum = v[s][p] + sums[s];
        std::memcpy(task.out + s * n + at + p * lanes, &sum, sizeof(Pack));
      }
    }
  }
}

template <class L>
FIELDDEFORM_SIMD_INLINE void addOneKernel(const AddTask& task) {
  addKernel<L, 1>(task);
}
template <class L>
FIELDDEFORM_SIMD_INLINE void addThreeKernel(const AddTask& task) {
  addKernel<L, 3>(task);
}

FIELDDEFORM_LEVELS(addOne, const AddTask, addOneKernel)
FIELDDEFORM_LEVELS(addThree, const AddTask, addThreeKernel)
FIELDDEFORM_LEVELS(sumFirst, const SumTask, firstKernel)
FIELDDEFORM_LEVELS(sumThree, const SumTask, threeKernel)

}  // namespace

TaylorBound taylorBound(double radius, double distance) {
  const double ratio = radius / distance;
  if (!(ratio <= 0.5)) return {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  // The parts of degree n > kTaylorDegree fall at least as ratio^n. A homogeneous polynomial's gradient is at most n / radius times
  // its greatest value [Kellogg 1928].
  double power = kNextBound * distance * distance;
  for (int n = 0; n < kTaylorDegree; ++n) power *= ratio;
  const double rest = 1 / (1 - ratio);
  return {power * radius * rest, power * static_cast<double>(kSide) * rest * rest};
}

void addTaylor(const double* blocks, std::size_t count, const Vec3& origin, std::size_t components, double* terms) {
  const AddTask task{blocks, count, origin, terms};
  if (components == 1) addOne(task);
  else addThree(task);
}

void moveTaylor(const Vec3& by, double* terms) {
  // One axis after the other: the coefficients of a polynomial of t + s by repeated division.
  const double x = by[0], y = by[1], z = by[2];
  for (std::size_t r = 0; r + 1 < kSide; ++r)
    for (std::size_t i = kSide - 1; i-- > r;) {
      // Rows j of i + 1 go to rows j of i.
      for (std::size_t j = 0; i + 1 + j < kSide; ++j) {
        double* to = terms + kRows[i][j];
        const double* from = terms + kRows[i + 1][j];
        for (std::size_t k = 0; i + 1 + j + k < kSide; ++k) to[k] += x * from[k];
      }
    }
  for (std::size_t i = 0; i < kSide; ++i)
    for (std::size_t r = 0; i + r + 1 < kSide; ++r)
      for (std::size_t j = kSide - 1 - i; j-- > r;) {
        double* to = terms + kRows[i][j];
        const double* from = terms + kRows[i][j + 1];
        for (std::size_t k = 0; i + j + 1 + k < kSide; ++k) to[k] += y * from[k];
      }
  for (std::size_t i = 0; i < kSide; ++i)
    for (std::size_t j = 0; i + j < kSide; ++j) {
      double* row = terms + kRows[i][j];
      for (std::size_t r = 0; i + j + r + 1 < kSide; ++r)
        for (std::size_t k = kSide - 1 - i - j; k-- > r;) row[k] += z * row[k + 1];
    }
}

void cubicFirstTogether(const CubicNear& near, const CubicPoints& points, double* out) { sumFirst({near, points, out}); }
void cubicSumsTogether(const CubicNear& near, const CubicPoints& points, double* out) { sumThree({near, points, out}); }

}  // namespace fielddeform::numeric::detail
