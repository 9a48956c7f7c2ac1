#pragma once

#include <fielddeform/core/types.h>

#include <filesystem>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

/// JSON files that answer mistakes with a place: syntax errors give line and column, all others a JSON Pointer with its
/// line ("scene.json:12: /edits/0/op: \"bnd\", expected \"bend\", \"twist\"; did you mean \"bend\"?").
///
///   const JsonDocument document = JsonDocument::read(path);
///   const JsonValue root = document.root();
///   root.allowKeys({"format", "version", "radius", "extras"});       // anything else is refused, with a suggestion
///   const double radius = root.require("radius").positive();
///   if (const auto weight = root.find("weight")) w = weight->nonNegative();
///   for (const JsonValue item : root.require("points").array()) points.push_back(item.vec3());
///
/// Every accessor throws IoError if the value is of another kind or out of range. Values are small handles that are
/// valid while their document lives. Memory is linear in the text's size; nothing recurses.
namespace fielddeform {

enum class JsonKind : std::uint8_t { Null, Boolean, Number, String, Array, Object };

namespace detail {
struct JsonTree;
}

class JsonRange;

/// One value of a document.
class JsonValue {
 public:
  JsonKind kind() const noexcept;
  bool isNull() const noexcept { return kind() == JsonKind::Null; }

  double number() const;                            ///< finite, always (JSON has no other)
  double positive() const;                          ///< > 0
  double nonNegative() const;                       ///< >= 0
  double inRange(double low, double high) const;    ///< low <= value <= high
  std::uint64_t integer(std::uint64_t low, std::uint64_t high) const;  ///< a whole number, low <= value <= high <= 2^53
  bool boolean() const;
  std::string string() const;
  /// The index of a string among words. @throw IoError listing the words, with the closest one as a suggestion.
  std::size_t word(std::span<const std::string_view> words) const;
  std::size_t word(std::initializer_list<std::string_view> words) const;
  Vec3 vec3() const;                                ///< an array of three numbers

  std::size_t size() const noexcept;                ///< elements of an array, members of an object, else 0
  /// The elements in order. @throw IoError if it is no array.
  JsonRange array() const;
  /// As array(). @throw IoError also if the element count is not exactly `count`.
  JsonRange array(std::size_t count) const;

  /// @throw IoError if it is no object, or for the first member that is not among keys, suggesting the closest one
  void allowKeys(std::initializer_list<std::string_view> keys) const;
  /// The member of this name, if there is one. @throw IoError if it is no object.
  std::optional<JsonValue> find(std::string_view key) const;
  /// @throw IoError if there is no member of this name
  JsonValue require(std::string_view key) const;
  /// Name of the member whose value this is; empty if it is no member.
  std::string key() const;
  /// Members of an object in the file's order, as values with key(). @throw IoError if it is no object.
  JsonRange members() const;

  /// JSON Pointer [RFC 6901] of this value, "" for the root.
  std::string pointer() const;
  std::uint64_t line() const noexcept;              ///< 1-based
  /// The value's text as it stands in the file.
  std::string_view text() const noexcept;
  /// Refuses this value. `found` may be empty: the value's own (shortened) text then.
  [[noreturn]] void fail(std::string found, std::string expected) const;

 private:
  friend class JsonDocument;
  friend class JsonRange;
  JsonValue(const detail::JsonTree* tree, Index node) noexcept : tree_(tree), node_(node) {}
  const detail::JsonTree* tree_;
  Index node_;
};

/// Elements of an array or members of an object, for range-based loops.
class JsonRange {
 public:
  class Iterator {
   public:
    JsonValue operator*() const noexcept { return {tree_, node_}; }
    Iterator& operator++() noexcept;
    bool operator==(const Iterator& other) const noexcept { return node_ == other.node_; }

   private:
    friend class JsonRange;
    Iterator(const detail::JsonTree* tree, Index node, Index keys) noexcept : tree_(tree), node_(node), keys_(keys) {}
    const detail::JsonTree* tree_;
    Index node_;
    Index keys_;
  };
  Iterator begin() const noexcept { return {tree_, first_, keys_}; }
  Iterator end() const noexcept { return {tree_, last_, keys_}; }
  std::size_t size() const noexcept { return size_; }

 private:
  friend class JsonValue;
  JsonRange(const detail::JsonTree* tree, Index first, Index last, Index keys, std::size_t size) noexcept
      : tree_(tree), first_(first), last_(last), keys_(keys), size_(size) {}
  const detail::JsonTree* tree_;
  Index first_, last_;
  Index keys_;  ///< nodes between two values: 1 in an object (the key), 0 in an array
  std::size_t size_;
};

/// A parsed JSON text. Movable; values stay valid when it moves.
class JsonDocument {
 public:
  /// @param path  only named in errors
  /// @throw IoError for a syntax error, a duplicate key (in any object), a number beyond double, or bad UTF-8
  static JsonDocument parse(std::string text, std::filesystem::path path);
  /// Reads a file. @throw IoError as parse, and if it cannot be read
  static JsonDocument read(const std::filesystem::path& path);

  JsonDocument(JsonDocument&&) noexcept;
  JsonDocument& operator=(JsonDocument&&) noexcept;
  ~JsonDocument();

  JsonValue root() const noexcept;
  const std::filesystem::path& path() const noexcept;
  /// Checks the two members every file of ours begins with: {"format": NAME, "version": 1, ...}.
  /// @throw IoError if the root is no object, the format another, or the version not in 1..newest
  int requireFormat(std::string_view name, int newest) const;

 private:
  explicit JsonDocument(std::unique_ptr<detail::JsonTree> tree) noexcept;
  std::unique_ptr<detail::JsonTree> tree_;
};

/// The word closest to a misspelt one by edit distance (transposed neighbours count one), ties to the first; empty if
/// none is near (more than a third of the word's letters, at least one, would have to change).
std::string_view closestWord(std::string_view word, std::span<const std::string_view> words);

}  // namespace fielddeform
