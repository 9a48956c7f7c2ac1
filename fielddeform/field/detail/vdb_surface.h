#pragma once

#include <fielddeform/field/detail/blocks.h>

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace fielddeform::field::detail {

/// A grid of a .vdb file, as far as its surface needs it.
struct VdbContent {
  std::vector<Cell> corners;          ///< blocks through which the surface may pass, sorted; in voxels
  std::vector<float> values;          ///< 512 a block, negative inside
  Eigen::Matrix4d toWorld;            ///< of voxel indices
  bool fog = false;                   ///< inside is where values are high
  std::string name;
};

/// @param bytes     of the file
/// @param grid      its name; empty: the first grid of floats or doubles
/// @param isovalue  of the surface; absent: 0 for a level set, 0.5 for a fog volume
/// @throw IoError if the bytes cannot be read, hold no such grid, or exceed the memory
VdbContent readVdbContent(std::string_view bytes, const std::filesystem::path& path, const std::string& grid,
                          std::optional<double> isovalue, double maxMegabytes);

}  // namespace fielddeform::field::detail
