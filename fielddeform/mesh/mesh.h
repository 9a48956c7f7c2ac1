#pragma once

#include <fielddeform/core/types.h>
#include <fielddeform/mesh/attribute.h>

#include <memory>
#include <string>
#include <vector>

namespace fielddeform::mesh {

/// What a reader keeps beside the mesh so that a writer can restore the file: format, header, property order,
/// comments, the sequence of statements. Opaque to everyone but the format that made it.
class FileLayout {
 public:
  virtual ~FileLayout() = default;
  /// The layout of a mesh whose face f was replaced by the faces i with faceParent[i] == f (ascending) and
  /// whose new vertices follow the old ones.
  virtual std::shared_ptr<const FileLayout> refined(std::span<const Index> faceParent,
                                                    std::size_t vertexCount) const = 0;
};

/// Elements that ride along and are not deformed by themselves.
struct Polyline { std::vector<Index> vertices; };

/// An indexed polygon mesh. Nothing is merged, reordered or repaired: non-manifold, degenerate, duplicate and isolated
/// elements stay as they came. Geometry is the positions; everything else rides along.
class Mesh {
 public:
  Mesh() = default;
  /// @param positions #V by 3, world
  /// @param corners   3 vertex indices a triangle
  /// @throw std::invalid_argument if an index is out of range or the corners are no whole triangles
  Mesh(std::vector<Vec3> positions, std::vector<Index> corners);
  /// @param offsets #F+1; face f has the corners offsets[f] .. offsets[f+1]-1, at least 1 each
  Mesh(std::vector<Vec3> positions, std::vector<Index> corners, std::vector<Index> offsets);

  std::size_t vertexCount() const noexcept { return positions_.size(); }
  std::size_t cornerCount() const noexcept { return corners_.size(); }
  std::size_t faceCount() const noexcept { return offsets_.empty() ? corners_.size() / 3 : offsets_.size() - 1; }

  const std::vector<Vec3>& positions() const noexcept { return positions_; }
  /// @throw std::invalid_argument if the count differs from vertexCount().
  void setPositions(std::vector<Vec3> positions);
  std::vector<Vec3>& mutablePositions() noexcept { return positions_; }

  const std::vector<Index>& corners() const noexcept { return corners_; }
  bool allTriangles() const noexcept { return offsets_.empty(); }
  const std::vector<Index>& offsets() const noexcept { return offsets_; }  ///< empty if all faces are triangles
  Index faceBegin(std::size_t f) const noexcept { return offsets_.empty() ? static_cast<Index>(3 * f) : offsets_[f]; }
  std::span<const Index> face(std::size_t f) const noexcept {
    const Index b = faceBegin(f);
    return {corners_.data() + b, faceBegin(f + 1) - b};
  }
  /// Every polygon as the fan from its corner 0 (the project's one rule); faces of < 3 corners give none.
  template <class F>
  void forEachTriangle(std::size_t f, F&& call) const {
    const auto c = face(f);
    for (std::size_t k = 2; k < c.size(); ++k) call(c[0], c[k - 1], c[k]);
  }
  /// Triangles of all faces in face order, 3 indices each.
  std::vector<Index> triangles() const;

  std::vector<Attribute>& attributes() noexcept { return attributes_; }
  const std::vector<Attribute>& attributes() const noexcept { return attributes_; }
  /// The first attribute of this name on this element, or null.
  const Attribute* find(Element on, std::string_view name) const noexcept;
  Attribute* find(Element on, std::string_view name) noexcept;

  std::vector<Polyline>& lines() noexcept { return lines_; }
  const std::vector<Polyline>& lines() const noexcept { return lines_; }
  std::vector<Index>& loosePoints() noexcept { return loosePoints_; }
  const std::vector<Index>& loosePoints() const noexcept { return loosePoints_; }

  /// How the file stores coordinates: Float32 or Float64 in binary, Float64 for text that keeps all digits.
  ScalarType positionType() const noexcept { return positionType_; }
  void setPositionType(ScalarType type) noexcept { positionType_ = type; }

  const std::shared_ptr<const FileLayout>& layout() const noexcept { return layout_; }
  void setLayout(std::shared_ptr<const FileLayout> layout) { layout_ = std::move(layout); }

 private:
  std::vector<Vec3> positions_;
  std::vector<Index> corners_;
  std::vector<Index> offsets_;
  std::vector<Attribute> attributes_;
  std::vector<Polyline> lines_;
  std::vector<Index> loosePoints_;
  ScalarType positionType_ = ScalarType::Float64;
  std::shared_ptr<const FileLayout> layout_;
};

/// Box of all finite positions; empty if there are none.
Box boundingBox(Points positions);
/// Length of the box's diagonal: what tolerances relative to "the size" refer to. 0 for no or one point.
double objectSize(Points positions);

}  // namespace fielddeform::mesh
