#pragma once

#include <fielddeform/core/error.h>
#include <fielddeform/core/progress.h>

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

namespace fielddeform::mesh::formats {

/// A whole file in memory. Read, not mapped: a file that shrinks meanwhile must not kill the program.
class FileBytes {
 public:
  /// @throw IoError if it cannot be opened or read.
  explicit FileBytes(const std::filesystem::path& path);
  std::span<const char> bytes() const noexcept { return {data_.get(), size_}; }

 private:
  struct Free {
    void operator()(char* p) const noexcept { std::free(p); }
  };
  std::unique_ptr<char, Free> data_;
  std::size_t size_ = 0;
};

/// What a reader reads: bytes, and the name for messages.
struct Source {
  std::span<const char> bytes;
  std::filesystem::path path;
  Progress* progress = nullptr;

  const char* begin() const noexcept { return bytes.data(); }
  const char* end() const noexcept { return bytes.data() + bytes.size(); }
  /// Reports how far a reader has come, and stops it when cancelled. Call it every some thousand elements.
  void advance(const char* at) const {
    if (!progress) return;
    progress->throwIfCancelled();
    if (!bytes.empty()) progress->advance(static_cast<double>(at - begin()) / static_cast<double>(bytes.size()));
  }

  /// Trouble at a place of a text file: the error carries its line.
  [[noreturn]] void failText(const char* at, std::string element, std::string found, std::string expected) const;
  /// Trouble at a place of a binary file: the error carries its byte.
  [[noreturn]] void failBinary(const char* at, std::string element, std::string found, std::string expected) const;
};

/// What stands at a place, for messages: 'token', "end of line" or "end of file".
std::string excerpt(const char* at, const char* end);

/// The rest of the path's folder: where relative names inside the file start. Empty for a bare name in memory.
std::filesystem::path folderOf(const std::filesystem::path& path);

/// `name`, relative to folder `from`, as seen from folder `to`; unchanged if it is absolute, if no such file is in
/// `from`, or if both folders are the same.
std::string relocated(const std::string& name, const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace fielddeform::mesh::formats
