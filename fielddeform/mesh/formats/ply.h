#pragma once

#include <fielddeform/mesh/formats/codec.h>

#include <bit>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <vector>

/// PLY, shared by its reader and its writer. [Turk 1994, "The PLY Polygon File Format"]
namespace fielddeform::mesh::formats {

enum class PlyEncoding : std::uint8_t { Ascii, Little, Big };

/// One "property" line and what its values became in the mesh.
struct PlyProperty {
  enum class Role : std::uint8_t { Attribute, Position, Indices };
  std::string name;
  ScalarType type = ScalarType::Float32;
  std::optional<ScalarType> countType;  ///< of a list
  Role role = Role::Attribute;
  std::string attribute;  ///< name of the mesh's attribute
  Element on = Element::Vertex;
  int channel = 0;
  Interpolation onSplit = Interpolation::Linear;
};

/// One "element" with its properties.
struct PlyElement {
  enum class Role : std::uint8_t { Other, Vertex, Face, Strips };
  std::string name;
  std::uint64_t count = 0;
  Role role = Role::Other;
  std::vector<PlyProperty> properties;
  std::shared_ptr<const std::vector<char>> raw;  ///< rows of Other and Strips, as in the file
  std::size_t firstFace = 0, faces = 0;          ///< the mesh's faces that came from here
};

/// A header line as it stood, and what it declares.
struct PlyHeaderLine {
  enum class Kind : std::uint8_t { Text, Element, Property };
  std::string text;
  Kind kind = Kind::Text;
  std::size_t element = 0, property = 0;
};

class PlyLayout final : public FormatLayout {
 public:
  PlyEncoding encoding = PlyEncoding::Little;
  std::string eol = "\n";
  std::vector<PlyHeaderLine> header;  ///< between "ply" and "end_header"
  std::vector<PlyElement> elements;
  std::string trailing;  ///< after the last element of a binary file
  ScalarType positionType = ScalarType::Float32;
  std::uint64_t topology = 0;    ///< hash of the corners, if there are strips
  std::filesystem::path folder;  ///< of the file

  Format format() const noexcept override { return Format::Ply; }
  // The writer takes its counts from the mesh, so a refined mesh needs no other layout.
  std::shared_ptr<const FileLayout> refined(std::span<const Index>, std::size_t) const override {
    return std::make_shared<PlyLayout>(*this);
  }
};

/// Tells whether the strips of a file are still the mesh's faces.
std::uint64_t hashCorners(const Mesh& mesh);

/// Reads the header and decides what each property becomes.
/// @param data set to the first byte behind the header
std::shared_ptr<PlyLayout> readPlyHeader(const Source& source, const char*& data);

/// "float", "uchar", ...
std::string_view plyTypeName(ScalarType type) noexcept;

/// Calls f with a value of the type: f(float{}), ...
template <class F>
decltype(auto) withScalar(ScalarType type, F&& f) {
  switch (type) {
    case ScalarType::Int8:
      return f(std::int8_t{});
    case ScalarType::UInt8:
      return f(std::uint8_t{});
    case ScalarType::Int16:
      return f(std::int16_t{});
    case ScalarType::UInt16:
      return f(std::uint16_t{});
    case ScalarType::Int32:
      return f(std::int32_t{});
    case ScalarType::UInt32:
      return f(std::uint32_t{});
    case ScalarType::Float32:
      return f(float{});
    case ScalarType::Float64:
      break;
  }
  return f(double{});
}

/// float <-> double that keeps a NaN's payload and signalling bit, which a conversion in hardware does not.
inline double widen(float x) noexcept {
  if (x == x) [[likely]]
    return x;
  const auto b = std::bit_cast<std::uint32_t>(x);
  return std::bit_cast<double>((std::uint64_t{b >> 31} << 63) | (std::uint64_t{0x7FF} << 52) |
                               (std::uint64_t{b & 0x7FFFFFu} << 29));
}
inline float narrow(double x) noexcept {
  if (x == x) [[likely]]
    return static_cast<float>(x);
  const auto b = std::bit_cast<std::uint64_t>(x);
  auto mantissa = static_cast<std::uint32_t>((b >> 29) & 0x7FFFFFu);
  if (mantissa == 0) mantissa = 0x400000u;  // the payload does not fit: still a NaN
  return std::bit_cast<float>((static_cast<std::uint32_t>(b >> 63) << 31) | 0x7F800000u | mantissa);
}

/// Loads a scalar from bytes of either order.
template <class T, bool Swap>
T loadScalar(const char* p) noexcept {
  if constexpr (!Swap || sizeof(T) == 1) {
    T value;
    std::memcpy(&value, p, sizeof(T));
    return value;
  } else {
    char swapped[sizeof(T)];
    for (std::size_t i = 0; i < sizeof(T); ++i) swapped[i] = p[sizeof(T) - 1 - i];
    T value;
    std::memcpy(&value, swapped, sizeof(T));
    return value;
  }
}

}  // namespace fielddeform::mesh::formats
