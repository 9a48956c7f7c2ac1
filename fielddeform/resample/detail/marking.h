#pragma once

#include <fielddeform/resample/detail/references.h>
#include <fielddeform/resample/options.h>

namespace fielddeform::resample::detail {

/// The images of a mesh's vertices.
struct Images {
  std::vector<Vec3> position, safe;
  std::vector<Status> status;
  std::vector<float> residual;

  void resize(std::size_t count);
  map::MapOutput output() { return {position, safe, status, residual}; }
};

/// An edge to divide, and the image of its rest midpoint.
struct Marked {
  Index edge;
  float residual;
  double severity;  ///< how far over the bound; below 1: divided only for the shape of its faces
  Vec3 position, safe;
  Status status;
};

struct Marking {
  std::vector<Marked> edges;  ///< by edge
  std::vector<Index> asFan;   ///< polygons with no marked edge and a diagonal that deviates too much, ascending
  std::size_t refused = 0;    ///< edges without a finite image of their midpoint
  double deviation = 0;       ///< largest among the edges examined and not marked, world units

  std::size_t tooCoarse() const;  ///< edges and polygons over a bound
};

/// A mesh with its images, in a round.
struct State {
  const mesh::Mesh& mesh;
  const mesh::EdgeTable& table;
  Points posed;
  const map::Binding* binding;  ///< of all vertices, for maps whose midpoints inherit values; else null
};

/// Judges edges and polygons.
struct Judge {
  const map::SpaceMap& map;
  const Options& options;
  double tolerance;                ///< of the deviation, world units

  /// Edges of the table that are too coarse; the others' `settled` is set.
  /// @param forced  edges to divide anyway, ascending
  Marking mark(const State& state, EdgeMemory& memory, std::span<const Index> forced, Progress& progress) const;

  /// Adds the polygons to be divided into their fan; sets faceSettled of those found fine enough.
  void markPolygons(const State& state, std::vector<std::uint8_t>& faceSettled, Marking& marking,
                    Progress& progress) const;
};

}  // namespace fielddeform::resample::detail
