#pragma once

#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/progress.h>
#include <fielddeform/core/types.h>

#include <charconv>
#include <cstring>
#include <functional>
#include <memory>
#include <string_view>

namespace fielddeform::mesh::formats {

/// Buffered output of bytes and numbers. flush() at the end; the destructor does not.
class Output {
 public:
  using Sink = std::function<void(const char*, std::size_t)>;
  explicit Output(Sink sink, Progress* progress = nullptr)
      : sink_(std::move(sink)), progress_(progress), buffer_(new char[kCapacity]) {}

  void text(std::string_view s) { bytes(s.data(), s.size()); }
  void put(char c) { *room(1) = c, ++used_; }
  void bytes(const void* data, std::size_t size) {
    if (size > kCapacity / 2) {
      flush();
      sink_(static_cast<const char*>(data), size);
    } else if (size != 0) {
      std::memcpy(room(size), data, size);
      used_ += size;
    }
  }
  /// The shortest decimal that reads back as the same double.
  void number(double value) { decimal(value); }
  /// The shortest decimal that reads back as the same float.
  void number(float value) { decimal(value); }
  void integer(std::int64_t value) { decimal(value); }
  /// One scalar as it lies in memory.
  template <class T>
  void raw(const T& value) {
    std::memcpy(room(sizeof(T)), &value, sizeof(T));
    used_ += sizeof(T);
  }
  void flush() {
    if (progress_) progress_->throwIfCancelled();
    if (used_ != 0) sink_(buffer_.get(), used_);
    used_ = 0;
  }

 private:
  static constexpr std::size_t kCapacity = std::size_t{1} << 16;
  char* room(std::size_t size) {
    if (kCapacity - used_ < size) flush();
    return buffer_.get() + used_;
  }
  template <class T>
  void decimal(T value) {
    char* at = room(64);
    used_ += static_cast<std::size_t>(std::to_chars(at, at + 64, value).ptr - at);
  }

  Sink sink_;
  Progress* progress_;
  std::unique_ptr<char[]> buffer_;
  std::size_t used_ = 0;
};

}  // namespace fielddeform::mesh::formats
