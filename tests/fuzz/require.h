#pragma once

#include <cstdio>
#include <cstdlib>
#include <string>

namespace fielddeform {

/// What a fuzzer promises of any bytes: says which promise is broken, with the texts that show it, and aborts.
inline void require(bool holds, const char* promise, const std::string& shown = {}) {
  if (holds) return;
  std::fprintf(stderr, "violated: %s\n%s", promise, shown.c_str());
  std::abort();
}

}  // namespace fielddeform
