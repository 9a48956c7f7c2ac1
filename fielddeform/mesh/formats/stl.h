#pragma once

#include <fielddeform/mesh/formats/codec.h>

#include <array>
#include <string>
#include <vector>

namespace fielddeform::mesh::formats {

/// What an STL file holds beside its facets. The facets' normals are the face attribute "normal", their attribute
/// words (if any is not zero) the face attribute "stl_attribute".
class StlLayout final : public FormatLayout {
 public:
  struct Solid {
    std::string name, endName;  ///< behind "solid" and "endsolid"
    std::uint64_t facets = 0;
  };
  bool ascii = false;
  std::array<char, 80> header{};  ///< of a binary file
  std::string trailing;           ///< of a binary file, after its last facet
  std::string eol = "\n";
  std::vector<Solid> solids;                 ///< of a text file
  std::vector<std::uint64_t> facetHash;      ///< of the corner positions: tells which stored normals still hold
  std::vector<std::uint64_t> negativeZeros;  ///< 3 * corner + axis, where welding changed the sign of a zero

  Format format() const noexcept override { return Format::Stl; }
  std::vector<std::string> extras() const override;
  std::shared_ptr<const FileLayout> refined(std::span<const Index> faceParent, std::size_t vertexCount) const override;
};

/// True if the size is that of a binary STL with the number of facets it states, whatever its header says.
bool hasBinaryStlSize(std::span<const char> bytes) noexcept;
/// Hash of the positions of a triangle's corners.
std::uint64_t hashFacet(const Vec3& a, const Vec3& b, const Vec3& c) noexcept;

}  // namespace fielddeform::mesh::formats
