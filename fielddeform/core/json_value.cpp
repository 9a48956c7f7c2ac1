#include <fielddeform/core/detail/json_tree.h>
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

namespace fielddeform {
namespace {

using detail::JsonNode;
using detail::JsonTree;

constexpr const char* kKindNames[] = {"null", "true or false", "a number", "a string", "an array", "an object"};

std::string quotedList(std::span<const std::string_view> words) {
  std::string list;
  for (const std::string_view w : words) list += fmt::format("{}\"{}\"", list.empty() ? "" : ", ", w);
  return list;
}

std::string suggestion(std::string_view word, std::span<const std::string_view> words) {
  const std::string_view close = closestWord(word, words);
  return close.empty() ? "" : fmt::format("; did you mean \"{}\"?", close);
}

const JsonNode& checked(const JsonValue& value, const JsonTree& tree, Index node, JsonKind wanted) {
  if (value.kind() != wanted) value.fail("", kKindNames[static_cast<int>(wanted)]);
  return tree.nodes[node];
}

std::string escapedForPointer(std::string_view key) {
  std::string out;
  for (const char c : key) out += c == '~' ? "~0" : c == '/' ? "~1" : std::string(1, c);
  return out;
}

}  // namespace

JsonKind JsonValue::kind() const noexcept { return tree_->nodes[node_].kind; }

double JsonValue::number() const {
  return std::bit_cast<double>(checked(*this, *tree_, node_, JsonKind::Number).value);
}

double JsonValue::positive() const {
  const double x = number();
  if (!(x > 0)) fail("", "a number > 0");
  return x;
}

double JsonValue::nonNegative() const {
  const double x = number();
  if (!(x >= 0)) fail("", "a number >= 0");
  return x;
}

double JsonValue::inRange(double low, double high) const {
  const double x = number();
  if (!(x >= low && x <= high)) fail("", fmt::format("a number from {} to {}", low, high));
  return x;
}

std::uint64_t JsonValue::integer(std::uint64_t low, std::uint64_t high) const {
  const double x = number();
  if (!(x >= static_cast<double>(low) && x <= static_cast<double>(high) && x == std::floor(x)))
    fail("", fmt::format("a whole number from {} to {}", low, high));
  return static_cast<std::uint64_t>(x);
}

bool JsonValue::boolean() const { return checked(*this, *tree_, node_, JsonKind::Boolean).value != 0; }

std::string JsonValue::string() const {
  return std::string(tree_->string(checked(*this, *tree_, node_, JsonKind::String)));
}

std::size_t JsonValue::word(std::span<const std::string_view> words) const {
  const std::string_view mine = tree_->string(checked(*this, *tree_, node_, JsonKind::String));
  const auto found = std::find(words.begin(), words.end(), mine);
  if (found == words.end()) fail("", quotedList(words) + suggestion(mine, words));
  return static_cast<std::size_t>(found - words.begin());
}

std::size_t JsonValue::word(std::initializer_list<std::string_view> words) const {
  return word(std::span<const std::string_view>(words.begin(), words.size()));
}

Vec3 JsonValue::vec3() const {
  if (kind() != JsonKind::Array || size() != 3) fail("", "three numbers [x, y, z]");
  Vec3 v;
  int k = 0;
  for (const JsonValue x : array()) v[k++] = x.number();
  return v;
}

std::size_t JsonValue::size() const noexcept {
  const JsonNode& n = tree_->nodes[node_];
  return n.isContainer() ? n.high() : 0;
}

JsonRange JsonValue::array() const {
  const JsonNode& n = checked(*this, *tree_, node_, JsonKind::Array);
  return {tree_, node_ + 1, n.low(), 0, n.high()};
}

JsonRange JsonValue::array(std::size_t count) const {
  const JsonRange range = array();
  if (range.size() != count) fail(fmt::format("{} elements", range.size()), fmt::format("{}", count));
  return range;
}

JsonRange JsonValue::members() const {
  const JsonNode& n = checked(*this, *tree_, node_, JsonKind::Object);
  return {tree_, node_ + 2, n.low() + 1, 1, n.high()};
}

void JsonValue::allowKeys(std::initializer_list<std::string_view> keys) const {
  for (const JsonValue member : members()) {
    const std::string_view name = tree_->string(tree_->nodes[member.node_ - 1]);
    if (std::find(keys.begin(), keys.end(), name) != keys.end()) continue;
    const std::span<const std::string_view> words(keys.begin(), keys.size());
    member.fail("unknown key", quotedList(words) + suggestion(name, words));
  }
}

std::optional<JsonValue> JsonValue::find(std::string_view key) const {
  for (const JsonValue member : members())
    if (tree_->string(tree_->nodes[member.node_ - 1]) == key) return member;
  return std::nullopt;
}

JsonValue JsonValue::require(std::string_view key) const {
  if (const auto found = find(key)) return *found;
  fail(fmt::format("no key \"{}\"", key), "one");
}

std::string JsonValue::key() const {
  return tree_->nodes[node_].isMember ? std::string(tree_->string(tree_->nodes[node_ - 1])) : std::string();
}

std::string JsonValue::pointer() const {
  std::string path;
  for (Index at = 0; at != node_;) {
    const bool object = tree_->nodes[at].kind == JsonKind::Object;
    Index child = at + 1 + (object ? 1 : 0);
    std::size_t position = 0;
    for (; tree_->after(child) <= node_; ++position) child = tree_->after(child) + (object ? 1 : 0);
    path += '/';
    path += object ? escapedForPointer(tree_->string(tree_->nodes[child - 1])) : std::to_string(position);
    at = child;
  }
  return path;
}

std::uint64_t JsonValue::line() const noexcept { return *tree_->position(tree_->nodes[node_].offset).line; }

std::string_view JsonValue::text() const noexcept {
  const std::size_t begin = tree_->nodes[node_].offset;
  return std::string_view(tree_->text).substr(begin, tree_->endOf(begin) - begin);
}

void JsonValue::fail(std::string found, std::string expected) const {
  if (found.empty()) {
    found = text();
    if (found.size() > 60) found = found.substr(0, 57) + "...";
    std::replace(found.begin(), found.end(), '\n', ' ');
  }
  FilePosition position;
  position.line = line();
  const std::string where = pointer();
  throw IoError(tree_->path, position, where.empty() ? "the whole file" : where, std::move(found), std::move(expected));
}

JsonRange::Iterator& JsonRange::Iterator::operator++() noexcept {
  node_ = tree_->after(node_) + keys_;
  return *this;
}

std::string_view closestWord(std::string_view word, std::span<const std::string_view> words) {
  std::string_view best;
  std::size_t least = std::max<std::size_t>(1, std::min<std::size_t>(word.size(), 64) / 3) + 1;
  if (word.size() > 64) return best;
  for (const std::string_view candidate : words) {
    // Optimal string alignment: three rows of the table of distances between prefixes.
    std::vector<std::size_t> before, row(candidate.size() + 1), next(candidate.size() + 1);
    std::iota(row.begin(), row.end(), std::size_t{0});
    for (std::size_t i = 1; i <= word.size(); ++i) {
      next[0] = i;
      for (std::size_t j = 1; j <= candidate.size(); ++j) {
        const std::size_t change = word[i - 1] == candidate[j - 1] ? 0 : 1;
        next[j] = std::min({row[j] + 1, next[j - 1] + 1, row[j - 1] + change});
        if (i > 1 && j > 1 && word[i - 1] == candidate[j - 2] && word[i - 2] == candidate[j - 1])
          next[j] = std::min(next[j], before[j - 2] + 1);
      }
      before = row;
      std::swap(row, next);
    }
    if (row.back() < least) {
      least = row.back();
      best = candidate;
    }
  }
  return best;
}

}  // namespace fielddeform
