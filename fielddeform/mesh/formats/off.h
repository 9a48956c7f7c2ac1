#pragma once

#include <fielddeform/mesh/formats/codec.h>

#include <string>
#include <vector>

namespace fielddeform::mesh::formats {

/// What an OFF file holds beside numbers. Colours behind a face's indices are kept as they stand.
class OffLayout final : public FormatLayout {
 public:
  enum class Before : std::uint8_t { Magic, Counts, Vertex, Face };
  struct Comment {
    Before before = Before::Magic;
    std::size_t row = 0;
    std::string text;
  };
  struct Tail {
    std::uint64_t faces = 0;  ///< consecutive faces with this text
    std::string text;         ///< behind their indices
  };
  std::string magic;  ///< "OFF", "COFF", ...; empty if the file had none
  bool countsOnMagicLine = false;
  std::uint64_t edges = 0;  ///< as stated, rarely true
  std::string eol = "\n";
  std::vector<Comment> comments;
  std::vector<Tail> tails;
  std::size_t faces = 0, vertices = 0;

  Format format() const noexcept override { return Format::Off; }
  std::vector<std::string> extras() const override;
  std::shared_ptr<const FileLayout> refined(std::span<const Index> faceParent, std::size_t vertexCount) const override;
};

}  // namespace fielddeform::mesh::formats
