// Large arrays on large pages, given out again. A mesh of a million vertices is a few hundred megabytes of arrays, most of them
// short-lived; with the system's allocator a third of a run's time is the kernel clearing pages for arrays that take the place of
// others just given back, and the processor looking pages up. The library leaves memory to its user; the program replaces
// operator new: arrays of several megabytes lie on pages of 2 MB, and pages of arrays given back make up the next, wherever they
// lie: the kernel moves them to one range of addresses without clearing them. So the program takes what it needs at once at most,
// and never twice. (TBB's allocator keeps more than that: 384 bytes a vertex instead of 318.) Smaller arrays, those of a mesh of a
// hundred thousand vertices, are cut from a few large pages that stay with the program.
#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <mutex>
#include <new>

namespace {

constexpr std::size_t kLargePage = std::size_t{2} << 20;
constexpr std::size_t kLarge = 2 * kLargePage;             // arrays from here on have pages of their own
constexpr std::size_t kPiece = std::size_t{64} << 10;      // smaller ones are whole numbers of these
constexpr std::size_t kShared = 4 * kLargePage;            // pages that they are cut from, taken at once

constexpr std::size_t roundUp(std::size_t bytes, std::size_t unit) { return (bytes + unit - 1) / unit * unit; }

struct Range {
  char* begin = nullptr;
  std::size_t size = 0;
  char* end() const { return begin + size; }
};

// A fixed number of ranges, by address. No container: it would call operator new.
template <std::size_t Most>
class Ranges {
 public:
  bool full() const { return count_ == range_.size(); }
  Range* begin() { return range_.data(); }
  Range* end() { return range_.data() + count_; }
  Range* at(const char* address) {
    return std::lower_bound(begin(), end(), address, [](const Range& r, const char* a) { return r.begin < a; });
  }
  void insert(Range r) {
    Range* place = at(r.begin);
    std::copy_backward(place, end(), end() + 1);
    *place = r;
    ++count_;
  }
  void erase(Range* r) {
    std::copy(r + 1, end(), r);
    --count_;
  }

  /// The range that begins at this address.
  Range* find(const char* address) {
    Range* r = at(address);
    return r != end() && r->begin == address ? r : nullptr;
  }
  /// Adds a range, as one with those that it touches. @return false if there is no room
  bool join(Range r) {
    Range* next = at(r.begin);
    if (next != begin() && (next - 1)->end() == r.begin) {
      (next - 1)->size += r.size;
      if (next != end() && (next - 1)->end() == next->begin) (next - 1)->size += next->size, erase(next);
    } else if (next != end() && r.end() == next->begin) {
      next->begin = r.begin, next->size += r.size;
    } else if (!full()) {
      insert(r);
    } else {
      return false;
    }
    return true;
  }
  /// Takes memory from the smallest range that serves. @return null if none does
  char* cut(std::size_t size) {
    Range* best = nullptr;
    for (Range& r : *this)
      if (r.size >= size && (!best || r.size < best->size)) best = &r;
    if (!best) return nullptr;
    char* memory = best->begin;
    best->begin += size, best->size -= size;
    if (best->size == 0) erase(best);
    return memory;
  }

 private:
  std::array<Range, Most> range_{};
  std::size_t count_ = 0;
};

class LargeArrays {
 public:
  void* take(std::size_t bytes) {
    const std::size_t size = roundUp(bytes, kLargePage);
    if (size < bytes) return nullptr;
    const std::lock_guard lock(mutex_);
    if (used_.full()) return nullptr;
    char* memory = kept_.cut(size);
    if (!memory) memory = compose(size);
    if (!memory) return nullptr;
    used_.insert({memory, size});
    return memory;
  }

  /// @return false if it was not taken here
  bool giveBack(void* memory) {
    if (reinterpret_cast<std::uintptr_t>(memory) % kLargePage != 0) return false;
    const std::lock_guard lock(mutex_);
    Range* r = used_.find(static_cast<char*>(memory));
    if (!r) return false;
    const Range range = *r;
    used_.erase(r);
    if (!kept_.join(range)) ::munmap(range.begin, range.size);
    return true;
  }

 private:
  // A range of addresses with all pages that are kept, as far as it goes, and new ones.
  char* compose(std::size_t size) {
    char* begin = reserve(size);
    if (!begin) return nullptr;
    std::size_t filled = 0;
    while (filled < size && moveLastKept(begin + filled)) filled += kLargePage;
    if (filled == size) return begin;
    if (::mmap(begin + filled, size - filled, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED, -1, 0) == MAP_FAILED) {
      ::munmap(begin, size);
      return nullptr;
    }
#ifdef MADV_HUGEPAGE
    (void)::madvise(begin + filled, size - filled, MADV_HUGEPAGE);
#endif
    return begin;
  }

  // Page by page: a range may have been composed, and the kernel moves no more than one piece at a time.
  bool moveLastKept(char* to) {
    if (kept_.begin() == kept_.end()) return false;
    Range& last = *(kept_.end() - 1);
    if (::mremap(last.end() - kLargePage, kLargePage, kLargePage, MREMAP_MAYMOVE | MREMAP_FIXED, to) == MAP_FAILED) return false;
    last.size -= kLargePage;
    if (last.size == 0) kept_.erase(&last);
    return true;
  }

  // Addresses without memory.
  static char* reserve(std::size_t size) {
    void* memory = ::mmap(nullptr, size + kLargePage, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (memory == MAP_FAILED) return nullptr;
    char* begin = static_cast<char*>(memory);
    const std::size_t before = (kLargePage - reinterpret_cast<std::uintptr_t>(begin) % kLargePage) % kLargePage;
    if (before > 0) ::munmap(begin, before);
    begin += before;
    if (before < kLargePage) ::munmap(begin + size, kLargePage - before);
    return begin;
  }

  std::mutex mutex_;
  Ranges<1024> used_, kept_;
};

constinit LargeArrays large;

class SmallerArrays {
 public:
  void* take(std::size_t bytes) {
    const std::size_t size = roundUp(bytes, kPiece);
    const std::lock_guard lock(mutex_);
    if (used_.full()) return nullptr;
    char* memory = kept_.cut(size);
    if (!memory) {
      char* pages = static_cast<char*>(large.take(kShared));
      if (!pages) return nullptr;
      if (!kept_.join({pages, kShared})) {
        large.giveBack(pages);
        return nullptr;
      }
      memory = kept_.cut(size);
    }
    used_.insert({memory, size});
    return memory;
  }

  /// @return false if it was not taken here
  bool giveBack(void* memory) {
    if (reinterpret_cast<std::uintptr_t>(memory) % kPiece != 0) return false;
    const std::lock_guard lock(mutex_);
    Range* r = used_.find(static_cast<char*>(memory));
    if (!r) return false;
    const Range range = *r;
    used_.erase(r);
    kept_.join(range);  // there is room: no more ranges are kept than are used between them, and shared pages
    return true;
  }

 private:
  std::mutex mutex_;
  Ranges<2048> used_;
  Ranges<4096> kept_;
};

constinit SmallerArrays smaller;

void* allocate(std::size_t bytes) noexcept {
  void* memory = bytes >= kLarge ? large.take(bytes) : bytes >= kPiece ? smaller.take(bytes) : nullptr;
  return memory ? memory : std::malloc(bytes > 0 ? bytes : 1);
}

void release(void* memory) noexcept {
  if (memory && !smaller.giveBack(memory) && !large.giveBack(memory)) std::free(memory);
}

}  // namespace

void* operator new(std::size_t bytes) {
  for (;;) {
    if (void* memory = allocate(bytes)) return memory;
    const std::new_handler handler = std::get_new_handler();
    if (!handler) throw std::bad_alloc();
    handler();
  }
}

void operator delete(void* memory) noexcept { release(memory); }
void operator delete(void* memory, std::size_t) noexcept { release(memory); }
