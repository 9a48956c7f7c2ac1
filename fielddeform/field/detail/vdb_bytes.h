#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>

namespace fielddeform::field::detail {

/// A number at any address, least significant byte first.
template <class T>
T valueAt(const char* at) {
  T value;
  std::memcpy(&value, at, sizeof(T));
  return value;
}

/// An IEEE number of 16 bits.
double halfAt(const char* at);

/// The bytes of a .vdb file, read from front to back; nothing beyond its end is ever looked at.
class VdbBytes {
 public:
  VdbBytes(std::string_view bytes, std::filesystem::path path) : bytes_(bytes), path_(std::move(path)) {}

  const std::filesystem::path& path() const noexcept { return path_; }
  std::uint64_t at() const noexcept { return at_; }
  /// @throw IoError with the current byte
  [[noreturn]] void fail(const std::string& found, const std::string& expected) const;

  // All throw IoError if the file ends before.
  std::string_view take(std::uint64_t count, const char* what);
  std::string text(const char* what);  ///< 32 bits of length, then so many bytes
  void seek(std::uint64_t at, const char* what);
  template <class T>
  T take(const char* what) {
    return valueAt<T>(take(sizeof(T), what).data());
  }
  /// Fills `out` with values stored whole or compressed. @param compression  OpenVDB's flags: 1 zip, 4 Blosc
  /// @throw IoError also if they are damaged, of another size, or of a kind that this build lacks
  void decompress(std::uint32_t compression, std::string& out);

 private:
  std::string_view bytes_;
  std::filesystem::path path_;
  std::uint64_t at_ = 0;
};

}  // namespace fielddeform::field::detail
