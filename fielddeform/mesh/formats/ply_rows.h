#pragma once

#include <fielddeform/mesh/formats/ply.h>
#include <fielddeform/mesh/formats/text.h>

#include <string_view>

/// The rows of a PLY element, token by token or scalar by scalar; used by ply_read.cpp alone.
namespace fielddeform::mesh::formats {

inline constexpr std::size_t kNoColumn = static_cast<std::size_t>(-1);

/// Where a property's values go.
struct Column {
  const PlyProperty* property = nullptr;
  std::size_t owner = kNoColumn;  ///< the column whose attribute takes them
  Attribute list;                 ///< of an owner
};

void store(AttributeData& data, std::size_t index, double value);
void push(AttributeData& data, double value);

/// Faces as they arrive; offsets only from the first face that is no triangle.
struct FaceCollector {
  std::vector<Index> corners, offsets;

  bool uniform() const noexcept { return offsets.empty(); }
  std::size_t count() const noexcept { return uniform() ? corners.size() / 3 : offsets.size() - 1; }
  /// Call when the n corners of a face were appended.
  void endFace(std::uint64_t n);
  void beginStrip() noexcept { inStrip_ = 0; }
  void addToStrip(std::int64_t vertex);  ///< -1 starts anew
  /// True if these are the offsets of lists of `width` values a corner.
  bool matches(const std::vector<Index>& listOffsets, std::size_t width) const;

 private:
  std::size_t inStrip_ = 0;
  Index a_ = 0, b_ = 0;
};

/// What both kinds of rows share: the place for messages.
class RowsBase {
 public:
  RowsBase(const Source& source, const char* at) : source_(source), at_(at), end_(source.end()) {}
  const char* at() const noexcept { return at_; }
  void beginProperty(std::string_view name) noexcept { property_ = name; }

 protected:
  std::string where() const;
  const Source& source_;
  const char *at_, *end_;
  std::string_view element_, property_;
  std::uint64_t row_ = 0;
};

template <bool Swap>
class BinaryRows : public RowsBase {
 public:
  using RowsBase::RowsBase;
  void beginRow(std::string_view element, std::uint64_t row) noexcept { element_ = element, row_ = row; }
  void endRow() noexcept {}
  bool faithfulFloats() const noexcept { return true; }
  double coordinate(ScalarType type) { return number(type); }
  double number(ScalarType type) {
    need(static_cast<std::uint64_t>(byteSize(type)));
    return withScalar(type, [&](auto scalar) {
      using T = decltype(scalar);
      const T value = loadScalar<T, Swap>(at_);
      at_ += sizeof(T);
      if constexpr (std::is_same_v<T, float>)
        return widen(value);
      else
        return static_cast<double>(value);
    });
  }
  std::uint64_t listCount(ScalarType countType, ScalarType type) {
    const auto n = static_cast<std::int64_t>(number(countType));
    if (n < 0) failHere(std::to_string(n) + " list values", "a count >= 0");
    need(static_cast<std::uint64_t>(n) * static_cast<std::uint64_t>(byteSize(type)));
    return static_cast<std::uint64_t>(n);
  }
  std::int64_t index(ScalarType type, std::uint64_t limit, std::int64_t lowest) {
    const auto value = static_cast<std::int64_t>(number(type));
    if (value < lowest || value >= static_cast<std::int64_t>(limit)) failIndex(value, limit);
    return value;
  }
  [[noreturn]] void failHere(std::string found, std::string expected) const {
    source_.failBinary(at_, where(), std::move(found), std::move(expected));
  }

 private:
  void need(std::uint64_t bytes) const {
    if (static_cast<std::uint64_t>(end_ - at_) < bytes)
      failHere("end of file after " + std::to_string(end_ - at_) + " bytes", std::to_string(bytes) + " bytes");
  }
  [[noreturn]] void failIndex(std::int64_t value, std::uint64_t limit) const {
    failHere("vertex " + std::to_string(value), "less than " + std::to_string(limit));
  }
};

class AsciiRows : public RowsBase {
 public:
  using RowsBase::RowsBase;
  void beginRow(std::string_view element, std::uint64_t row);
  void beginProperty(std::string_view name) noexcept { property_ = name, inList_ = false; }
  void endRow();
  bool faithfulFloats() const noexcept { return faithful_; }
  /// A coordinate with all its digits; notes whether those of "float" coordinates are no more than a float needs.
  double coordinate(ScalarType type);
  double number(ScalarType type);
  std::uint64_t listCount(ScalarType countType, ScalarType type);
  std::int64_t index(ScalarType type, std::uint64_t limit, std::int64_t lowest);
  [[noreturn]] void failHere(std::string found, std::string expected) const;

 private:
  const char* token(bool mayWrap);
  std::int64_t integer(ScalarType type, bool mayWrap);
  bool inList_ = false;
  bool faithful_ = true;
};

}  // namespace fielddeform::mesh::formats
