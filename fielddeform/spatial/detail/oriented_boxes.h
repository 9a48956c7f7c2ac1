#pragma once

#include <fielddeform/spatial/detail/box_tree.h>
#include <fielddeform/spatial/detail/simplex_inline.h>

#include <cmath>
#include <vector>

namespace fielddeform::spatial::detail {

/// A box with axes of its own. Boxes along the world's axes stand out of a slanted surface by as much as they are long, and a query
/// opens all that stand out towards it: of n small triangles about the root. A box that lies in the surface stands out by the square
/// of its length only.
struct OrientedBox {
  Vec3 centre, axis[3];
  Vec3 half = Vec3::Constant(-1);  ///< half sides, with 1e-12 of the diagonal over, more than distances to the box err by it; negative: there is no box
  double diagonal = 0;

  bool exists() const { return half[0] >= 0; }

  /// Squared distance; 0 inside.
  double squareTo(const Vec3& q) const {
    const Vec3 d = q - centre;
    double sum = 0;
    for (int k = 0; k < 3; ++k) {
      const double beyond = std::abs(dot(axis[k], d)) - half[k];
      sum += beyond > 0 ? beyond * beyond : 0;
    }
    return sum;
  }
  /// The same, with q minus the closest point of the box.
  double squareTo(const Vec3& q, Vec3& offset) const {
    const Vec3 d = q - centre;
    double sum = 0;
    offset.setZero();
    for (int k = 0; k < 3; ++k) {
      const double along = dot(axis[k], d), beyond = std::abs(along) - half[k];
      if (!(beyond > 0)) continue;
      sum += beyond * beyond;
      offset += (along < 0 ? -beyond : beyond) * axis[k];
    }
    return sum;
  }
};

/// Boxes around the triangles below the children of each node, two a node; only where those are few.
/// @param vertex  by leaf slot, three each
std::vector<OrientedBox> orientedBoxes(const BoxTree& tree, const std::vector<Vec3>& vertex);

}  // namespace fielddeform::spatial::detail
