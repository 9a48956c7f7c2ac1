#pragma once

#include <fielddeform/mesh/topology.h>

namespace fielddeform::resample::detail {

inline constexpr std::uint8_t kRefused = 2;

/// What is remembered of each edge between rounds.
struct EdgeMemory {
  std::vector<double> reference;      ///< #E, world units; what the deformed length is compared with
  std::vector<std::uint8_t> settled;  ///< #E, 1: found fine enough, and its ends have not moved since
                                      ///< (kRefused: has no finite image of its midpoint)

  /// Every edge with its rest length.
  EdgeMemory(const mesh::EdgeTable& table, Points rest);
  EdgeMemory() = default;
};

/// The memory for the divided mesh: kept edges keep theirs, halves inherit the whole's reference, an edge new inside a
/// face takes the larger of its rest length and the mean reference of that face (the largest, if several faces share it).
/// @param old, rank   the table before, and the new vertex of each of its edges (kNoIndex: not divided)
/// @param oldFaces    the mesh before
/// @param table       of the divided mesh
/// @param faceParent  its faces' parents
/// @param divided     the divided edges in the order of their new vertices
EdgeMemory carryOver(const EdgeMemory& memory, const mesh::EdgeTable& old, const mesh::Mesh& oldMesh,
                     std::span<const Index> divided, std::span<const Index> rank, const mesh::EdgeTable& table,
                     Points rest, std::span<const Index> faceParent);

}  // namespace fielddeform::resample::detail
