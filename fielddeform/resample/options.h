#pragma once

#include <fielddeform/map/space_map.h>
#include <fielddeform/mesh/mesh.h>

#include <functional>
#include <optional>

namespace fielddeform::resample {

/// What makes an edge too coarse. An edge is judged by its own data alone.
enum class Criterion : std::uint8_t {
  Stretch,    ///< deformed length >= maxStretch * reference length [Qin et al. 2003, Fig. 6]
  Deviation,  ///< the image of its rest midpoint lies off its deformed chord by more than maxDeviation
  Both,
};

/// A step on the whole mesh after the map: the fold guard. May move points, and says so in status and residual.
/// @param rest   the refined mesh so far
/// @param state  position, safe, status and residual of all its vertices
using MeshStep = std::function<void(const mesh::Mesh& rest, const map::MapOutput& state)>;

struct Options {
  Criterion by = Criterion::Both;
  double maxStretch = 1.8;       ///< ratio to the reference length, >= 1
  double maxDeviation = 1e-3;    ///< share of the object's size (diagonal of the rest mesh's box), > 0
  /// Dividing may not leave triangles with a smaller angle, nor with less than half of the input face's smallest, both at
  /// rest and deformed, in radians: the longest side of such a triangle is divided
  /// too, even if it did not move. 0 turns it off. < pi/3
  double minAngle = 0.2;
  int maxRounds = 8;             ///< >= 0
  /// Most vertices of the result; when it is reached the worst edges have been split. Automatic: 8 * input + 100 000.
  std::optional<std::size_t> maxVertices = std::nullopt;
  MeshStep meshStep = {};        ///< may be empty

  /// @throw std::invalid_argument naming the field
  void validate() const;
};

}  // namespace fielddeform::resample
