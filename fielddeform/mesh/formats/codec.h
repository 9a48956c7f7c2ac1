#pragma once

#include <fielddeform/mesh/formats/output.h>
#include <fielddeform/mesh/formats/source.h>
#include <fielddeform/mesh/io.h>

namespace fielddeform::mesh::formats {

/// What every reader gets and every writer gets; one pair of functions a format.
struct ReadContext {
  const Source& source;
  const ReadOptions& options;
  ReadReport& report;
};
struct WriteContext {
  const Mesh& mesh;
  Output& out;
  const WriteOptions& options;
  WriteReport& report;
  std::filesystem::path folder;  ///< of the target; empty if unknown
};

Mesh readPly(const ReadContext& context);
void writePly(const WriteContext& context);
Mesh readObj(const ReadContext& context);
void writeObj(const WriteContext& context);
Mesh readStl(const ReadContext& context);
void writeStl(const WriteContext& context);
Mesh readOff(const ReadContext& context);
void writeOff(const WriteContext& context);

/// A layout knows its format.
class FormatLayout : public FileLayout {
 public:
  virtual Format format() const noexcept = 0;
  /// What another format cannot take over from here, one phrase each.
  virtual std::vector<std::string> extras() const { return {}; }
};

/// Largest vertex and corner counts that an Index can name.
inline constexpr std::uint64_t kMaxCount = 0x7FFFFFFF;

/// Counts a vertex that is not finite, or refuses it.
/// @param fail called as fail(element, found, expected) and must throw
template <class Fail>
void checkFinite(const ReadContext& context, const Vec3& p, std::size_t vertex, Fail&& fail) {
  if (p.allFinite()) [[likely]]
    return;
  if (context.options.invalid == InvalidPoints::Reject)
    fail("vertex " + std::to_string(vertex), "a coordinate that is not finite", "finite coordinates");
  ++context.report.invalidPoints;
}

/// How coordinates go into text: the shortest decimal of the float or of the double.
void writeCoordinate(Output& out, double value, ScalarType type);
/// The type that the mesh's coordinates need in a file of floats or doubles: Float64 if asked for or if a finite
/// coordinate is beyond the largest float.
ScalarType coordinateType(const Mesh& mesh, const WriteOptions& options);

/// For corner attributes: the value that a corner uses (kNoIndex: none).
inline Index cornerValue(const Attribute& a, std::size_t corner) {
  return a.indices.empty() ? static_cast<Index>(corner) : a.indices[corner];
}
/// If every vertex has one value at all its corners: the value's index a vertex (kNoIndex at vertices without one).
/// Otherwise empty.
std::vector<Index> valuePerVertex(const Mesh& mesh, const Attribute& a);

/// The mesh's layout if it is of this kind, else null; then `report` says what the other layout held.
template <class Layout>
std::shared_ptr<const Layout> layoutFor(const Mesh& mesh, WriteReport& report) {
  auto mine = std::dynamic_pointer_cast<const Layout>(mesh.layout());
  const auto* other = mine ? nullptr : dynamic_cast<const FormatLayout*>(mesh.layout().get());
  if (other)
    for (std::string& phrase : other->extras()) report.dropped.push_back(std::move(phrase));
  return mine;
}
/// Notes attributes, polylines and loose points that a format cannot express.
void reportDropped(WriteReport& report, const std::vector<std::string>& attributes, std::size_t polylines,
                   std::size_t loosePoints);
/// "1 comment", "2 comments"; nothing is added for 0.
void addCount(std::vector<std::string>& phrases, std::size_t count, std::string_view singular, std::string_view plural);

/// @throw std::invalid_argument if an attribute's arrays do not fit the mesh.
void checkAttributes(const Mesh& mesh);

}  // namespace fielddeform::mesh::formats
