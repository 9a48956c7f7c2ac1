#pragma once

#include <fielddeform/mesh/formats/codec.h>

#include <string>
#include <vector>

namespace fielddeform::mesh::formats {

/// Consecutive statements of one kind. The sequence of runs is the file without its numbers.
struct ObjRun {
  enum class Kind : std::uint8_t { Vertex, Texture, Normal, Face, Line, Points, Raw, Mtllib };
  Kind kind = Kind::Raw;
  /// Vertex, Texture: numbers a statement. Points: points a statement. Face: 1 if its indices count backwards.
  std::uint32_t width = 0;
  /// Statements; for Raw and Mtllib bytes of `text`.
  std::uint64_t count = 0;
};

class ObjLayout final : public FormatLayout {
 public:
  std::string eol = "\n";
  std::vector<ObjRun> runs;
  std::string text;                ///< of all Raw and Mtllib runs, verbatim with line ends
  std::vector<Index> lineTexture;  ///< empty, or the texture index of each point of the "l" statements
  std::filesystem::path folder;    ///< of the file

  std::uint64_t total(ObjRun::Kind kind) const noexcept;
  Format format() const noexcept override { return Format::Obj; }
  std::vector<std::string> extras() const override;
  std::shared_ptr<const FileLayout> refined(std::span<const Index> faceParent, std::size_t vertexCount) const override;
};

}  // namespace fielddeform::mesh::formats
