#pragma once

#include <charconv>
#include <cstdint>
#include <limits>

/// Parsing of text formats: everything works on [p, end) and never looks at *end.
namespace fielddeform::mesh::formats {

inline bool isBlank(char c) noexcept { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }
inline bool isEol(char c) noexcept { return c == '\n' || c == '\r'; }
inline bool isDigit(char c) noexcept { return static_cast<unsigned char>(c - '0') < 10; }

inline const char* skipBlanks(const char* p, const char* end) noexcept {
  while (p < end && isBlank(*p)) ++p;
  return p;
}
inline const char* skipToken(const char* p, const char* end) noexcept {
  while (p < end && !isBlank(*p) && !isEol(*p)) ++p;
  return p;
}
/// Past the line's end ("\n", "\r\n" or "\r").
inline const char* skipEol(const char* p, const char* end) noexcept {
  if (p < end && *p == '\r')
    ++p, p += (p < end && *p == '\n');
  else if (p < end && *p == '\n')
    ++p;
  return p;
}
/// The line's end at or after p (or `end`).
const char* findEol(const char* p, const char* end) noexcept;

/// A number that does not fit the simple path of parseDouble().
const char* parseDoubleSlow(const char* p, const char* end, double& value) noexcept;

/// Reads a decimal number, correctly rounded; "nan" and "inf" are numbers, too large ones become infinite, too small
/// ones zero. Returns the place behind it, or null if there is no number at p.
inline const char* parseDouble(const char* p, const char* end, double& value) noexcept {
  // Up to 15 digits m and a power of ten that is exact: m / 10^k has one rounding, hence is right. [Clinger 1990]
  static constexpr double kPower[] = {1e0, 1e1, 1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                      1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15};
  const char* q = p;
  const bool negative = q < end && *q == '-';
  q += negative;
  std::uint64_t digits = 0;
  const char* first = q;
  while (q < end && isDigit(*q)) digits = digits * 10 + static_cast<unsigned char>(*q++ - '0');
  std::ptrdiff_t count = q - first, decimals = 0;
  if (q < end && *q == '.') {
    const char* point = ++q;
    while (q < end && isDigit(*q)) digits = digits * 10 + static_cast<unsigned char>(*q++ - '0');
    decimals = q - point;
    count += decimals;
  }
  if (count == 0 || count > 15 || (q < end && !isBlank(*q) && !isEol(*q))) return parseDoubleSlow(p, end, value);
  const double magnitude = static_cast<double>(digits) / kPower[decimals];
  value = negative ? -magnitude : magnitude;
  return q;
}

/// Reads a whole decimal number (sign allowed). Null if there is none at p or it does not fit.
inline const char* parseInteger(const char* p, const char* end, std::int64_t& value) noexcept {
  const bool negative = p < end && *p == '-';
  if (p < end && (*p == '-' || *p == '+')) ++p;
  const char* first = p;
  std::uint64_t digits = 0;
  while (p < end && isDigit(*p)) {
    if (p - first >= 18) return nullptr;
    digits = digits * 10 + static_cast<unsigned char>(*p++ - '0');
  }
  if (p == first) return nullptr;
  value = negative ? -static_cast<std::int64_t>(digits) : static_cast<std::int64_t>(digits);
  return p;
}

}  // namespace fielddeform::mesh::formats
