// What kernels of this folder share, by way of core/detail/each_level.h: no step of one lane looks at another's.
#ifndef LANES_TARGET
#error "included by core/detail/each_level.h alone"
#endif

/// Numbers from `at` on; the last one again beyond the count.
LANES_INLINE void loadLanes(const double* numbers, std::size_t at, std::size_t count, Pack& out) {
  constexpr std::size_t lanes = sizeof(Pack) / 8;
  if (at + lanes <= count) {
    load(numbers + at, out);
    return;
  }
  double some[lanes];
  for (std::size_t l = 0; l < lanes; ++l) some[l] = numbers[at + l < count ? at + l : count - 1];
  load(some, out);
}

LANES_INLINE void sqrtLanes(const Pack& x, Pack& out) {
  for (std::size_t l = 0; l < sizeof(Pack) / 8; ++l) out[l] = std::sqrt(x[l]);
}

/// 2^x for x <= 0; relative error 5e-16. At most 2^1000 times too large below -1000, where it stays at 2^-1000.
LANES_INLINE void powerOfTwoLanes(const Pack& x, Pack& out) {
  constexpr double kMagic = 0x1.8p52;
  const Pack zero{};
  const Pack y = x < -1000.0 ? zero - 1000.0 : x;
  const Pack n = (y + kMagic) - kMagic;
  const Pack f = y - n, z = f * f;
  // 2^f on [-1/2, 1/2], interpolated at eleven Chebyshev nodes; even and odd part apart.
  const Pack even =
      1.0 + z * (0x1.ebfbdff82c598p-3 +
                 z * (0x1.3b2ab6fba1ddap-7 + z * (0x1.430913096fd9fp-13 + z * (0x1.62bfd47773353p-20 + z * 0x1.e6063f7217bc6p-28))));
  const Pack odd = 0x1.62e42fefa3a19p-1 +
                   z * (0x1.c6b08d703ce49p-5 + z * (0x1.5d87fe9d7a584p-10 + z * (0x1.ffcb54062e698p-17 + z * 0x1.b675bca4eeebbp-24)));
  const Pack shifted = n + (0x1p52 + 1023);
  const Mask scale = reinterpret_cast<Mask>(shifted) << 52;
  out = (even + f * odd) * reinterpret_cast<Pack>(scale);
}
