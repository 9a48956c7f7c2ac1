#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>

namespace fielddeform {

/// Where in a file something was found. Text formats give a line (and column), binary ones a byte.
struct FilePosition {
  std::optional<std::uint64_t> line;    ///< 1-based
  std::optional<std::uint64_t> column;  ///< 1-based
  std::optional<std::uint64_t> byte;    ///< 0-based offset from the start of the file
};

/// Trouble with a file: unreadable, truncated, malformed, unwritable.
/// what() reads "PATH:LINE: ELEMENT: FOUND, expected EXPECTED" ("PATH: byte N: ..." in binary files).
class IoError : public std::runtime_error {
 public:
  /// @param element  what was being read, e.g. "vertex 17"; may be empty
  /// @param found    what the file holds; never empty
  /// @param expected what it should hold; may be empty
  IoError(std::filesystem::path path, FilePosition position, std::string element, std::string found,
          std::string expected);
  IoError(std::filesystem::path path, std::string message);

  const std::filesystem::path& path() const noexcept { return path_; }
  const FilePosition& position() const noexcept { return position_; }

 private:
  std::filesystem::path path_;
  FilePosition position_;
};

/// The request is well-formed but has no answer (all nodes pinned, no volume to preserve).
class InfeasibleError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Thrown by long work when its Progress was cancelled. Nothing has been written.
class Cancelled : public std::runtime_error {
 public:
  Cancelled() : std::runtime_error("interrupted") {}
};

// Argument checks that are safe against NaN. They throw std::invalid_argument naming argument, value and bound.
void requireFinite(const char* argument, double value);
void requirePositive(const char* argument, double value);                          ///< finite and > 0
void requireInRange(const char* argument, double value, double low, double high);  ///< low <= value <= high

}  // namespace fielddeform
