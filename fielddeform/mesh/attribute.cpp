#include <fielddeform/mesh/attribute.h>

#include <cmath>
#include <limits>
#include <type_traits>

namespace fielddeform::mesh {

std::size_t Attribute::valueCount() const {
  return std::visit([&](const auto& v) { return v.size() / static_cast<std::size_t>(width); }, data);
}

double Attribute::get(std::size_t value, int channel) const {
  const std::size_t i = value * static_cast<std::size_t>(width) + static_cast<std::size_t>(channel);
  return std::visit([&](const auto& v) { return static_cast<double>(v[i]); }, data);
}

void Attribute::set(std::size_t value, int channel, double number) {
  const std::size_t i = value * static_cast<std::size_t>(width) + static_cast<std::size_t>(channel);
  std::visit(
      [&](auto& v) {
        using T = typename std::decay_t<decltype(v)>::value_type;
        if constexpr (std::is_integral_v<T>) {
          constexpr double low = std::numeric_limits<T>::min(), high = std::numeric_limits<T>::max();
          v[i] = std::isnan(number) ? T{0} : static_cast<T>(std::min(high, std::max(low, std::nearbyint(number))));
        } else {
          v[i] = static_cast<T>(number);
        }
      },
      data);
}

int byteSize(ScalarType type) noexcept {
  constexpr int sizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return sizes[static_cast<int>(type)];
}

AttributeData makeData(ScalarType type, std::size_t count) {
  switch (type) {
    case ScalarType::Int8: return std::vector<std::int8_t>(count);
    case ScalarType::UInt8: return std::vector<std::uint8_t>(count);
    case ScalarType::Int16: return std::vector<std::int16_t>(count);
    case ScalarType::UInt16: return std::vector<std::uint16_t>(count);
    case ScalarType::Int32: return std::vector<std::int32_t>(count);
    case ScalarType::UInt32: return std::vector<std::uint32_t>(count);
    case ScalarType::Float32: return std::vector<float>(count);
    case ScalarType::Float64: break;
  }
  return std::vector<double>(count);
}

}  // namespace fielddeform::mesh
