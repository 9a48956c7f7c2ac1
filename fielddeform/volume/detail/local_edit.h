#pragma once

#include <fielddeform/core/parallel.h>
#include <fielddeform/mesh/topology.h>
#include <fielddeform/volume/detail/index_lists.h>
#include <fielddeform/volume/local.h>

#include <cstdint>
#include <optional>

namespace fielddeform::volume::detail {

/// Points by a power of two, multiplied where they are read: nothing is rounded, and nothing is copied as long as that factor is a
/// normal number.
class ScaledPoints {
 public:
  /// points * 2^-exponent. @param points  outlive this
  ScaledPoints(Points points, int exponent);
  ScaledPoints(const ScaledPoints&) = delete;
  ScaledPoints& operator=(const ScaledPoints&) = delete;

  std::size_t size() const noexcept { return points_.size(); }
  Vec3 operator[](std::size_t v) const noexcept { return points_[v] * factor_; }

 private:
  Points points_;
  double factor_ = 1;
  std::vector<Vec3> own_;
};

/// A sum a component over [0, n), by chunks side by side where the components are few: the same bits on any number of threads.
/// @param chunk  chunk(begin, end, rows) adds to rows[component]; a Row has operator+=
template <class Row, class Chunk>
std::vector<Row> sumByComponent(std::size_t components, std::size_t n, Chunk&& chunk) {
  constexpr std::size_t kFew = 64, kGrain = 1 << 16;
  const std::size_t grain = components <= kFew ? kGrain : std::max<std::size_t>(n, 1), chunks = (n + grain - 1) / grain;
  std::vector<Row> rows(chunks * components), out(components);
  parallelFor(n, grain, [&](std::size_t begin, std::size_t end) { chunk(begin, end, rows.data() + begin / grain * components); });
  for (std::size_t i = 0; i < rows.size(); ++i) out[i % components] += rows[i];
  return out;
}

/// One edit with what its mesh alone says. Coordinates are the model's by a power of two, about 1 in size: nothing is rounded by
/// that, and no sum depends on the model's units.
struct LocalEdit {
  explicit LocalEdit(const LocalInput& input);
  LocalEdit(const LocalEdit&) = delete;
  LocalEdit& operator=(const LocalEdit&) = delete;

  const mesh::Mesh& mesh;
  int exponent = 0;             ///< world = scaled * 2^exponent
  ScaledPoints rest, posed;     ///< #V, scaled
  double size = 0;              ///< of the rest, scaled
  std::optional<mesh::EdgeTable> ownEdges;  ///< if the caller has none
  const mesh::EdgeTable* edges = nullptr;   ///< null once they were given back
  mesh::Components components;
  std::vector<std::uint8_t> still;     ///< #V: the edit left it alone
  std::vector<std::uint8_t> touched;   ///< #components: some vertex is not where it was
  std::vector<std::uint8_t> rim;       ///< #V: end of an edge with an odd number of uses

  std::size_t vertexCount() const noexcept { return rest.size(); }
  bool closed() const noexcept;   ///< no edge has an odd number of uses
  IndexLists neighbours() const;  ///< of every vertex along edges, ascending
  void giveBackEdges() noexcept { ownEdges.reset(), edges = nullptr; }

 private:
  LocalEdit(const LocalInput& input, const Box& restBox, const Box& posedBox);
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
  std::vector<Value> measure(const ScaledPoints& posed) const;
  /// With the edit's posed vertices displaced. @param displacement  #V by 3, scaled
  std::vector<Value> measureDisplaced(Points displacement) const;
  std::size_t count() const noexcept { return centre_.size(); }
  Index slot(Index component) const noexcept { return component == kNoIndex ? kNoIndex : slot_[component]; }

 private:
  void findFirst();
  template <class Position>
  std::vector<double> volumes(const std::vector<Vec3>& centre, const Position& position) const;
  template <class Position>
  std::vector<Value> measureAt(const Position& posed) const;

  const LocalEdit& edit_;
  std::vector<Index> slot_;          // #components, kNoIndex: not held
  std::vector<Index> component_;     // #held
  std::vector<std::uint8_t> open_;   // #held
  std::vector<Vec3> centre_;         // #held, of the rest; of the rims if open
  std::vector<Index> first_;         // #held, a vertex
  std::vector<double> rest_;         // #held, volumes
};

}  // namespace fielddeform::volume::detail
