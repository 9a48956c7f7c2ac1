#pragma once

#include <fielddeform/render/detail/framing.h>

namespace fielddeform::render::detail {

/// Triangles with normals and colours at their corners. Normalised space, linear light.
struct Surface {
  std::vector<Eigen::Vector3f> points;
  std::vector<Index> corners;            ///< 3 a triangle, into points
  std::vector<Eigen::Vector3f> normals;  ///< a corner, unit
  std::vector<Eigen::Vector3f> colors;   ///< a corner, or empty: `color`
  Eigen::Vector3f color{0.5f, 0.5f, 0.5f};
};

/// Tubes and spheres. Normalised space, linear light.
struct Strokes {
  std::vector<Eigen::Vector4f> tubes;         ///< x, y, z, radius; two entries a tube
  std::vector<Eigen::Vector4f> spheres;       ///< x, y, z, radius
  std::vector<Eigen::Vector3f> sphereColors;  ///< a sphere, or empty: `color`
  Eigen::Vector3f color{0.5f, 0.5f, 0.5f};
  float hidden = 0;  ///< opacity behind bodies (overlays)
};

/// The range that maps to the two ends of the colour map.
struct ScalarRange {
  double low = 0, high = 1;
};

/// The picture's range: as given, else of all finite scalars that are shown.
ScalarRange scalarRange(const Picture& picture);

Surface makeSurface(const Body& body, const ViewFrame& frame, const ScalarStyle& style, const ScalarRange& range);
/// Lines, points and drawn edges of a body.
Strokes makeStrokes(const Body& body, const ViewFrame& frame, const ScalarStyle& style, const ScalarRange& range);
Strokes makeStrokes(const Overlay& overlay, const ViewFrame& frame);

}  // namespace fielddeform::render::detail
