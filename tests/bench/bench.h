#pragma once

#include <fielddeform/core/parallel.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

/// What every benchmark prints and how it measures.
namespace fielddeform::bench {

inline std::string processor() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);)
    if (line.rfind("model name", 0) == 0) return line.substr(line.find(':') + 2);
  return "unknown processor";
}

/// Set in CI: run with little work, judge nothing.
inline bool quick() { return std::getenv("FIELDDEFORM_BENCH_QUICK") != nullptr; }

/// The value after an option on the command line, or a default.
inline std::string option(int argc, char** argv, const std::string& name, const std::string& otherwise) {
  for (int i = 1; i + 1 < argc; ++i)
    if (name == argv[i]) return argv[i + 1];
  return otherwise;
}

inline void printMachine(int repeats) {
  std::printf("%s; %d thread%s; median of %d after one warm-up\n", processor().c_str(), threadCount(),
              threadCount() == 1 ? "" : "s", repeats);
}

inline double peakMegabytes() {
  struct rusage usage {};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

inline double cpuSeconds() {
  struct rusage usage {};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) { return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec); };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

struct Times {
  double wall = 0, cpu = 0;  ///< seconds, medians
};

inline Times measure(int repeats, const std::function<void()>& call) {
  std::vector<double> wall, cpu;
  for (int r = 0; r <= repeats; ++r) {
    const auto start = std::chrono::steady_clock::now();
    const double before = cpuSeconds();
    call();
    if (r == 0) continue;
    cpu.push_back(cpuSeconds() - before);
    wall.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  std::sort(wall.begin(), wall.end());
  std::sort(cpu.begin(), cpu.end());
  return {wall[wall.size() / 2], cpu[cpu.size() / 2]};
}

}  // namespace fielddeform::bench
