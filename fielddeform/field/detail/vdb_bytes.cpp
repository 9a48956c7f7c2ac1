#include <fielddeform/core/error.h>
#include <fielddeform/field/detail/vdb_bytes.h>
#include <fmt/format.h>
#if FIELDDEFORM_HAS_ZLIB
#include <zlib.h>
#endif
#if FIELDDEFORM_HAS_BLOSC
#include <blosc.h>
#endif

#include <cmath>
#include <limits>

namespace fielddeform::field::detail {
namespace {

constexpr std::uint32_t kZip = 1, kBlosc = 4;

bool unzip([[maybe_unused]] std::string_view packed, [[maybe_unused]] std::string& out) {
#if FIELDDEFORM_HAS_ZLIB
  uLongf size = out.size();
  return uncompress(reinterpret_cast<Bytef*>(out.data()), &size, reinterpret_cast<const Bytef*>(packed.data()), packed.size()) == Z_OK &&
         size == out.size();
#else
  return false;
#endif
}

bool unblosc([[maybe_unused]] std::string_view packed, [[maybe_unused]] std::string& out) {
#if FIELDDEFORM_HAS_BLOSC
  std::size_t size = 0;
  if (packed.size() < BLOSC_MIN_HEADER_LENGTH || blosc_cbuffer_validate(packed.data(), packed.size(), &size) != 0 || size != out.size())
    return false;
  const int done = blosc_decompress_ctx(packed.data(), out.data(), out.size(), 1);
  return done >= 0 && static_cast<std::size_t>(done) == out.size();
#else
  return false;
#endif
}

}  // namespace

double halfAt(const char* at) {
  const auto bits = valueAt<std::uint16_t>(at);
  const int exponent = bits >> 10 & 31, fraction = bits & 1023;
  double value = std::ldexp(exponent ? 1024 + fraction : fraction, (exponent ? exponent : 1) - 25);
  if (exponent == 31) value = fraction ? std::numeric_limits<double>::quiet_NaN() : std::numeric_limits<double>::infinity();
  return bits >> 15 ? -value : value;
}

void VdbBytes::fail(const std::string& found, const std::string& expected) const {
  throw IoError(path_, {.line = {}, .column = {}, .byte = at_}, "", found, expected);
}

std::string_view VdbBytes::take(std::uint64_t count, const char* what) {
  if (count > bytes_.size() - at_)
    throw IoError(path_, {.line = {}, .column = {}, .byte = at_}, what, fmt::format("{} bytes", bytes_.size() - at_), fmt::format("{}", count));
  const std::string_view taken = bytes_.substr(at_, count);
  at_ += count;
  return taken;
}

std::string VdbBytes::text(const char* what) { return std::string(take(take<std::uint32_t>(what), what)); }

void VdbBytes::seek(std::uint64_t at, const char* what) {
  if (at > bytes_.size())
    throw IoError(path_, {.line = {}, .column = {}, .byte = at_}, what, fmt::format("byte {}", at),
                  fmt::format("one within the {} of the file", bytes_.size()));
  at_ = at;
}

void VdbBytes::decompress(std::uint32_t compression, std::string& out) {
  if (!(compression & (kZip | kBlosc))) {
    out = take(out.size(), "values");
    return;
  }
  const auto size = take<std::int64_t>("the size of values");
  if (size <= 0) {  // stored whole
    if (-static_cast<std::uint64_t>(size) != out.size()) fail(fmt::format("{} bytes of values", -static_cast<std::uint64_t>(size)), fmt::format("{}", out.size()));
    out = take(out.size(), "values");
    return;
  }
  const std::string_view packed = take(static_cast<std::uint64_t>(size), "values");
  if (compression & kBlosc) {
    if (!FIELDDEFORM_HAS_BLOSC) throw IoError(path_, "compressed by Blosc, which this build lacks: write it with zip or without compression");
    if (!unblosc(packed, out)) fail("values that Blosc cannot unpack", fmt::format("{} bytes", out.size()));
  } else {
    if (!FIELDDEFORM_HAS_ZLIB) throw IoError(path_, "compressed by zlib, which this build lacks: write it without compression");
    if (!unzip(packed, out)) fail("values that zlib cannot unpack", fmt::format("{} bytes", out.size()));
  }
}

}  // namespace fielddeform::field::detail
