#pragma once

#include <fielddeform/core/json_reader.h>

#include <optional>
#include <stdexcept>
#include <string_view>

namespace fielddeform::detail {

/// The member if it is there and not null: null says "the default" throughout.
inline std::optional<JsonValue> given(const JsonValue& object, std::string_view key) {
  const auto value = object.find(key);
  return value && !value->isNull() ? value : std::nullopt;
}

/// Calls make(), and refuses the value for what it does not like (std::invalid_argument).
/// @param expected  what the value should have been
template <class Make>
auto checked(const JsonValue& value, const char* expected, Make&& make) {
  try {
    return make();
  } catch (const std::invalid_argument& problem) {
    value.fail(problem.what(), expected);
  }
}

}  // namespace fielddeform::detail
