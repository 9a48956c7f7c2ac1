#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/detail/json_tree.h>
#include <fielddeform/core/error.h>
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <nlohmann/json.hpp>
#include <vector>

namespace fielddeform {
namespace detail {

FilePosition JsonTree::position(std::size_t offset) const {
  offset = std::min(offset, text.size());
  const auto upTo = text.begin() + static_cast<std::ptrdiff_t>(offset);
  FilePosition p;
  p.line = 1 + static_cast<std::uint64_t>(std::count(text.begin(), upTo, '\n'));
  const std::size_t newline = offset == 0 ? std::string::npos : text.rfind('\n', offset - 1);
  p.column = newline == std::string::npos ? offset + 1 : offset - newline;
  return p;
}

// The offset behind the token that begins at `begin`; the text is well-formed there.
std::size_t tokenEnd(std::string_view text, std::size_t begin) {
  switch (text[begin]) {
    case '{': case '}': case '[': case ']': return begin + 1;
    case '"':
      for (std::size_t i = begin + 1;; ++i) {
        if (text[i] == '\\') ++i;
        else if (text[i] == '"') return i + 1;
      }
    default: {
      const std::size_t end = text.find_first_of(" \t\r\n,:]}", begin);
      return end == std::string_view::npos ? text.size() : end;
    }
  }
}

std::size_t tokenBegin(std::string_view text, std::size_t from) {
  const std::size_t begin = text.find_first_not_of(" \t\r\n,:", from);
  return begin == std::string_view::npos ? text.size() : begin;
}

std::size_t JsonTree::endOf(std::size_t begin) const {
  std::size_t depth = 0;
  for (std::size_t at = begin;;) {
    const char c = text[at];
    if (c == '{' || c == '[') ++depth;
    if (c == '}' || c == ']') --depth;
    at = tokenEnd(text, at);
    if (depth == 0) return at;
    at = tokenBegin(text, at);
  }
}

// Receives the parser's events in order and walks the text along with them, so that each node knows its place.
class JsonBuilder : public nlohmann::json_sax<nlohmann::json> {
 public:
  explicit JsonBuilder(JsonTree& tree) : tree_(tree) {
    if (tree.text.starts_with("\xEF\xBB\xBF")) at_ = 3;
  }
  bool null() override { return add(JsonKind::Null, 0); }
  bool boolean(bool b) override { return add(JsonKind::Boolean, b ? 1 : 0); }
  bool number_integer(std::int64_t n) override {
    // "-0" arrives as the integer 0: the sign is in the text alone.
    const bool minusZero = n == 0 && tree_.text[tokenBegin(tree_.text, at_)] == '-';
    return addNumber(minusZero ? -0.0 : static_cast<double>(n));
  }
  bool number_unsigned(std::uint64_t n) override { return addNumber(static_cast<double>(n)); }
  bool number_float(double n, const std::string&) override { return addNumber(n); }
  bool string(std::string& s) override { return addString(s, false); }
  bool key(std::string& s) override { return addString(s, true); }
  bool binary(nlohmann::json::binary_t&) override { return false; }
  bool start_object(std::size_t) override { return open(JsonKind::Object); }
  bool start_array(std::size_t) override { return open(JsonKind::Array); }
  bool end_array() override { return close(); }
  bool end_object() override {
    refuseDuplicates(open_.back());
    return close();
  }
  bool parse_error(std::size_t position, const std::string&, const nlohmann::json::exception& error) override {
    // "[json.exception.parse_error.101] parse error at line 1, column 2: WHAT; expected THAT"
    std::string what = error.what();
    if (const auto head = what.find("column "); head != std::string::npos)
      if (const auto colon = what.find(": ", head); colon != std::string::npos) what.erase(0, colon + 2);
    if (what.starts_with("[")) what.erase(0, what.find("] ") + 2);
    std::string expected;
    if (const auto split = what.rfind("; expected "); split != std::string::npos) {
      expected = what.substr(split + 11);
      what.erase(split);
    }
    if (what.size() > 200) what = what.substr(0, 200) + "...";
    throw IoError(tree_.path, tree_.position(position == 0 ? 0 : position - 1), "", what, expected);
  }

 private:
  bool add(JsonKind kind, std::uint64_t value, bool isKey = false) {
    const std::size_t begin = tokenBegin(tree_.text, at_);
    at_ = tokenEnd(tree_.text, begin);
    if (!isKey && !open_.empty()) tree_.nodes[open_.back()].value += std::uint64_t{1} << 32;
    tree_.nodes.push_back({value, static_cast<std::uint32_t>(begin), kind, isKey, afterKey_});
    afterKey_ = isKey;
    return true;
  }
  bool addNumber(double n) { return add(JsonKind::Number, std::bit_cast<std::uint64_t>(n)); }
  bool addString(const std::string& s, bool isKey) {
    const std::uint64_t begin = tree_.pool.size();
    tree_.pool += s;
    return add(JsonKind::String, begin << 32 | s.size(), isKey);
  }
  bool open(JsonKind kind) {
    add(kind, 0);
    open_.push_back(static_cast<Index>(tree_.nodes.size() - 1));
    return true;
  }
  bool close() {
    at_ = tokenEnd(tree_.text, tokenBegin(tree_.text, at_));
    tree_.nodes[open_.back()].value |= tree_.nodes.size();
    open_.pop_back();
    return true;
  }
  void refuseDuplicates(Index object) {
    keys_.clear();
    for (Index k = object + 1; k < tree_.nodes.size(); k = tree_.after(k + 1)) keys_.push_back(k);
    const auto name = [&](Index k) { return tree_.string(tree_.nodes[k]); };
    std::sort(keys_.begin(), keys_.end(), [&](Index a, Index b) {
      const int order = name(a).compare(name(b));
      return order != 0 ? order < 0 : a < b;
    });
    const auto twice = std::adjacent_find(keys_.begin(), keys_.end(), [&](Index a, Index b) { return name(a) == name(b); });
    if (twice == keys_.end()) return;
    const FilePosition first = tree_.position(tree_.nodes[twice[0]].offset);
    throw IoError(tree_.path, tree_.position(tree_.nodes[twice[1]].offset), "",
                  fmt::format("the key \"{}\" a second time", name(twice[1])),
                  fmt::format("each key once (it stands in line {})", *first.line));
  }

  JsonTree& tree_;
  std::size_t at_ = 0;
  std::vector<Index> open_;
  std::vector<Index> keys_;
  bool afterKey_ = false;
};

}  // namespace detail

using detail::JsonTree;

JsonDocument::JsonDocument(std::unique_ptr<JsonTree> tree) noexcept : tree_(std::move(tree)) {}
JsonDocument::JsonDocument(JsonDocument&&) noexcept = default;
JsonDocument& JsonDocument::operator=(JsonDocument&&) noexcept = default;
JsonDocument::~JsonDocument() = default;

JsonDocument JsonDocument::parse(std::string text, std::filesystem::path path) {
  if (text.size() >= kNoIndex) throw IoError(path, fmt::format("{} bytes of JSON, expected less than 4 GB", text.size()));
  auto tree = std::make_unique<JsonTree>();
  tree->text = std::move(text);
  tree->path = std::move(path);
  detail::JsonBuilder builder(*tree);
  const char* begin = tree->text.data();
  // A parser that stops early has thrown: every handler returns true.
  nlohmann::json::sax_parse(begin, begin + tree->text.size(), &builder);
  return JsonDocument(std::move(tree));
}

JsonDocument JsonDocument::read(const std::filesystem::path& path) { return parse(readTextFile(path), path); }

JsonValue JsonDocument::root() const noexcept { return {tree_.get(), 0}; }
const std::filesystem::path& JsonDocument::path() const noexcept { return tree_->path; }

int JsonDocument::requireFormat(std::string_view name, int newest) const {
  const JsonValue format = root().require("format");
  if (format.string() != name) format.fail("", fmt::format("\"{}\"", name));
  const JsonValue version = root().require("version");
  const double number = version.number();
  if (number > newest) version.fail(fmt::format("version {}", number), fmt::format("at most {}: a newer program wrote this file", newest));
  return static_cast<int>(version.integer(1, static_cast<std::uint64_t>(newest)));
}

}  // namespace fielddeform
