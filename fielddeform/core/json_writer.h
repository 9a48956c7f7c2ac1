#pragma once

#include <fielddeform/core/types.h>

#include <concepts>
#include <string>
#include <string_view>
#include <vector>

namespace fielddeform {

/// How the elements of an array or object are laid out.
enum class JsonLayout : std::uint8_t {
  Lines,  ///< one a line, indented by two spaces
  Inline  ///< all on one line; what is inside is inline, too
};

/// Writes JSON text in order: the same calls give the same bytes. Numbers are the shortest that read back the same.
///
///   JsonWriter json;
///   json.beginObject().key("radius").value(0.5).key("points").beginArray(JsonLayout::Inline).value(1).value(2).end().end();
///   writeTextFile(path, json.text());
class JsonWriter {
 public:
  JsonWriter& beginObject(JsonLayout layout = JsonLayout::Lines);
  JsonWriter& beginArray(JsonLayout layout = JsonLayout::Lines);
  JsonWriter& end();                                ///< closes the innermost object or array
  JsonWriter& key(std::string_view name);
  /// @throw std::invalid_argument if not finite (JSON has no such numbers; write null with a reason)
  JsonWriter& value(double number);
  JsonWriter& value(std::string_view string);       ///< bytes that are no UTF-8 become U+FFFD
  JsonWriter& value(const char* string) { return value(std::string_view(string)); }
  JsonWriter& value(bool boolean);
  template <std::integral T>
    requires(!std::same_as<T, bool>)
  JsonWriter& value(T integer) { return raw(std::to_string(integer)); }
  JsonWriter& value(const Vec3& vector);            ///< [x, y, z] on one line
  JsonWriter& null() { return raw("null"); }
  /// Text that is JSON already. Not checked.
  JsonWriter& raw(std::string_view json);
  /// Shorthand of key(name).value(v).
  template <class T>
  JsonWriter& member(std::string_view name, const T& v) { return key(name).value(v); }

  /// The text, with a newline at its end. Everything must have been closed.
  std::string text() const;

 private:
  struct Level { char close; bool lines; bool empty; };
  void beforeValue();
  void newline();
  JsonWriter& open(char begin, char close, JsonLayout layout);
  std::string text_;
  std::vector<Level> levels_;
  bool afterKey_ = false;
};

/// The shortest decimal text that reads back as the same double ("0.1", "1e-300", "-0.0"). Finite values only.
std::string shortestNumber(double value);

}  // namespace fielddeform
