#pragma once

#include <fielddeform/mesh/mesh.h>

#include <memory>

namespace fielddeform::map {

/// What an object is pressed against: no point of it may be inside. Immutable, safe to use from many threads.
class PressTool {
 public:
  /// The half space behind a plane: inside is where normal . (x - point) < 0.
  /// @throw std::invalid_argument if a number is not finite or the normal has no length
  static PressTool plane(const Vec3& point, const Vec3& normal);
  /// A closed surface of any orientation: inside is where its winding number is not 0.
  /// @throw std::invalid_argument if it has no triangles, is not closed (naming the number of open edges), or a vertex is not finite
  static PressTool solid(const mesh::Mesh& mesh);

  struct Contact {
    double depth = 0;             ///< world, distance to the tool's surface; 0 for points outside
    Vec3 surface = Vec3::Zero();  ///< world, the nearest point of that surface; meaningful if depth > 0
    Vec3 out = Vec3::Zero();      ///< unit, from the point towards `surface`; meaningful if depth > 0
  };
  Contact contact(const Vec3& point) const;
  /// Signed distance to the tool's surface, world, negative inside; +infinity for points that are not finite.
  /// @param enough  if the distance is larger than this, some number larger than it may come back instead
  double clearance(const Vec3& point, double enough) const;
  /// A flat face is out of it where its corners are.
  bool isPlane() const;

  ~PressTool();
  PressTool(const PressTool&);
  PressTool& operator=(const PressTool&);

 private:
  struct Impl;
  explicit PressTool(std::shared_ptr<const Impl> impl);
  std::shared_ptr<const Impl> impl_;
};

}  // namespace fielddeform::map
