#pragma once

#include <string_view>

namespace fielddeform::detail {

inline constexpr std::string_view kBlank = " \t\r\v\f";  ///< what separates words within a line

/// Takes blanks and then a word off the front of a line; empty at its end.
inline std::string_view takeWord(std::string_view& line) {
  const std::size_t begin = line.find_first_not_of(kBlank);
  if (begin == std::string_view::npos) return line = {};
  line.remove_prefix(begin);
  const std::string_view word = line.substr(0, line.find_first_of(kBlank));
  line.remove_prefix(word.size());
  return word;
}

}  // namespace fielddeform::detail
