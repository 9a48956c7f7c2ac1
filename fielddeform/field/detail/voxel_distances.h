#pragma once

#include <fielddeform/field/detail/blocks.h>
#include <fielddeform/field/detail/primitive_distance.h>

#include <functional>

namespace fielddeform::field::detail {

/// The nearest element to a lattice point.
struct VoxelHit {
  double distance = 0;       ///< world; negative inside a solid
  Index element = kNoIndex;  ///< kNoIndex: none within reach
  Vec3 weight = Vec3::Zero();
};

inline constexpr std::size_t kCube = 64;      ///< 4^3 points, handed over together
inline constexpr double kMostScanSteps = 64;  ///< for a voxel: beyond, searches are quicker

/// What becomes of a cube: the hits of the points nearOrder(first), nearOrder(first + 1), ... of a block.
using CubeFunction = std::function<void(std::size_t block, std::size_t first, std::span<const VoxelHit> hits)>;

/// PrimitiveDistance::closest() at every point of these blocks. Fine meshes are scanned, face by face, where they are the nearest
/// (normal_regions.h); elsewhere cubes of points search together. Both try exact distances, so that which of them is taken
/// makes no difference.
/// @param corners  sorted, of blocks
/// @param reach    world, unsigned; points farther away have no element
/// @param put      called once for every cube, from many threads
/// @param mostSteps  of a scan, for a voxel: where it would take more, cubes search
void voxelDistances(const PrimitiveDistance& distance, const Lattice& lattice, const std::vector<Cell>& corners, double reach,
                    const CubeFunction& put, double mostSteps = kMostScanSteps);

}  // namespace fielddeform::field::detail
