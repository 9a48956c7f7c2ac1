#pragma once

#include <fielddeform/mesh/topology.h>
#include <fielddeform/volume/local.h>

#include <cstdint>
#include <optional>

namespace fielddeform::volume::detail {

/// One edit with what its mesh alone says. Coordinates are the model's by a power of two, about 1 in size: nothing is rounded by
/// that, and no sum depends on the model's units.
struct LocalEdit {
  explicit LocalEdit(const LocalInput& input);
  LocalEdit(const LocalEdit&) = delete;
  LocalEdit& operator=(const LocalEdit&) = delete;

  const mesh::Mesh& mesh;
  int exponent = 0;             ///< world = scaled * 2^exponent
  std::vector<Vec3> rest, posed;  ///< #V, scaled
  double size = 0;              ///< of the rest, scaled
  std::optional<mesh::EdgeTable> ownEdges;  ///< if the caller has none
  const mesh::EdgeTable& edges;
  mesh::Components components;
  std::vector<std::uint8_t> still;     ///< #V: the edit left it alone
  std::vector<std::uint8_t> touched;   ///< #components: some vertex is not where it was
  std::vector<std::uint8_t> rim;       ///< #V: end of an edge with an odd number of uses
  std::vector<std::size_t> ringStart;  ///< #V+1
  std::vector<Index> ring;             ///< neighbours along edges

  std::size_t vertexCount() const noexcept { return rest.size(); }
  std::span<const Index> neighbours(Index v) const noexcept {
    return {ring.data() + ringStart[v], ringStart[v + 1] - ringStart[v]};
  }
};

/// l = 2 |V_p| / A_p of the faces with a vertex that `counts`: 2 sum |V_p| / sum A_p over their connected patches, each closed
/// by cones from the centroid of its rim. The radius of a long tube, 2/3 of a ball's. At least sqrt(A) / 60 (flat patches).
double partLength(const LocalEdit& edit, const std::vector<std::uint8_t>& counts);

/// Posed and rest volumes of components.
class ComponentVolumes {
 public:
  /// @param held  #components: which ones
  /// @throw InfeasibleError if a held one has no volume that an edit could preserve
  ComponentVolumes(const LocalEdit& edit, const std::vector<std::uint8_t>& held);

  struct Value {
    Index component = 0;
    double rest = 0, posed = 0;  ///< scaled units; with fixed rims: closed by cones from the rims' centroid
    double change() const noexcept { return posed - rest; }
    double deviation() const noexcept;
  };
  std::vector<Value> measure(Points posed) const;
  std::size_t count() const noexcept { return centre_.size(); }
  Index slot(Index component) const noexcept { return component == kNoIndex ? kNoIndex : slot_[component]; }

 private:
  const LocalEdit& edit_;
  std::vector<Index> slot_;          // #components, kNoIndex: not held
  std::vector<Index> component_;     // #held
  std::vector<std::uint8_t> open_;   // #held
  std::vector<Vec3> centre_;         // #held, of the rest; of the rims if open
};

}  // namespace fielddeform::volume::detail
