// Large arrays on large pages. A mesh of a million vertices is a few hundred megabytes of arrays; with pages of 4 kB a third
// of a run's time is the kernel handing them out and the processor looking them up. The library leaves memory to its user;
// the program replaces operator new, so that arrays of several megabytes ask for pages of 2 MB. Where the system has none to
// give, everything works as before.
#include <sys/mman.h>

#include <cstdlib>
#include <new>

namespace {

constexpr std::size_t kLargePage = std::size_t{2} << 20;

void* allocate(std::size_t bytes) noexcept {
  if (bytes < 2 * kLargePage) return std::malloc(bytes > 0 ? bytes : 1);
  void* memory = nullptr;
  if (::posix_memalign(&memory, kLargePage, bytes) != 0) return nullptr;
#ifdef MADV_HUGEPAGE
  (void)::madvise(memory, bytes, MADV_HUGEPAGE);
#endif
  return memory;
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

void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
