#pragma once

#include <fielddeform/gffd/detail/stage.h>
#include <fielddeform/map/space_map.h>

#include <mutex>
#include <vector>

namespace fielddeform::gffd::detail {

/// @param around  the points that will be bound, for grids that follow a mesh; none: unknown
std::shared_ptr<const Embedding> makeEmbedding(const skeleton::SkeletonPair& pair, const field::FieldOptions& options,
                                               Points around = {});

struct GffdBinding final : map::Binding {
  std::shared_ptr<const Embedding> embedding;
  std::vector<Vec3> rest;
  std::vector<double> level;  ///< D / R at rest; NaN for points that do not move
  std::vector<double> share;  ///< empty if it follows from the level (nothing was removed)
  std::vector<field::Foot> feet;  ///< on the primitives of the moving part, #P by #primitives; empty: not kept

  std::size_t size() const override { return rest.size(); }
  bool movable(std::size_t i) const { return level[i] == level[i]; }
  Value value(std::size_t i) const;
  std::span<const field::Foot> feetOf(std::size_t i) const {
    const std::size_t n = feet.empty() ? 0 : feet.size() / rest.size();
    return {feet.data() + n * i, n};
  }
  /// The movable points by cell of the embedding's frame, which must exist. Made when first asked for.
  const CellOrder& cells() const;
  /// Of an order of all finite points: keeps what moves.
  void adopt(CellOrder all) const;

 private:
  mutable std::once_flag ordered_;
  mutable CellOrder cells_;
};

std::shared_ptr<GffdBinding> bindPoints(std::shared_ptr<const Embedding> embedding, Points rest);
/// The value of one finite point; level NaN if it lies outside the influence region.
Value bindOne(const Embedding& embedding, const Vec3& point);

}  // namespace fielddeform::gffd::detail
