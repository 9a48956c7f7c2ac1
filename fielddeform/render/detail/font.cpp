#include <fielddeform/render/detail/font.h>

#include <cstdint>

namespace fielddeform::render::detail {
namespace {

struct Glyph {
  std::uint32_t code;
  const char* strokes;
};

// A stroke is a sequence of points, a point a letter for x (a = 0) and one for y (A = -3, D = the baseline, J = the
// height of an x, M = a capital's). A stroke that begins with ~ is a smooth curve through its points.
constexpr Glyph kGlyphs[] = {
    {'!', "aMaG aDaD"},
    {'"', "aMaK cMcK"},
    {'#', "bDcM eDfM aGgG aJgJ"},
    {'$', "~eKcLaKaIeGeEcDaE cNcC"},
    {'%', "aDgM ~bMaLbKcLbM ~fFeEfDgEfF"},
    {'&', "~gDbKcMdKaFcDgH"},
    {'\'', "aMaK"},
    {'(', "~cNaKaFcC"},
    {')', "~aNcKcFaC"},
    {'*', "cKcG aJeH aHeJ"},
    {'+', "aHeH cFcJ"},
    {',', "bEaB"},
    {'-', "aHdH"},
    {'.', "aDaD"},
    {'/', "aCeN"},
    {'0', "~cDaGaJcMeJeGcD"},
    {'1', "aKcMcD"},
    {'2', "~aKbMdMeKcHaD aDeD"},
    {'3', "~aLcMeKcI ~cIeFcDaE"},
    {'4', "dDdMaFeF"},
    {'5', "eMaMaI ~aIcJeGcDaE"},
    {'6', "~dMbKaGaFcDeFeGcIaG"},
    {'7', "aMeMbD"},
    {'8', "~cIaKcMeKcI ~cIaFcDeFcI"},
    {'9', "~bDdFeJeKcMaKaJcHeJ"},
    {':', "aDaD aIaI"},
    {';', "bEaB bIbI"},
    {'<', "eJaGeD"},
    {'=', "aFeF aIeI"},
    {'>', "aJeGaD"},
    {'?', "~aKcMeKcHcG cDcD"},
    {'@', "~eIcIcFeFeI eIeF ~eFgGgKdMaKaFdCgC"},
    {'A', "aDdMgD bGfG"},
    {'B', "aDaM ~aMdMfLfJdIaI ~aIdIgHgEdDaD"},
    {'C', "~gKdMaKaFdDgF"},
    {'D', "aDaM ~aMcMgJgGcDaD"},
    {'E', "fMaMaDfD aIeI"},
    {'F', "fMaMaD aIeI"},
    {'G', "~gKdMaKaFdDgF gFgHdH"},
    {'H', "aDaM gDgM aIgI"},
    {'I', "aDcD aMcM bDbM"},
    {'J', "~eMeJeFcDaF"},
    {'K', "aDaM gMaG cIgD"},
    {'L', "aMaDfD"},
    {'M', "aDaMdGgMgD"},
    {'N', "aDaMgDgM"},
    {'O', "~dDaFaKdMgKgFdD"},
    {'P', "aDaM ~aMdMfLfIdHaH"},
    {'Q', "~dDaFaKdMgKgFdD eFgC"},
    {'R', "aDaM ~aMdMfLfIdHaH dHgD"},
    {'S', "~gKdMaKdIgFdDaF"},
    {'T', "dDdM aMgM"},
    {'U', "~aMaJaFdDgFgJgM"},
    {'V', "aMdDgM"},
    {'W', "aMcDeKgDiM"},
    {'X', "aDgM aMgD"},
    {'Y', "aMdHgM dHdD"},
    {'Z', "aMgMaDgD"},
    {'[', "cNaNaCcC"},
    {'\\', "aNeC"},
    {']', "aNcNcCaC"},
    {'^', "aJcMeJ"},
    {'_', "aCfC"},
    {'`', "aMbK"},
    {'a', "~eIcJaHaFcDeF eJeD"},
    {'b', "aDaM ~aFcDeFeHcJaH"},
    {'c', "~eIcJaHaFcDeE"},
    {'d', "eDeM ~eHcJaHaFcDeF"},
    {'e', "aGeG ~eGeHcJaHaFcDeE"},
    {'f', "~dMbLbJbD aJdJ"},
    {'g', "~eJeFeCcAaB ~eHcJaHaFcDeF"},
    {'h', "aDaM ~aHcJeHeD"},
    {'i', "aDaJ aLaL"},
    {'j', "~cJcFcCaA cLcL"},
    {'k', "aDaM eJaF bGeD"},
    {'l', "aDaM"},
    {'m', "aDaJ ~aHcJdHdD ~dHfJgHgD"},
    {'n', "aDaJ ~aHcJeHeD"},
    {'o', "~cDaFaHcJeHeFcD"},
    {'p', "aAaJ ~aFcDeFeHcJaH"},
    {'q', "eAeJ ~eFcDaFaHcJeH"},
    {'r', "aDaJ ~aHbJdJ"},
    {'s', "~eIcJaIcGeEcDaE"},
    {'t', "~bMbIbEdD aJdJ"},
    {'u', "~aJaFcDeF eJeD"},
    {'v', "aJcDeJ"},
    {'w', "aJbDdIfDgJ"},
    {'x', "aDeJ aJeD"},
    {'y', "aJcD eJbA"},
    {'z', "aJeJaDeD"},
    {'{', "~cNbLbIaHbGbDcC"},
    {'|', "aNaB"},
    {'}', "~aNbLbIcHbGbDaC"},
    {'~', "~aGbHdGeH"},
    {0xB0, "~bMaLbKcLbM"},
    {0xB1, "aIeI cGcK aEeE"},
    {0xB7, "aGaG"},
    {0xD7, "aEeI aIeE"},
    {0xDF, "aDaL ~aLcMdKcIeFcD"},
    {0xE4, "~eIcJaHaFcDeF eJeD aLaL eLeL"},
    {0xF6, "~cDaFaHcJeHeFcD aLaL eLeL"},
    {0xFC, "~aJaFcDeF eJeD aLaL eLeL"},
    {0xE9, "aGeG ~eGeHcJaHaFcDeE cKdM"},
    {0x394, "aDdMgDaD"},
    {0x3B1, "~fJdFbDaGbJdGfD"},
    {0x2013, "aHfH"},
    {0x2014, "aHhH"},
    {0x2018, "aKaM"},
    {0x2019, "bMaK"},
    {0x2022, "aHaH"},
    {0x2192, "aHhH fJhHfF"},
    {0x2212, "aHeH"},
};
constexpr const char* kMissing = "aDaMeMeDaD";
constexpr float kSpace = 3.4f, kGap = 2.2f, kWiden = 1.12f;

using Stroke = std::vector<Eigen::Vector2f>;

/// Catmull-Rom spline; closed if the ends meet.
Stroke smoothed(const Stroke& p) {
  const int n = static_cast<int>(p.size());
  const bool closed = p.front() == p.back();
  const auto at = [&](int i) -> Eigen::Vector2f {
    if (closed) return p[static_cast<std::size_t>((i % (n - 1) + (n - 1)) % (n - 1))];
    if (i < 0) return 2 * p[0] - p[1];
    if (i >= n) return 2 * p[static_cast<std::size_t>(n - 1)] - p[static_cast<std::size_t>(n - 2)];
    return p[static_cast<std::size_t>(i)];
  };
  constexpr int kSteps = 6;
  Stroke out{p.front()};
  for (int i = 0; i + 1 < n; ++i) {
    const Eigen::Vector2f a = at(i - 1), b = at(i), c = at(i + 1), d = at(i + 2);
    for (int s = 1; s <= kSteps; ++s) {
      const float t = static_cast<float>(s) / kSteps;
      out.push_back(0.5f *
                    (2 * b + t * (c - a) + t * t * (2 * a - 5 * b + 4 * c - d) + t * t * t * (3 * b - a - 3 * c + d)));
    }
  }
  return out;
}

const char* strokesOf(std::uint32_t code) {
  for (const Glyph& g : kGlyphs) {
    if (g.code == code) return g.strokes;
  }
  return kMissing;
}

/// The next code point; malformed bytes count one each.
std::uint32_t nextCode(std::string_view text, std::size_t& i) {
  const auto byte = [&](std::size_t k) { return k < text.size() ? static_cast<unsigned char>(text[k]) : 0u; };
  const unsigned lead = byte(i);
  const int more = lead >= 0xF0 ? 3 : lead >= 0xE0 ? 2 : lead >= 0xC2 ? 1 : 0;
  std::uint32_t code = more == 0 ? lead : lead & (0x3Fu >> more);
  for (int k = 1; k <= more; ++k) {
    const unsigned next = byte(i + static_cast<std::size_t>(k));
    if ((next & 0xC0) != 0x80) {
      ++i;
      return 0xFFFD;
    }
    code = code << 6 | (next & 0x3F);
  }
  i += static_cast<std::size_t>(more) + 1;
  return code;
}

}  // namespace

Lettering layOut(std::string_view text) {
  Lettering out;
  float x = 0;
  for (std::size_t i = 0; i < text.size();) {
    const std::uint32_t code = nextCode(text, i);
    if (code <= ' ') {
      x += kSpace;
      continue;
    }
    float right = 0;
    Stroke stroke;
    bool curved = false;
    const auto finish = [&] {
      if (!stroke.empty()) out.strokes.push_back(curved && stroke.size() > 2 ? smoothed(stroke) : stroke);
      stroke.clear();
      curved = false;
    };
    for (const char* c = strokesOf(code); *c;) {
      if (*c == ' ')
        finish(), ++c;
      else if (*c == '~')
        curved = true, ++c;
      else {
        const float px = kWiden * static_cast<float>(c[0] - 'a'), py = static_cast<float>(c[1] - 'D');
        stroke.emplace_back(x + px, py);
        right = std::max(right, px);
        c += 2;
      }
    }
    finish();
    out.width = x + right;
    x += right + kGap;
  }
  return out;
}

}  // namespace fielddeform::render::detail
