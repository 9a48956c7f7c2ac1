#pragma once

#include <fielddeform/core/types.h>

#include <vector>

namespace fielddeform::volume::detail {

/// In which order the volume form of a triangle mesh is summed, sum over triangles a ^ b ^ c: each triangle belongs to one of
/// its corners (its owner), v ^ sum b ^ c, and two that follow one another around it take one product,
/// b ^ c + c ^ d = (b - d) ^ c. About a fifth as many owners and half as many products as there are triangles.
struct WedgePlan {
  struct Product {
    Index first = kNoIndex, minus = kNoIndex, second = kNoIndex;  ///< (first - minus) ^ second; minus may be missing
  };
  std::vector<Index> owner;        ///< vertices
  std::vector<std::size_t> start;  ///< #owners + 1, into product
  std::vector<Product> product;

  WedgePlan() = default;
  /// @param triangles 3 vertex indices each, below `vertices`
  WedgePlan(std::size_t vertices, std::span<const Index> triangles);
};

}  // namespace fielddeform::volume::detail
