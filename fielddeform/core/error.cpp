#include <fielddeform/core/error.h>
#include <fielddeform/core/status.h>
#include <fmt/format.h>

#include <cmath>

namespace fielddeform {
namespace {

std::string describe(const std::filesystem::path& path, const FilePosition& position, const std::string& element,
                     const std::string& found, const std::string& expected) {
  std::string text = path.string();
  if (position.line) text += fmt::format(":{}", *position.line);
  if (position.line && position.column) text += fmt::format(":{}", *position.column);
  if (position.byte) text += fmt::format(": byte {}", *position.byte);
  text += ": ";
  if (!element.empty()) text += element + ": ";
  text += found;
  if (!expected.empty()) text += ", expected " + expected;
  return text;
}

}  // namespace

IoError::IoError(std::filesystem::path path, FilePosition position, std::string element, std::string found,
                 std::string expected)
    : std::runtime_error(describe(path, position, element, found, expected)),
      path_(std::move(path)),
      position_(position) {}

IoError::IoError(std::filesystem::path path, std::string message)
    : std::runtime_error(path.string() + ": " + message), path_(std::move(path)) {}

void requireFinite(const char* argument, double value) {
  if (!std::isfinite(value)) throw std::invalid_argument(fmt::format("{} is {}, expected a finite number", argument, value));
}

void requirePositive(const char* argument, double value) {
  if (!(value > 0) || !std::isfinite(value))
    throw std::invalid_argument(fmt::format("{} is {}, expected a finite number > 0", argument, value));
}

void requireInRange(const char* argument, double value, double low, double high) {
  if (!(value >= low && value <= high))
    throw std::invalid_argument(fmt::format("{} is {}, expected a number from {} to {}", argument, value, low, high));
}

std::string_view toString(Status status) noexcept {
  switch (status) {
    case Status::Fixed: return "fixed";
    case Status::Converged: return "converged";
    case Status::Limited: return "limited";
    case Status::Stalled: return "stalled";
    case Status::Invalid: return "invalid";
  }
  return "invalid";
}

StatusCounts countStatuses(std::span<const Status> statuses) noexcept {
  StatusCounts counts{};
  for (const Status s : statuses) ++counts[static_cast<std::size_t>(s)];
  return counts;
}

}  // namespace fielddeform
