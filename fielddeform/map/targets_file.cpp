#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/error.h>
#include <fielddeform/map/targets_file.h>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

namespace fielddeform::map {
namespace {

std::string_view trimmed(std::string_view s) {
  const auto from = s.find_first_not_of(" \t\r\v\f");
  return from == s.npos ? std::string_view() : s.substr(from, s.find_last_not_of(" \t\r\v\f") + 1 - from);
}

std::string quoted(std::string_view s) {
  std::string text(s.substr(0, 40));
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20 || static_cast<unsigned char>(c) >= 0x7F) c = '?';
  return fmt::format("\"{}\"", text);
}

// The columns that one kind of row may have.
struct Kind {
  std::size_t columns;
  std::string_view header;
};

// Rows of numbers of one kind among several; calls row(numbers) for each.
class Table {
 public:
  Table(std::string_view text, const std::filesystem::path& path, std::span<const Kind> kinds)
      : text_(text), path_(path), kinds_(kinds) {}

  template <class Row>
  void forEachRow(Row&& row) {
    std::vector<double> numbers;
    while (nextLine()) {
      split();
      if (kind_ == nullptr && isHeader()) {
        readHeader();
        continue;
      }
      if (kind_ == nullptr) kind_ = kindOf(fields_.size());
      if (kind_ == nullptr || fields_.size() != kind_->columns)
        fail(fmt::format("{} numbers", fields_.size()), kind_ ? std::string(kind_->header) : expectation());
      numbers.clear();
      for (const std::string_view f : fields_) numbers.push_back(number(f));
      row(numbers);
      ++rows_;
    }
    if (rows_ == 0) fail("end of file", expectation());
  }

  [[noreturn]] void fail(std::string found, std::string expected) const {
    throw IoError(path_, {line_, {}, {}}, fmt::format("row {}", rows_), std::move(found), std::move(expected));
  }
  Vec3 vertex(double number, Points vertices) const {
    if (!(number >= 0) || number != std::floor(number))
      fail(fmt::format("vertex {}", number), "a vertex number, counted from 0");
    if (!(number < static_cast<double>(vertices.size())))
      fail(fmt::format("vertex {}", number), fmt::format("less than {}", vertices.size()));
    const Vec3& p = vertices[static_cast<std::size_t>(number)];
    if (!p.allFinite()) fail(fmt::format("vertex {}", number), "a vertex whose coordinates are finite");
    return p;
  }
  double weight(double number) const {
    if (!(number > 0)) fail(fmt::format("weight {}", number), "a weight > 0");
    return number;
  }

 private:
  // To the next line that holds more than a comment; false at the end.
  bool nextLine() {
    while (!text_.empty()) {
      const auto end = text_.find('\n');
      std::string_view row = text_.substr(0, end);
      text_.remove_prefix(end == text_.npos ? text_.size() : end + 1);
      ++line_;
      if (line_ == 1 && row.starts_with("\xEF\xBB\xBF")) row.remove_prefix(3);
      row_ = trimmed(row.substr(0, row.find('#')));
      if (!row_.empty()) return true;
    }
    return false;
  }
  void split() {
    fields_.clear();
    for (std::string_view left = row_;;) {
      const auto comma = left.find(',');
      fields_.push_back(trimmed(left.substr(0, comma)));
      if (comma == left.npos || fields_.size() > 16) return;  // no row has as many
      left.remove_prefix(comma + 1);
    }
  }
  bool isHeader() const {
    const std::string_view f = fields_.front();
    return !f.empty() && std::isalpha(static_cast<unsigned char>(f[0])) && f != "nan" && f != "inf";
  }
  void readHeader() {
    if (headerSeen_) fail(quoted(row_), expectation());
    headerSeen_ = true;
    std::string plain;
    for (const std::string_view f : fields_) {
      if (!plain.empty()) plain.push_back(',');
      plain.append(f);
    }
    for (const Kind& k : kinds_)
      if (plain == k.header) {
        kind_ = &k;
        return;
      }
    fail(quoted(row_), expectation());
  }
  const Kind* kindOf(std::size_t columns) const {
    const auto it = std::find_if(kinds_.begin(), kinds_.end(), [&](const Kind& k) { return k.columns == columns; });
    return it == kinds_.end() ? nullptr : &*it;
  }
  std::string expectation() const {
    std::string text;
    for (const Kind& k : kinds_) {
      if (!text.empty()) text.append(" or ");
      text.append(k.header);
    }
    return text;
  }
  double number(std::string_view field) const {
    double value = 0;
    std::string_view digits = field;
    if (digits.starts_with('+') && digits.size() > 1 && digits[1] != '-') digits.remove_prefix(1);
    const auto [stop, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error != std::errc() || stop != digits.data() + digits.size() || !std::isfinite(value))
      fail(field.empty() ? "nothing" : quoted(field), "a finite number");
    return value;
  }

  std::string_view text_, row_;
  const std::filesystem::path& path_;
  std::span<const Kind> kinds_;
  const Kind* kind_ = nullptr;
  std::vector<std::string_view> fields_;
  std::uint64_t line_ = 0;
  std::size_t rows_ = 0;
  bool headerSeen_ = false;
};

}  // namespace

std::vector<PointTarget> parseTargets(std::string_view text, const std::filesystem::path& path, Points vertices) {
  static constexpr Kind kKinds[] = {{6, "x,y,z,tx,ty,tz"},
                                    {7, "x,y,z,tx,ty,tz,weight"},
                                    {4, "vertex,tx,ty,tz"},
                                    {5, "vertex,tx,ty,tz,weight"}};
  std::vector<PointTarget> targets;
  Table table(text, path, kKinds);
  table.forEachRow([&](const std::vector<double>& n) {
    PointTarget t;
    const std::size_t k = n.size() < 6 ? 1 : 3;
    t.rest = k == 1 ? table.vertex(n[0], vertices) : Vec3(n[0], n[1], n[2]);
    t.image = Vec3(n[k], n[k + 1], n[k + 2]);
    if (n.size() > k + 3) t.weight = table.weight(n[k + 3]);
    targets.push_back(t);
  });
  return targets;
}

std::vector<Vec3> parsePins(std::string_view text, const std::filesystem::path& path, Points vertices) {
  static constexpr Kind kKinds[] = {{3, "x,y,z"}, {1, "vertex"}};
  std::vector<Vec3> pins;
  Table table(text, path, kKinds);
  table.forEachRow([&](const std::vector<double>& n) {
    pins.push_back(n.size() == 1 ? table.vertex(n[0], vertices) : Vec3(n[0], n[1], n[2]));
  });
  return pins;
}

std::vector<PointTarget> readTargets(const std::filesystem::path& path, Points vertices) {
  return parseTargets(readTextFile(path), path, vertices);
}
std::vector<Vec3> readPins(const std::filesystem::path& path, Points vertices) {
  return parsePins(readTextFile(path), path, vertices);
}

}  // namespace fielddeform::map
