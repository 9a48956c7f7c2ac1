#include <fcntl.h>
#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/error.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <fstream>

namespace fielddeform {
namespace {

std::string reason() { return std::strerror(errno); }

// Permissions that open(2) would have given: the target's own, or 0666 less the umask.
mode_t wantedMode(const std::filesystem::path& target) {
  struct stat info {};
  if (::stat(target.c_str(), &info) == 0) return info.st_mode & 0777;
  return 0666;
}

}  // namespace

AtomicFile::AtomicFile(std::filesystem::path target) : target_(std::move(target)) {
  std::error_code ignored;
  // A link is followed so that the file it names is replaced, not the link.
  if (std::filesystem::is_symlink(target_, ignored)) {
    const auto real = std::filesystem::weakly_canonical(target_, ignored);
    if (!ignored) target_ = real;
  }
  if (std::filesystem::is_directory(target_, ignored)) throw IoError(target_, "is a folder, expected a file to write");
  // A pipe, a terminal or another device is written through: renaming over it would destroy it.
  if (std::filesystem::exists(target_, ignored) && !std::filesystem::is_regular_file(target_, ignored)) {
    file_ = std::fopen(target_.c_str(), "wb");
    if (!file_) throw IoError(target_, "cannot be written: " + reason());
    return;
  }
  static std::atomic<unsigned> counter{0};
  const mode_t mode = wantedMode(target_);
  for (int attempt = 0; attempt < 100; ++attempt) {
    temporary_ = target_.parent_path() /
                 fmt::format(".{}.{}.{}.tmp", target_.filename().string(), ::getpid(), counter.fetch_add(1));
    const int fd = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
    if (fd >= 0) {
      file_ = ::fdopen(fd, "wb");
      std::setvbuf(file_, nullptr, _IOFBF, 1 << 20);
      return;
    }
    if (errno != EEXIST) break;
  }
  throw IoError(target_, "cannot be written: " + reason());
}

AtomicFile::~AtomicFile() {
  if (!file_) return;
  std::fclose(file_);
  if (!temporary_.empty()) ::unlink(temporary_.c_str());
}

void AtomicFile::write(const void* data, std::size_t bytes) {
  if (bytes != 0 && std::fwrite(data, 1, bytes, file_) != bytes) throw IoError(target_, "cannot be written: " + reason());
}

void AtomicFile::commit() {
  const bool flushed = std::fflush(file_) == 0;
  const std::string why = flushed ? "" : reason();
  const bool closed = std::fclose(file_) == 0;
  file_ = nullptr;
  const bool through = temporary_.empty();
  if (!flushed || !closed || (!through && ::rename(temporary_.c_str(), target_.c_str()) != 0)) {
    const std::string message = "cannot be written: " + (why.empty() ? reason() : why);
    if (!through) ::unlink(temporary_.c_str());
    throw IoError(target_, message);
  }
}

void writeTextFile(const std::filesystem::path& path, std::string_view text) {
  AtomicFile file(path);
  file.write(text);
  file.commit();
}

std::string readTextFile(const std::filesystem::path& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) throw IoError(path, "is a folder, expected a file");
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw IoError(path, std::filesystem::exists(path, error) ? "cannot be read" : "does not exist");
  std::string text;
  char block[1 << 16];
  while (stream.read(block, sizeof block) || stream.gcount() > 0)
    text.append(block, static_cast<std::size_t>(stream.gcount()));
  if (stream.bad()) throw IoError(path, "cannot be read");
  return text;
}

}  // namespace fielddeform
