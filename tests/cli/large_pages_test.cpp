// The program's operator new (tools/cli/large_pages.cpp, linked into this test): arrays of every size, from many threads.
#include <fielddeform/core/random.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

namespace fielddeform {
namespace {

using Bytes = std::unique_ptr<char[]>;

struct Array {
  Bytes bytes;
  std::size_t size = 0;
  char mark = 0;

  Array(std::size_t n, char m) : bytes(new char[n]), size(n), mark(m) { std::memset(bytes.get(), mark, size); }
  /// Whether nobody else wrote into it.
  bool intact() const {
    for (std::size_t i = 0; i < size; ++i)
      if (bytes[i] != mark) return false;
    return true;
  }
};

/// Small ones, pieces of shared pages, and ones with pages of their own; the last size of each kind and the first of the next.
std::size_t sizeOf(std::uint64_t seed, std::uint64_t k) {
  constexpr std::size_t kEdges[] = {1, 65535, 65536, 65537, 4194303, 4194304, 4194305};
  if (k % 11 == 0) return kEdges[splitmix64(seed, k) % std::size(kEdges)];
  const std::uint64_t most = k % 5 == 0 ? 6'000'000 : k % 5 == 1 ? 70'000 : 500'000;
  return 1 + splitmix64(seed, k) % most;
}

double residentMegabytes() {
  std::ifstream file("/proc/self/status");
  for (std::string word; file >> word;)
    if (word == "VmRSS:") {
      double kilobytes = 0;
      file >> kilobytes;
      return kilobytes / 1000;
    }
  return 0;
}

TEST(LargePages, ArraysOfEverySizeDoNotMeet) {
  std::vector<int> broken(4, 0);
  std::vector<std::thread> threads;
  for (std::size_t t = 0; t < broken.size(); ++t)
    threads.emplace_back([t, &broken] {
      std::vector<Array> held;
      for (std::uint64_t k = 0; k < 400; ++k) {
        held.emplace_back(sizeOf(t, k), static_cast<char>(k + 50 * t));
        if (reinterpret_cast<std::uintptr_t>(held.back().bytes.get()) % alignof(std::max_align_t) != 0) ++broken[t];
        if (held.size() < 24) continue;
        const std::size_t gone = splitmix64(99 + t, k) % held.size();
        broken[t] += !held[gone].intact();
        std::swap(held[gone], held.back());
        held.pop_back();
      }
      for (const Array& a : held) broken[t] += !a.intact();
    });
  for (std::thread& t : threads) t.join();
  EXPECT_EQ(broken, std::vector<int>(4, 0));
}

TEST(LargePages, MoreArraysThanItKeepsTrackOfComeFromTheSystem) {
  std::vector<Array> many;
  for (int k = 0; k < 3000; ++k) many.emplace_back(65536, static_cast<char>(k));
  for (const Array& a : many) ASSERT_TRUE(a.intact());
  while (!many.empty()) {  // in another order than they came
    std::swap(many[many.size() / 2], many.back());
    many.pop_back();
  }
  EXPECT_TRUE(Array(65536, 7).intact());
}

TEST(LargePages, WhatIsGivenBackIsUsedAgain) {
  const double before = residentMegabytes();
  ASSERT_GT(before, 0);
  for (int k = 0; k < 300; ++k) {
    const Array piece(3'000'000, 1), large(9'000'000, 2), other(200'000 + static_cast<std::size_t>(k) * 1000, 3);
    ASSERT_TRUE(piece.intact());
  }
  EXPECT_LT(residentMegabytes() - before, 60) << "3.6 GB came and went";
}

TEST(LargePages, TooMuchIsABadAllocation) {
  volatile std::size_t most = std::size_t{1} << 62;  // volatile: the compiler refuses or leaves out what it can see
  char* volatile taken = nullptr;
  EXPECT_THROW(taken = new char[most], std::bad_alloc);
  delete[] taken;
}

}  // namespace
}  // namespace fielddeform
