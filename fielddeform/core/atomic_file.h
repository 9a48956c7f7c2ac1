#pragma once

#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <string>
#include <string_view>

namespace fielddeform {

/// A file that is complete or not there: written beside its target, renamed over it by commit().
/// A target that exists and is no regular file (a pipe, a device) is written through instead, as it cannot be replaced.
/// Without commit() the destructor removes the temporary file and the old target stays as it was.
class AtomicFile {
 public:
  /// @throw IoError if the temporary file cannot be created (missing folder, no permission).
  explicit AtomicFile(std::filesystem::path target);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// @throw IoError if the disk is full or the write fails.
  void write(const void* data, std::size_t bytes);
  void write(std::string_view text) { write(text.data(), text.size()); }
  /// Flushes, then renames over the target (through a symbolic link, onto what it points to).
  /// @throw IoError; the old target is untouched.
  void commit();

  const std::filesystem::path& target() const noexcept { return target_; }

 private:
  std::filesystem::path target_;
  std::filesystem::path temporary_;
  std::FILE* file_ = nullptr;
};

/// Writes a whole text file atomically.
void writeTextFile(const std::filesystem::path& path, std::string_view text);

/// All bytes of a file (or of a pipe, to its end).
/// @throw IoError if it is missing, a folder, or unreadable
std::string readTextFile(const std::filesystem::path& path);

}  // namespace fielddeform
