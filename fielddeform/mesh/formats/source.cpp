#include <fielddeform/mesh/formats/source.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace fielddeform::mesh::formats {
namespace fs = std::filesystem;

namespace {

constexpr std::size_t kHugePage = std::size_t{2} << 20;

// Memory for a whole file, to be given to free(). Most of the time of reading a large file is the kernel handing out its
// pages one by one: ask for large ones.
char* allocateFile(std::size_t bytes) {
  if (bytes < 2 * kHugePage) return static_cast<char*>(std::malloc(bytes));
  void* memory = nullptr;
  if (::posix_memalign(&memory, kHugePage, bytes) != 0) return nullptr;
#ifdef MADV_HUGEPAGE
  (void)::madvise(memory, bytes, MADV_HUGEPAGE);  // advice: without it everything works, slower
#endif
  return static_cast<char*>(memory);
}

}  // namespace

FileBytes::FileBytes(const fs::path& path) {
  const auto fail = [&](const std::string& what) -> void { throw IoError(path, what); };
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), &std::fclose);
  if (!file) fail(fmt::format("cannot be read: {}", std::strerror(errno)));
  struct stat info {};
  if (::fstat(::fileno(file.get()), &info) != 0) fail(fmt::format("cannot be read: {}", std::strerror(errno)));
  if (S_ISDIR(info.st_mode)) fail("is a folder, expected a mesh file");
  std::setvbuf(file.get(), nullptr, _IONBF, 0);
  // One byte more than the file has, so that its end is seen without growing; a pipe has no size and grows.
  std::size_t capacity = static_cast<std::size_t>(std::max<off_t>(info.st_size, 0)) + 1;
  if (!S_ISREG(info.st_mode)) capacity = std::size_t{1} << 16;
  for (;;) {
    char* grown = data_ ? static_cast<char*>(std::realloc(data_.get(), capacity)) : allocateFile(capacity);
    if (!grown) fail(fmt::format("{} bytes do not fit into memory", capacity));
    (void)data_.release();
    data_.reset(grown);
    size_ += std::fread(data_.get() + size_, 1, capacity - size_, file.get());
    if (std::ferror(file.get())) fail(fmt::format("cannot be read: {}", std::strerror(errno)));
    if (size_ < capacity) return;
    capacity *= 2;
  }
}

void Source::failText(const char* at, std::string element, std::string found, std::string expected) const {
  FilePosition position;
  // "\r" alone ends a line in very old files; there "\n" does not occur.
  const char* stop = std::min(at, end());
  auto line = std::count(begin(), stop, '\n');
  if (line == 0 && std::find(begin(), end(), '\n') == end()) line = std::count(begin(), stop, '\r');
  position.line = static_cast<std::uint64_t>(line) + 1;
  throw IoError(path, position, std::move(element), std::move(found), std::move(expected));
}

void Source::failBinary(const char* at, std::string element, std::string found, std::string expected) const {
  FilePosition position;
  position.byte = static_cast<std::uint64_t>(at - begin());
  throw IoError(path, position, std::move(element), std::move(found), std::move(expected));
}

std::string excerpt(const char* at, const char* end) {
  while (at < end && (*at == ' ' || *at == '\t')) ++at;
  if (at >= end) return "end of file";
  if (*at == '\n' || *at == '\r') return "end of line";
  std::string text = "'";
  for (; at<end&& static_cast<unsigned char>(*at)> ' '; ++at) {
    if (text.size() > 24) return text + "...'";
    text += *at < 0x7F && *at > 0 ? *at : '?';
  }
  return text + "'";
}

fs::path folderOf(const fs::path& path) { return path.has_parent_path() ? path.parent_path() : fs::path("."); }

std::string relocated(const std::string& name, const fs::path& from, const fs::path& to) {
  std::error_code error;
  if (name.empty() || from.empty() || to.empty() || fs::path(name).is_absolute()) return name;
  const fs::path realFrom = fs::weakly_canonical(from, error);
  if (error) return name;
  const fs::path realTo = fs::weakly_canonical(to, error);
  if (error || realFrom == realTo || !fs::exists(realFrom / name, error)) return name;
  const fs::path moved = (realFrom / name).lexically_normal().lexically_relative(realTo);
  return moved.empty() ? (realFrom / name).generic_string() : moved.generic_string();
}

}  // namespace fielddeform::mesh::formats
