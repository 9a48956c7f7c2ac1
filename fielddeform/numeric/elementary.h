#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <limits>

/// Elementary functions made of +, -, *, / and bit operations only. libm chooses its code by CPU, so its last bit differs
/// between machines; these give the same bytes on every CPU (compiled without fused multiply-add, as all of this
/// project is). They have no branches, so that compilers vectorise loops over them.
namespace fielddeform::numeric {
namespace detail {

inline constexpr double kRoundMagic = 0x1.8p52;  ///< adding and subtracting it rounds |x| < 2^51 to an integer

/// 2^n for an integer -1022 <= n <= 1023.
inline double powerOfTwo(double n) noexcept {
  const auto bits = std::bit_cast<std::uint64_t>(n + (0x1p52 + 1023));
  return std::bit_cast<double>(bits << 52);
}

}  // namespace detail

/// e^x. Relative error <= 3e-16; 0 below -745.2, infinity above 709.8; NaN for NaN.
inline double exp(double x) noexcept {
  constexpr double kLn2Hi = 0x1.62e42feep-1, kLn2Lo = 0x1.a39ef35793c76p-33;
  double y = x < -746.0 ? -746.0 : x;
  y = y > 710.0 ? 710.0 : y;
  const double n = (y * 0x1.71547652b82fep+0 + detail::kRoundMagic) - detail::kRoundMagic;
  const double r = (y - n * kLn2Hi) - n * kLn2Lo;
  const double z = r * r;
  // e^r = 1 + r + r^2 P(r), |r| <= ln(2)/2; P interpolates at Chebyshev nodes, even and odd part apart.
  const double even = 0x1.0000000000001p-1 +
                      z * (0x1.5555555553d68p-5 +
                           z * (0x1.6c16c17889ef9p-10 + z * (0x1.a019b914985a9p-16 + z * 0x1.28917c8be7ad6p-22)));
  const double odd = 0x1.5555555555556p-3 +
                     z * (0x1.11111111109b5p-7 +
                          z * (0x1.a01a01a7c2f03p-13 + z * (0x1.71de0db2f585ep-19 + z * 0x1.af389ed28db09p-26)));
  const double p = 1 + (r + z * (even + r * odd));
  // Two factors, so that results below the normal range come out gradually.
  const double half = (0.5 * n + detail::kRoundMagic) - detail::kRoundMagic;
  return p * detail::powerOfTwo(half) * detail::powerOfTwo(n - half);
}

/// Natural logarithm. Relative error <= 3e-16; -infinity at 0, NaN below, infinity at infinity.
inline double log(double x) noexcept {
  constexpr double kLn2Hi = 0x1.62e42feep-1, kLn2Lo = 0x1.a39ef35793c76p-33;
  const bool small = x < std::numeric_limits<double>::min();
  const double scaled = small ? x * 0x1p54 : x;
  // x = 2^e m with m in [sqrt(1/2), sqrt(2)).
  const std::uint64_t bits = std::bit_cast<std::uint64_t>(scaled) + (0x3FF0000000000000ull - 0x3FE6A09E667F3BCDull);
  const double m = std::bit_cast<double>((bits & 0x000FFFFFFFFFFFFFull) + 0x3FE6A09E667F3BCDull);
  const double biased = std::bit_cast<double>((bits >> 52) | 0x4330000000000000ull) - 0x1p52;
  const double e = biased - (small ? 1077.0 : 1023.0);
  // log(1 + f) = f - f^2/2 + s (f^2/2 + z P(z)), s = f / (2 + f), z = s^2.
  const double f = m - 1;
  const double s = f / (2 + f);
  const double z = s * s, zz = z * z;
  const double even = 0x1.5555555555558p-1 + zz * (0x1.2492492df14bfp-2 + zz * (0x1.7462b4ac51915p-3 + zz * 0x1.2b584c80de001p-3));
  const double odd = 0x1.99999999952e2p-2 + zz * (0x1.c71c62e57c0cfp-3 + zz * 0x1.39fe603f8739ep-3);
  const double p = z * (even + z * odd);
  const double h = 0.5 * f * f;
  double y = e * kLn2Hi + (f - (h - (s * (h + p) + e * kLn2Lo)));
  y = x == std::numeric_limits<double>::infinity() ? x : y;
  y = x == 0 ? -std::numeric_limits<double>::infinity() : y;
  return x >= 0 ? y : std::numeric_limits<double>::quiet_NaN();
}

struct SinCos {
  double sin, cos;
};

/// Sine and cosine of an angle in radians. Absolute error <= 2e-16 for |x| <= 5e5; NaN beyond.
inline SinCos sincos(double x) noexcept {
  constexpr double kHi = 0x1.921fb544p+0, kMid = 0x1.0b4611a6p-34, kLo = 0x1.3198a2e037073p-69;  // of pi/2, first two 33 bits
  const double shifted = x * 0x1.45f306dc9c883p-1 + detail::kRoundMagic;
  const double n = shifted - detail::kRoundMagic;
  const auto quadrant = std::bit_cast<std::uint64_t>(shifted);
  const double r = ((x - n * kHi) - n * kMid) - n * kLo;
  const double z = r * r;
  const double sp = -0x1.5555555555555p-3 +
                    z * (0x1.1111111110bb2p-7 +
                         z * (-0x1.a01a019e83aa8p-13 +
                              z * (0x1.71de379689862p-19 + z * (-0x1.ae600b0226713p-26 + z * 0x1.5e0b19c4eccadp-33))));
  const double cp = 0x1.5555555555555p-5 +
                    z * (-0x1.6c16c16c16967p-10 +
                         z * (0x1.a01a019f4eafdp-16 +
                              z * (-0x1.27e4fa17d9c4ep-22 + z * (0x1.1eeb68e8f3790p-29 + z * -0x1.907da333d278fp-37))));
  const double s = r + r * z * sp;
  const double c = 1 - (0.5 * z - z * z * cp);
  const double sine = (quadrant & 1) ? c : s, cosine = (quadrant & 1) ? s : c;
  const bool negateSine = (quadrant & 2) != 0, negateCosine = ((quadrant + 1) & 2) != 0;
  const bool inRange = x >= -5e5 && x <= 5e5;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  return {inRange ? (negateSine ? -sine : sine) : nan, inRange ? (negateCosine ? -cosine : cosine) : nan};
}

/// Angle of the point (x, y), radians in [-pi, pi], for finite arguments. Relative error <= 5e-16; signs of zero as in
/// std::atan2. Scaling both by a power of two changes no bit (within the normal range).
inline double atan2(double y, double x) noexcept {
  constexpr double kPi = 0x1.921fb54442d18p+1, kPiLo = 0x1.1a62633145c07p-53;
  const double ay = std::abs(y), ax = std::abs(x);
  const bool steep = ay > ax;
  const double larger = steep ? ay : ax, smaller = steep ? ax : ay;
  const double t = larger == 0 ? 0 : smaller / larger;
  const bool upper = t > 0.41421356237309503;  // tan(pi/8)
  const double u = upper ? (t - 1) / (t + 1) : t;
  const double z = u * u;
  double p = -0x1.3a31a1d5ffde0p-6;
  for (const double c : {0x1.4162b9ab69c5ap-5, -0x1.a0999a234950fp-5, 0x1.dfe6491089bd5p-5, -0x1.10fa77ab514f0p-4,
                         0x1.3b126305dc4dep-4, -0x1.745d0b28a2eeep-4, 0x1.c71c71853d607p-4, -0x1.24924924361fep-3,
                         0x1.999999999934cp-3, -0x1.5555555555555p-2})
    p = p * z + c;
  const double around = u + u * z * p;
  double a = upper ? 0.25 * kPi + (around + 0.25 * kPiLo) : around;
  const bool left = std::signbit(x);
  const double base = steep ? 0.5 * kPi : left ? kPi : 0.0;
  const double baseLo = steep ? 0.5 * kPiLo : left ? kPiLo : 0.0;
  a = base + ((steep != left ? -a : a) + baseLo);
  return std::copysign(a, y);
}

}  // namespace fielddeform::numeric
