#include <fielddeform/mesh/formats/ply_rows.h>
#include <fmt/format.h>

#include <cmath>

namespace fielddeform::mesh::formats {
namespace {

template <class T>
T fromDouble(double value) {
  if constexpr (std::is_same_v<T, float>)
    return narrow(value);
  else
    return static_cast<T>(value);
}

// The float nearest to the decimal at [p, end). Rounding the nearest double again is wrong only if that lies half-way.
double nearestFloat(const char* p, const char* end, double value) {
  if ((std::bit_cast<std::uint64_t>(value) & 0x1FFFFFFFu) == 0x10000000u && std::isfinite(value)) {
    float exact = 0;
    if (std::from_chars(p + (*p == '+'), end, exact).ec == std::errc()) return exact;
  }
  return widen(narrow(value));
}

}  // namespace

void store(AttributeData& data, std::size_t index, double value) {
  std::visit([&](auto& v) { v[index] = fromDouble<typename std::decay_t<decltype(v)>::value_type>(value); }, data);
}

void push(AttributeData& data, double value) {
  std::visit([&](auto& v) { v.push_back(fromDouble<typename std::decay_t<decltype(v)>::value_type>(value)); }, data);
}

void FaceCollector::endFace(std::uint64_t n) {
  if (uniform()) {
    if (n == 3) return;
    const std::size_t triangles = (corners.size() - n) / 3;
    offsets.reserve(triangles + 2);
    for (std::size_t f = 0; f <= triangles; ++f) offsets.push_back(static_cast<Index>(3 * f));
  }
  offsets.push_back(static_cast<Index>(corners.size()));
}

void FaceCollector::addToStrip(std::int64_t vertex) {
  if (vertex < 0) {
    inStrip_ = 0;
    return;
  }
  const auto v = static_cast<Index>(vertex);
  if (++inStrip_ >= 3) {
    // Every other triangle of a strip is listed backwards.
    if (inStrip_ % 2 == 1)
      corners.insert(corners.end(), {a_, b_, v});
    else
      corners.insert(corners.end(), {b_, a_, v});
    endFace(3);
  }
  a_ = b_;
  b_ = v;
}

bool FaceCollector::matches(const std::vector<Index>& listOffsets, std::size_t width) const {
  if (listOffsets.size() != count() + 1 || count() == 0) return false;
  for (std::size_t f = 0; f < listOffsets.size(); ++f)
    if (listOffsets[f] != width * (uniform() ? 3 * f : offsets[f])) return false;
  return true;
}

std::string RowsBase::where() const { return fmt::format("{} {}, property {}", element_, row_, property_); }

void AsciiRows::failHere(std::string found, std::string expected) const {
  source_.failText(at_, where(), std::move(found), std::move(expected));
}

void AsciiRows::beginRow(std::string_view element, std::uint64_t row) {
  element_ = element, row_ = row, property_ = "";
  while (at_ < end_ && (isBlank(*at_) || isEol(*at_))) ++at_;
}

void AsciiRows::endRow() {
  at_ = skipBlanks(at_, end_);
  if (at_ < end_ && !isEol(*at_))
    source_.failText(at_, fmt::format("{} {}", element_, row_), excerpt(at_, end_), "end of line");
  at_ = skipEol(at_, end_);
}

const char* AsciiRows::token(bool mayWrap) {
  at_ = skipBlanks(at_, end_);
  while (mayWrap && at_ < end_ && (isBlank(*at_) || isEol(*at_))) ++at_;
  return at_;
}

double AsciiRows::coordinate(ScalarType type) {
  if (type != ScalarType::Float32) return number(type);
  const char* p = token(false);
  double value = 0;
  const char* stop = parseDouble(p, end_, value);
  if (!stop || (stop < end_ && !isBlank(*stop) && !isEol(*stop))) failHere(excerpt(p, end_), "a number");
  if (faithful_) {
    char digits[32];
    double again = 0;
    const char* last = std::to_chars(digits, digits + sizeof digits, narrow(value)).ptr;
    faithful_ = std::isnan(value) || (parseDouble(digits, last, again) && again == value);
  }
  at_ = stop;
  return value;
}

double AsciiRows::number(ScalarType type) {
  if (type < ScalarType::Float32) return static_cast<double>(integer(type, inList_));
  const char* p = token(inList_);
  double value = 0;
  const char* stop = parseDouble(p, end_, value);
  if (!stop || (stop < end_ && !isBlank(*stop) && !isEol(*stop))) failHere(excerpt(p, end_), "a number");
  at_ = stop;
  return type == ScalarType::Float32 ? nearestFloat(p, stop, value) : value;
}

std::int64_t AsciiRows::integer(ScalarType type, bool mayWrap) {
  static constexpr std::pair<std::int64_t, std::int64_t> kRange[] = {
      {-128, 127}, {0, 255}, {-32768, 32767}, {0, 65535}, {-2147483648LL, 2147483647LL}, {0, 4294967295LL}};
  const char* p = token(mayWrap);
  std::int64_t value = 0;
  const char* stop = parseInteger(p, end_, value);
  const auto [low, high] = kRange[static_cast<int>(type)];
  if (!stop || (stop < end_ && !isBlank(*stop) && !isEol(*stop)) || value < low || value > high)
    failHere(excerpt(p, end_), fmt::format("a whole number from {} to {}", low, high));
  at_ = stop;
  return value;
}

std::uint64_t AsciiRows::listCount(ScalarType countType, ScalarType) {
  inList_ = false;
  const std::int64_t n = integer(countType, false);
  if (n < 0) failHere(fmt::format("{} list values", n), "a count >= 0");
  // Two characters a value, the last of the file may lack its separator.
  if (static_cast<std::uint64_t>(n) > (static_cast<std::uint64_t>(end_ - at_) + 1) / 2)
    failHere(fmt::format("{} bytes left", end_ - at_), fmt::format("{} list values", n));
  inList_ = true;
  return static_cast<std::uint64_t>(n);
}

std::int64_t AsciiRows::index(ScalarType type, std::uint64_t limit, std::int64_t lowest) {
  const char* p = token(true);
  const std::int64_t value = integer(type, true);
  if (value < lowest || value >= static_cast<std::int64_t>(limit)) {
    at_ = p;
    failHere(fmt::format("vertex {}", value), fmt::format("less than {}", limit));
  }
  return value;
}

}  // namespace fielddeform::mesh::formats
