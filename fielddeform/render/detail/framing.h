#pragma once

#include <fielddeform/render/picture.h>

#include <Eigen/Core>

namespace fielddeform::render::detail {

/// A rectangle of the picture, pixels from the top left.
struct Cell {
  int x = 0, y = 0, width = 0, height = 0;
};

/// A view's place in the picture and its camera. Space is normalised: (p - centre) / scale, so that what is drawn lies
/// about within [-1, 1] and floats are fine.
struct ViewFrame {
  Cell cell;
  Vec3 centre = Vec3::Zero();  ///< world
  double scale = 1;            ///< world units
  Projection projection = Projection::Perspective;
  Eigen::Vector3f eye, right, up, forward;  ///< normalised space; the last three orthonormal
  float halfWidth = 1, halfHeight = 1;      ///< of the picture plane: at distance 1 (perspective), or everywhere
  float pixel = 1;                          ///< size of a pixel at the object's middle, normalised

  Vec3 normalised(const Vec3& p) const { return (p * 0.5 - centre * 0.5) / (scale * 0.5); }  // halves: no overflow
};

struct Sheet {
  int width = 0, height = 0;
  std::vector<ViewFrame> views;
  Cell legend;               ///< empty if there is none
  float capitalHeight = 12;  ///< of all writing, pixels
};

/// Whether a body's colours come from its scalars.
inline bool showsScalars(const Body& body) { return !body.color && !body.scalars.empty(); }
/// The points that a body draws: those of faces and lines, and loose ones; all if it has none of these. Finite ones
/// only.
std::vector<Index> drawnVertices(const Body& body);
inline const std::vector<Vec3>& positionsOf(const Body& body) {
  return body.positions.empty() ? body.mesh->positions() : body.positions;
}

Sheet layOutSheet(const Picture& picture);

}  // namespace fielddeform::render::detail
