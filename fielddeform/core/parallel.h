#pragma once

#include <fielddeform/core/progress.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <type_traits>
#include <vector>

/// Parallel loops, the only place that knows TBB. Results never depend on the number of threads: loops write to
/// their own elements, and reductions add fixed chunks in a fixed order.
namespace fielddeform {

/// While it lives, parallel loops use at most this many threads. 0 means as many as the machine has.
class ThreadLimit {
 public:
  explicit ThreadLimit(int threads);
  ~ThreadLimit();
  ThreadLimit(const ThreadLimit&) = delete;
  ThreadLimit& operator=(const ThreadLimit&) = delete;

 private:
  struct Control;
  std::unique_ptr<Control> control_;
};

/// Threads that a parallel loop would use now.
int threadCount() noexcept;

namespace detail {
using RangeFunction = void (*)(void* body, std::size_t begin, std::size_t end);
void parallelRanges(std::size_t count, std::size_t grain, void* body, RangeFunction call, Progress* progress);
}  // namespace detail

/// Calls body(begin, end) on disjoint ranges that cover [0, count). Each range starts at a multiple of grain and has at
/// most grain elements, whatever the thread count. Runs serially when one range is enough.
/// Exceptions of the body are rethrown here (one of them, if several).
template <class Body>
void parallelFor(std::size_t count, std::size_t grain, Body&& body) {
  detail::parallelRanges(
      count, grain, &body,
      [](void* b, std::size_t begin, std::size_t end) { (*static_cast<std::remove_reference_t<Body>*>(b))(begin, end); },
      nullptr);
}

/// As above; advances the progress's current stage from 0 to 1.
/// @throw Cancelled between ranges once the progress is cancelled.
template <class Body>
void parallelFor(std::size_t count, std::size_t grain, Progress& progress, Body&& body) {
  detail::parallelRanges(
      count, grain, &body,
      [](void* b, std::size_t begin, std::size_t end) { (*static_cast<std::remove_reference_t<Body>*>(b))(begin, end); },
      &progress);
}

/// Combines chunk(begin, end) over [0, count) in chunks of grain, left to right: the same bits on any thread count.
template <class Value, class Chunk, class Combine>
Value deterministicReduce(std::size_t count, std::size_t grain, Value initial, Chunk&& chunk, Combine&& combine) {
  if (count == 0) return initial;
  const std::size_t chunks = (count + grain - 1) / grain;
  std::vector<Value> partial(chunks, initial);
  parallelFor(count, grain, [&](std::size_t begin, std::size_t end) { partial[begin / grain] = chunk(begin, end); });
  Value total = initial;
  for (const Value& p : partial) total = combine(total, p);
  return total;
}

/// Stable sort of keys' order: the permutation that sorts `keys` ascending, ties by index.
std::vector<std::uint32_t> sortedOrder(const std::vector<std::uint64_t>& keys);

}  // namespace fielddeform
