#include <fielddeform/core/json_writer.h>
#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <stdexcept>

namespace fielddeform {
namespace {

// Bytes of the well-formed UTF-8 character at the front; 0 if it is none [Unicode 15, table 3-7].
std::size_t characterLength(std::string_view s) {
  const auto at = [&](std::size_t i) { return i < s.size() ? static_cast<unsigned char>(s[i]) : 0u; };
  const auto tail = [&](std::size_t i) { return at(i) >= 0x80 && at(i) <= 0xBF; };
  const unsigned a = at(0), b = at(1);
  if (a < 0x80) return 1;
  if (a >= 0xC2 && a <= 0xDF) return tail(1) ? 2 : 0;
  if (a >= 0xE0 && a <= 0xEF) {
    const unsigned low = a == 0xE0 ? 0xA0 : 0x80, high = a == 0xED ? 0x9F : 0xBF;
    return b >= low && b <= high && tail(2) ? 3 : 0;
  }
  if (a >= 0xF0 && a <= 0xF4) {
    const unsigned low = a == 0xF0 ? 0x90 : 0x80, high = a == 0xF4 ? 0x8F : 0xBF;
    return b >= low && b <= high && tail(2) && tail(3) ? 4 : 0;
  }
  return 0;
}

std::string quoted(std::string_view s) {
  std::string out = "\"";
  for (std::size_t i = 0; i < s.size();) {
    const std::size_t n = characterLength(s.substr(i));
    const char c = s[i];
    if (n == 0) out += "\xEF\xBF\xBD";
    else if (n > 1) out += s.substr(i, n);
    else if (c == '"' || c == '\\') (out += '\\') += c;
    else if (c == '\n') out += "\\n";
    else if (c == '\t') out += "\\t";
    else if (c == '\r') out += "\\r";
    else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) out += fmt::format("\\u{:04x}", static_cast<int>(c));
    else out += c;
    i += n == 0 ? 1 : n;
  }
  return out += '"';
}

}  // namespace

std::string shortestNumber(double value) {
  if (!std::isfinite(value)) throw std::invalid_argument(fmt::format("JSON: number is {}, must be finite", value));
  if (value == 0 && std::signbit(value)) return "-0.0";
  char digits[32];
  const auto end = std::to_chars(digits, digits + sizeof digits, value).ptr;
  return std::string(digits, end);
}

JsonWriter& JsonWriter::beginObject(JsonLayout layout) { return open('{', '}', layout); }
JsonWriter& JsonWriter::beginArray(JsonLayout layout) { return open('[', ']', layout); }

JsonWriter& JsonWriter::open(char begin, char close, JsonLayout layout) {
  beforeValue();
  const bool lines = layout == JsonLayout::Lines && (levels_.empty() || levels_.back().lines);
  text_ += begin;
  levels_.push_back({close, lines, true});
  return *this;
}

JsonWriter& JsonWriter::end() {
  if (levels_.empty()) throw std::logic_error("JsonWriter: end() without a begin");
  const Level level = levels_.back();
  levels_.pop_back();
  if (level.lines && !level.empty) newline();
  text_ += level.close;
  return *this;
}

void JsonWriter::newline() {
  text_ += '\n';
  text_.append(2 * levels_.size(), ' ');
}

void JsonWriter::beforeValue() {
  if (afterKey_ || levels_.empty()) {
    afterKey_ = false;
    return;
  }
  Level& level = levels_.back();
  if (!level.empty) text_ += level.lines ? "," : ", ";
  level.empty = false;
  if (level.lines) newline();
}

JsonWriter& JsonWriter::key(std::string_view name) {
  beforeValue();
  text_ += quoted(name);
  text_ += ": ";
  afterKey_ = true;
  return *this;
}

JsonWriter& JsonWriter::raw(std::string_view json) {
  beforeValue();
  text_ += json;
  return *this;
}

JsonWriter& JsonWriter::value(double number) { return raw(shortestNumber(number)); }
JsonWriter& JsonWriter::value(std::string_view string) { return raw(quoted(string)); }
JsonWriter& JsonWriter::value(bool boolean) { return raw(boolean ? "true" : "false"); }

JsonWriter& JsonWriter::value(const Vec3& v) {
  return beginArray(JsonLayout::Inline).value(v.x()).value(v.y()).value(v.z()).end();
}

std::string JsonWriter::text() const {
  if (!levels_.empty() || afterKey_) throw std::logic_error("JsonWriter: something is not closed");
  return text_ + '\n';
}

}  // namespace fielddeform
