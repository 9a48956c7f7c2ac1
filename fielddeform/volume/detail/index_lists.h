#pragma once

#include <fielddeform/core/parallel.h>
#include <fielddeform/core/types.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

namespace fielddeform::volume::detail {

/// Lists of numbers, one a key: the corners at each vertex, its neighbours.
struct IndexLists {
  std::vector<Index> start;  ///< #keys + 1
  std::vector<Index> item;

  std::span<const Index> operator[](std::size_t key) const noexcept { return {item.data() + start[key], start[key + 1] - start[key]}; }
};

/// Every list in the order in which its items are put, on any number of threads.
/// @param each  each(begin, end, put) calls put(key, item) for entries [begin, end) of `count`; the same calls every time
/// @throw std::invalid_argument for 2^32 items or more
template <class Each>
IndexLists makeIndexLists(std::size_t keys, std::size_t count, Each&& each) {
  constexpr std::size_t kMostChunks = 4, kGrain = 1 << 16;  // a chunk takes 4 bytes a key
  const auto threads = static_cast<std::size_t>(std::max(threadCount(), 1));
  const std::size_t chunks = std::clamp<std::size_t>(count / kGrain, 1, std::min(threads, kMostChunks));
  std::vector<std::vector<Index>> place(chunks, std::vector<Index>(keys, 0));
  const auto eachChunk = [&](auto&& put) {
    parallelFor(chunks, 1, [&](std::size_t c, std::size_t) {
      each(count * c / chunks, count * (c + 1) / chunks, [&](Index key, Index item) { put(place[c][key], item); });
    });
  };
  eachChunk([](Index& n, Index) { ++n; });
  IndexLists out;
  out.start.resize(keys + 1);
  std::size_t at = 0;
  for (std::size_t key = 0; key < keys; ++key) {
    out.start[key] = static_cast<Index>(at);
    for (auto& of : place) {
      const Index n = of[key];
      of[key] = static_cast<Index>(at);
      at += n;
    }
  }
  if (at >= kNoIndex) throw std::invalid_argument("a surface of 2^32 corners or more");
  out.start[keys] = static_cast<Index>(at);
  out.item.resize(at);
  eachChunk([&](Index& n, Index item) { out.item[n++] = item; });
  return out;
}

}  // namespace fielddeform::volume::detail
