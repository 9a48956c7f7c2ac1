#include "values.h"

#include <fielddeform/core/angle.h>
#include <fielddeform/core/atomic_file.h>
#include <fielddeform/core/error.h>
#include <fmt/format.h>

#include <CLI/Validators.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>

namespace fielddeform::cli {
namespace {

[[noreturn]] void refuse(const std::string& option, const std::string& text, std::string_view expected) {
  throw CLI::ConversionError(fmt::format("{}: \"{}\", expected {}", option, text, expected));
}

// A finite number and nothing else; a sign is welcome.
std::optional<double> numberIn(const std::string& text) {
  double value = 0;
  const char* end = text.data() + text.size();
  const char* begin = text.data() + (text.size() > 1 && text[0] == '+' ? 1 : 0);
  const auto [stop, error] = std::from_chars(begin, end, value);
  if (error != std::errc() || stop != end || !std::isfinite(value)) return {};
  return value;
}

double parseNumber(const std::string& option, const std::string& text) {
  const auto value = numberIn(text);
  if (!value) refuse(option, text, "a finite number");
  return *value;
}

}  // namespace

std::vector<double> parseNumbers(const std::string& option, const std::string& text, std::size_t count) {
  std::vector<double> numbers;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    numbers.push_back(parseNumber(option, text.substr(begin, end - begin)));
    begin = end + 1;
  }
  if (numbers.size() != count) refuse(option, text, fmt::format("{} numbers between commas", count));
  return numbers;
}

CLI::Option* addVec3(CLI::App& command, const std::string& name, std::optional<Vec3>& value, const std::string& help) {
  return command
      .add_option_function<std::string>(
          name,
          [name, &value](const std::string& text) {
            const auto n = parseNumbers(name, text, 3);
            value = Vec3(n[0], n[1], n[2]);
          },
          help)
      ->type_name("X,Y,Z");
}

CLI::Option* addAxis(CLI::App& command, const std::string& name, std::optional<Vec3>& axis, const std::string& help) {
  return command
      .add_option_function<std::string>(
          name,
          [name, &axis](const std::string& text) {
            axis.reset();
            if (text == "auto") return;
            if (text == "x" || text == "y" || text == "z") {
              axis = Vec3::Unit(text[0] - 'x');
              return;
            }
            const auto n = parseNumbers(name, text, 3);
            axis = Vec3(n[0], n[1], n[2]);
            if (axis->isZero(0)) throw CLI::ConversionError(name + ": a zero vector, expected a direction");
          },
          help)
      ->type_name("auto|x|y|z|X,Y,Z");
}

CLI::Option* addNumber(CLI::App& command, const std::string& name, std::optional<double>& value, const std::string& help) {
  return command
      .add_option_function<std::string>(
          name, [name, &value](const std::string& text) { value = parseNumber(name, text); }, help)
      ->type_name("NUMBER");
}

CLI::Option* addNumber(CLI::App& command, const std::string& name, double& value, const std::string& help) {
  return command
      .add_option_function<std::string>(
          name, [name, &value](const std::string& text) { value = parseNumber(name, text); }, help)
      ->type_name("NUMBER");
}

CLI::Option* addDegrees(CLI::App& command, const std::string& name, std::optional<double>& radians,
                        const std::string& help) {
  return command
      .add_option_function<std::string>(
          name,
          [name, &radians](const std::string& text) { radians = radiansFromDegrees(parseNumber(name, text)); }, help)
      ->type_name("DEG");
}

CLI::Option* addWord(CLI::App& command, const std::string& name, std::vector<std::string> words,
                     std::function<void(std::size_t)> set, const std::string& help) {
  return command
      .add_option_function<std::string>(
          name,
          [words, set = std::move(set)](const std::string& text) {
            set(static_cast<std::size_t>(std::find(words.begin(), words.end(), text) - words.begin()));
          },
          help)
      ->type_name(fmt::format("{}", fmt::join(words, "|")))
      ->check(oneOf(words));
}

CLI::Validator oneOf(const std::vector<std::string>& words) {
  return CLI::Validator(
      [words](const std::string& text) {
        if (std::find(words.begin(), words.end(), text) != words.end()) return std::string();
        return fmt::format("\"{}\", expected one of {}", text, fmt::join(words, ", "));
      },
      "");
}

CLI::Validator within(double low, double high) {
  return CLI::Validator(
      [low, high](const std::string& text) {
        const auto value = numberIn(text);
        return value && *value >= low && *value <= high ? std::string() : fmt::format("{}, expected a number in {}..{}", text, low, high);
      },
      "");
}

CLI::Validator positive() {
  return CLI::Validator(
      [](const std::string& text) {
        const auto value = numberIn(text);
        return value && *value > 0 ? std::string() : fmt::format("{}, expected a finite number > 0", text);
      },
      "");
}

CLI::Validator direction() {
  return CLI::Validator(
      [](const std::string& text) {
        // What is no vector at all the option itself refuses.
        const bool zero = text.find_first_of("123456789") == std::string::npos && text.find('0') != std::string::npos;
        return zero ? fmt::format("\"{}\", expected a direction other than zero", text) : std::string();
      },
      "");
}

CLI::Validator endingIn(std::vector<std::string> extensions) {
  return CLI::Validator(
      [extensions = std::move(extensions)](const std::string& text) { return extensionProblem(text, extensions); }, "");
}

std::string extensionProblem(const std::filesystem::path& path, const std::vector<std::string>& extensions) {
  std::error_code ignored;
  const auto status = std::filesystem::status(path, ignored);
  if (std::filesystem::exists(status) && std::filesystem::is_other(status)) return {};
  std::string own = path.extension().string();
  for (char& c : own) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  if (std::find(extensions.begin(), extensions.end(), own) != extensions.end()) return {};
  return fmt::format("\"{}\", expected a name that ends in {}", path.string(), fmt::join(extensions, ", "));
}

std::vector<std::pair<Vec3, Vec3>> readPairs(const std::filesystem::path& path) {
  std::vector<std::pair<Vec3, Vec3>> pairs;
  std::istringstream lines(readTextFile(path));
  std::uint64_t number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    std::istringstream words(line);
    std::vector<double> values;
    for (std::string word; words >> word && word[0] != '#';) {
      double value = 0;
      const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), value);
      if (error != std::errc() || stop != word.data() + word.size() || !std::isfinite(value))
        throw IoError(path, {.line = number, .column = {}, .byte = {}}, "", "\"" + word + "\"", "a finite number");
      values.push_back(value);
    }
    if (values.empty()) continue;
    if (values.size() != 6)
      throw IoError(path, {.line = number, .column = {}, .byte = {}}, "", fmt::format("{} numbers", values.size()),
                    "six: X Y Z of a point and of where it goes");
    pairs.emplace_back(Vec3(values[0], values[1], values[2]), Vec3(values[3], values[4], values[5]));
  }
  if (pairs.empty()) throw IoError(path, "no pairs of points, expected at least one line of six numbers");
  return pairs;
}

std::filesystem::path withSuffix(const std::filesystem::path& path, std::string_view suffix, std::string_view extension) {
  return path.parent_path() / fmt::format("{}{}{}", path.stem().string(), suffix, extension);
}

}  // namespace fielddeform::cli
