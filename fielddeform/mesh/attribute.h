#pragma once

#include <fielddeform/core/types.h>

#include <string>
#include <variant>
#include <vector>

namespace fielddeform::mesh {

enum class Element : std::uint8_t { Vertex, Corner, Face };
enum class ScalarType : std::uint8_t { Int8, UInt8, Int16, UInt16, Int32, UInt32, Float32, Float64 };

/// What becomes of an attribute's value where an edge or a face is split.
enum class Interpolation : std::uint8_t {
  Linear,     ///< weighted mean; integer types round to nearest
  Direction,  ///< weighted mean brought back to the ends' mean length; turns with the surface
  Nearest,    ///< the value of the end with the larger weight, ties to the first (ids, labels)
};

/// Values in the file's own type, flattened: value v's channel c is at v * width + c.
using AttributeData =
    std::variant<std::vector<std::int8_t>, std::vector<std::uint8_t>, std::vector<std::int16_t>,
                 std::vector<std::uint16_t>, std::vector<std::int32_t>, std::vector<std::uint32_t>,
                 std::vector<float>, std::vector<double>>;

/// A named, typed array on vertices, corners or faces. Well-known names, whatever the file calls them:
/// "normal" (width 3, Direction), "color" (3 or 4; integers 0..255, floats 0..1), "uv" (2 or 3).
struct Attribute {
  std::string name;
  Element on = Element::Vertex;
  int width = 1;                                   ///< channels a value, >= 1
  Interpolation onSplit = Interpolation::Linear;
  AttributeData data;
  /// If not empty: one entry a corner, the value that the corner uses (kNoIndex: none). Two corners of one vertex with
  /// different entries are a seam. Empty: value i belongs to element i.
  std::vector<Index> indices;
  /// If not empty: element i owns the values listOffsets[i] .. listOffsets[i+1]-1 (a list property). #elements + 1.
  std::vector<Index> listOffsets;

  ScalarType type() const noexcept { return static_cast<ScalarType>(data.index()); }
  std::size_t valueCount() const;                  ///< data size / width
  double get(std::size_t value, int channel = 0) const;
  /// Stores a number; integer types are rounded to nearest and clamped to their range.
  void set(std::size_t value, int channel, double number);
};

/// Bytes of one scalar.
int byteSize(ScalarType type) noexcept;
/// An attribute array of `count` zeros of a type.
AttributeData makeData(ScalarType type, std::size_t count);

}  // namespace fielddeform::mesh
