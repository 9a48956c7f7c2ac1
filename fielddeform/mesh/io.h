#pragma once

#include <fielddeform/core/progress.h>
#include <fielddeform/mesh/mesh.h>

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

/// Reading and writing of mesh files, loss-free: what is not understood is passed through (docs/formats.md).
namespace fielddeform::mesh {

enum class Format : std::uint8_t { Ply, Obj, Stl, Off };
/// "ply", "obj", "stl", "off".
std::string_view toString(Format format) noexcept;
/// By the extension, any case; none if it is not one of ours.
std::optional<Format> formatFromExtension(const std::filesystem::path& path);
/// By the first bytes; none if they do not tell (OBJ has no signature).
std::optional<Format> formatFromContent(std::span<const char> bytes);
/// The format whose layout the mesh carries, if it was read from a file.
std::optional<Format> formatOf(const Mesh& mesh) noexcept;

/// What to do with a vertex whose coordinates are not finite.
enum class InvalidPoints : std::uint8_t {
  Reject,  ///< IoError naming the vertex
  Keep,    ///< keep its bits as they are, count it
};
/// What to do with STL, which repeats a vertex for every facet.
enum class Weld : std::uint8_t {
  None,   ///< three vertices a facet, as in the file
  Exact,  ///< corners with equal coordinates become one vertex; writing gives the same facets back
};

struct ReadOptions {
  InvalidPoints invalid = InvalidPoints::Reject;
  Weld weld = Weld::None;  ///< STL only
};

struct ReadReport {
  Format format = Format::Ply;
  std::string encoding;             ///< "ascii", "binary little endian", "binary big endian"
  std::size_t invalidPoints = 0;    ///< vertices with a NaN or infinite coordinate (only with InvalidPoints::Keep)
  std::size_t shortFaces = 0;       ///< faces of one or two corners, kept
  std::size_t repeatedCorners = 0;  ///< faces of >= 3 corners that name a vertex twice, kept
  std::size_t trailingBytes = 0;    ///< bytes after the last element of a binary file, kept
  std::size_t weldedCorners = 0;    ///< STL corners that share a vertex with an earlier one
};

/// Reads a mesh; the format is recognised by content, then by extension.
/// @param report   if not null: filled
/// @param progress if not null: stage "read"
/// @throw IoError naming line or byte, element, what was found and what was expected, if the file cannot be read, is
///        truncated, malformed, or has a non-finite vertex (InvalidPoints::Reject). Memory stays in proportion to the
///        file's size whatever its header claims.
/// @throw Cancelled
Mesh readMesh(const std::filesystem::path& path, const ReadOptions& options = {}, ReadReport* report = nullptr,
              Progress* progress = nullptr);
/// The same from memory. `name` stands in messages, and its extension and folder are used as a path's are.
Mesh readMesh(std::span<const char> bytes, const std::filesystem::path& name, const ReadOptions& options = {},
              ReadReport* report = nullptr, Progress* progress = nullptr);

/// Type of the coordinates in a file.
enum class Precision : std::uint8_t {
  Keep,    ///< as in the input (mesh.positionType())
  Double,  ///< double: nothing is rounded
};

struct WriteOptions {
  Precision precision = Precision::Keep;
  std::optional<Format> format;  ///< none: by the target's extension, else the mesh's own
};

struct WriteReport {
  Format format = Format::Ply;
  /// What the mesh holds and the format cannot express, one phrase each ("2 attributes: quality, mask"); empty if
  /// nothing was lost.
  std::vector<std::string> dropped;
};

/// Writes a mesh atomically. The format it was read from is restored (header, types, order, comments, groups,
/// unknown elements); another one gets what it can express.
/// @throw IoError if it cannot be written; the old file, if any, is untouched
/// @throw std::invalid_argument if no format can be told, or an attribute does not fit its element's count
WriteReport writeMesh(const Mesh& mesh, const std::filesystem::path& path, const WriteOptions& options = {},
                      Progress* progress = nullptr);
/// The bytes that writeMesh() would write to a file in `folder` (which matters to relative paths inside the file).
std::string meshBytes(const Mesh& mesh, Format format, const WriteOptions& options = {}, WriteReport* report = nullptr,
                      const std::filesystem::path& folder = {});

}  // namespace fielddeform::mesh
