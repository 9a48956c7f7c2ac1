#include <fielddeform/mesh/formats/codec.h>
#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <stdexcept>

namespace fielddeform::mesh::formats {

void writeCoordinate(Output& out, double value, ScalarType type) {
  if (type == ScalarType::Float32)
    out.number(static_cast<float>(value));
  else
    out.number(value);
}

ScalarType coordinateType(const Mesh& mesh, const WriteOptions& options) {
  if (options.precision == Precision::Double || mesh.positionType() != ScalarType::Float32) return ScalarType::Float64;
  constexpr double largest = std::numeric_limits<float>::max();
  for (const Vec3& p : mesh.positions())
    for (int k = 0; k < 3; ++k)
      if (std::abs(p[k]) > largest && std::isfinite(p[k])) return ScalarType::Float64;
  return ScalarType::Float32;
}

std::vector<Index> valuePerVertex(const Mesh& mesh, const Attribute& a) {
  constexpr Index kUnseen = kNoIndex - 1;
  std::vector<Index> value(mesh.vertexCount(), kUnseen);
  for (std::size_t c = 0; c < mesh.cornerCount(); ++c) {
    Index& v = value[mesh.corners()[c]];
    const Index mine = cornerValue(a, c);
    if (v == kUnseen || v == mine) {
      v = mine;
      continue;
    }
    if (v == kNoIndex || mine == kNoIndex) return {};
    for (int k = 0; k < a.width; ++k)
      if (!(a.get(v, k) == a.get(mine, k))) return {};
  }
  for (Index& v : value)
    if (v == kUnseen) v = kNoIndex;
  return value;
}

void addCount(std::vector<std::string>& phrases, std::size_t count, std::string_view singular,
              std::string_view plural) {
  if (count != 0) phrases.push_back(fmt::format("{} {}", count, count == 1 ? singular : plural));
}

void reportDropped(WriteReport& report, const std::vector<std::string>& attributes, std::size_t polylines,
                   std::size_t loosePoints) {
  if (!attributes.empty())
    report.dropped.push_back(fmt::format("{} attribute{}: {}", attributes.size(), attributes.size() == 1 ? "" : "s",
                                         fmt::join(attributes, ", ")));
  addCount(report.dropped, polylines, "polyline", "polylines");
  addCount(report.dropped, loosePoints, "loose point", "loose points");
}

void checkAttributes(const Mesh& mesh) {
  for (const Attribute& a : mesh.attributes()) {
    const std::size_t elements = a.on == Element::Vertex   ? mesh.vertexCount()
                                 : a.on == Element::Corner ? mesh.cornerCount()
                                                           : mesh.faceCount();
    const std::size_t values = a.width > 0 ? a.valueCount() : 0;
    const auto fail = [&](const std::string& what) -> void {
      throw std::invalid_argument(fmt::format("attribute {} has {}", a.name, what));
    };
    if (a.width < 1) fail(fmt::format("width {}, expected at least 1", a.width));
    if (!a.listOffsets.empty()) {
      if (a.listOffsets.size() != elements + 1 || a.listOffsets.back() != values)
        fail(fmt::format("list offsets that do not fit {} elements and {} values", elements, values));
    } else if (!a.indices.empty()) {
      if (a.indices.size() != elements) fail(fmt::format("{} indices, expected {}", a.indices.size(), elements));
      for (const Index i : a.indices)
        if (i != kNoIndex && i >= values) fail(fmt::format("index {}, expected less than {}", i, values));
    } else if (values != elements) {
      fail(fmt::format("{} values, expected {}", values, elements));
    }
  }
}

}  // namespace fielddeform::mesh::formats
