#pragma once

#include <fielddeform/render/detail/geometry.h>

#include <memory>

namespace fielddeform::render::detail {

/// What a ray met. Normalised space, linear light.
struct Hit {
  float distance = 0;
  Eigen::Vector3f normal;  ///< unit, of the shaded (smoothed) surface, turned towards the ray's origin
  Eigen::Vector3f flat;    ///< unit, of the geometry, turned towards the ray's origin
  Eigen::Vector3f color;
  std::uint32_t part = 0;  ///< which of the scene's geometries
  float hidden = 0;        ///< of an overlay: its opacity behind bodies
};

/// Geometry to shoot rays at. Immutable; rays may come from many threads. The only place that knows Embree.
class RayScene {
 public:
  RayScene(std::vector<Surface> surfaces, std::vector<Strokes> strokes);
  ~RayScene();
  RayScene(RayScene&&) noexcept;

  bool empty() const noexcept;
  /// The nearest thing along the ray, if any. The direction is a unit vector.
  bool intersect(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, Hit& hit) const;
  /// Whether anything lies within `reach` of the origin along the ray.
  bool occluded(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, float reach) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fielddeform::render::detail
