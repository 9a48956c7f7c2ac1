#include <fielddeform/mesh/formats/text.h>

#include <cstring>
#include <string_view>

namespace fielddeform::mesh::formats {

const char* findEol(const char* p, const char* end) noexcept {
  const auto* newline = static_cast<const char*>(std::memchr(p, '\n', static_cast<std::size_t>(end - p)));
  const char* stop = newline ? newline : end;
  const auto* back = static_cast<const char*>(std::memchr(p, '\r', static_cast<std::size_t>(stop - p)));
  return back ? back : stop;
}

const char* parseDoubleSlow(const char* p, const char* end, double& value) noexcept {
  const char* q = p;
  if (q < end && *q == '+') {
    ++q;
    if (q < end && (*q == '-' || *q == '+')) return nullptr;
  }
  const auto [stop, error] = std::from_chars(q, end, value);
  if (error == std::errc()) return stop;
  if (error != std::errc::result_out_of_range) return nullptr;
  // from_chars does not say which way: a negative exponent, or no digit before the point, is too small.
  std::string_view text(q, static_cast<std::size_t>(stop - q));
  const bool negative = text.front() == '-';
  text.remove_prefix(negative);
  const auto exponent = text.find_first_of("eE");
  const bool small =
      exponent != text.npos ? text.substr(exponent + 1).starts_with('-') : text.front() == '0' || text.front() == '.';
  value = small ? 0.0 : std::numeric_limits<double>::infinity();
  if (negative) value = -value;
  return stop;
}

}  // namespace fielddeform::mesh::formats
