#include <fielddeform/core/parallel.h>
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <atomic>
#include <mutex>
#include <numeric>

// ThreadSanitizer does not see how the (uninstrumented) TBB library hands work over and waits for it: it is told.
#ifdef __SANITIZE_THREAD__
extern "C" void __tsan_acquire(void* address);
extern "C" void __tsan_release(void* address);
#endif

namespace fielddeform {
namespace {

#ifdef __SANITIZE_THREAD__
void happensBefore(char& token) { __tsan_release(&token); }
void happensAfter(char& token) { __tsan_acquire(&token); }
#else
void happensBefore(char&) {}
void happensAfter(char&) {}
#endif

}  // namespace

struct ThreadLimit::Control {
  explicit Control(std::size_t threads) : control(tbb::global_control::max_allowed_parallelism, threads) {}
  tbb::global_control control;
};

ThreadLimit::ThreadLimit(int threads) {
  if (threads > 0) control_ = std::make_unique<Control>(static_cast<std::size_t>(threads));
}
ThreadLimit::~ThreadLimit() = default;

int threadCount() noexcept {
  return static_cast<int>(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
}

namespace detail {

void parallelRanges(std::size_t count, std::size_t grain, void* body, RangeFunction call, Progress* progress) {
  if (count == 0) return;
  if (grain == 0) grain = 1;
  const std::size_t ranges = (count + grain - 1) / grain;
  std::atomic<std::size_t> done{0};
  std::mutex reporting;
  const auto one = [&](std::size_t r) {
    if (progress) progress->throwIfCancelled();
    call(body, r * grain, std::min(count, (r + 1) * grain));
    const std::size_t finished = done.fetch_add(1, std::memory_order_relaxed) + 1;
    if (!progress) return;
    // Whoever finds the display busy goes on working: a late figure is better than a waiting thread.
    if (std::unique_lock lock(reporting, std::try_to_lock); lock)
      progress->advance(static_cast<double>(finished) / static_cast<double>(ranges));
  };
  if (ranges == 1 || threadCount() == 1) {
    for (std::size_t r = 0; r < ranges; ++r) one(r);
    return;
  }
  static char begun, ended;  // of all loops: to find one of its own a task would have to read before it is allowed to
  const auto task = [&](std::size_t r) {
    happensAfter(begun);
    one(r);
    happensBefore(ended);
  };
  happensBefore(begun);
  tbb::parallel_for(std::size_t{0}, ranges, task);
  happensAfter(ended);
}

}  // namespace detail

std::vector<std::uint32_t> sortedOrder(const std::vector<std::uint64_t>& keys) {
  std::vector<std::uint32_t> order(keys.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto less = [&](std::uint32_t a, std::uint32_t b) { return keys[a] != keys[b] ? keys[a] < keys[b] : a < b; };
#ifdef __SANITIZE_THREAD__
  std::sort(order.begin(), order.end(), less);  // a total order: the same result
#else
  tbb::parallel_sort(order.begin(), order.end(), less);
#endif
  return order;
}

}  // namespace fielddeform
