#pragma once

#include <fielddeform/field/detail/blocks.h>

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// Our own reader of .vdb files: OpenVDB's takes as much memory as a file names before it looks whether the file has it.
namespace fielddeform::field::detail {

/// A sparse volume of numbers as a file holds it: stored blocks, and cubes of one value around them.
class VdbVolume {
 public:
  std::string name;
  bool fog = false;                                       ///< class "fog volume": high inside
  Eigen::Matrix4d toWorld = Eigen::Matrix4d::Identity();  ///< of voxel indices

  /// Sides of the cubes of a tree, in voxels: level 0, 1, 2.
  static constexpr std::array<std::int32_t, 3> kSides{8, 128, 4096};
  struct Tile {
    Cell low;
    float value;
  };

  float background = 0;
  std::vector<Cell> blocks;                      ///< level 0, stored: corners, sorted
  std::vector<std::uint32_t> place;              ///< where block i stands in `values`, in units of 512
  std::vector<float> values;                     ///< z fastest
  std::array<std::vector<Cell>, 2> divided = {}; ///< cubes of level 1 and 2 that are not of one value, sorted
  std::array<std::vector<Tile>, 3> tiles = {};   ///< cubes of one value that is not the background's, sorted

  /// The values of a stored block; null if it is none.
  const float* block(const Cell& corner) const;
  /// The value of a cube, if it is all of one.
  std::optional<float> uniform(const Cell& low, std::size_t level) const;
  void sort();
};

/// @param bytes  of a file of version 222 to 224, with float or double trees of the usual shape (5, 4, 3)
/// @param grid   its name; empty: the first grid of floats or doubles
/// @throw IoError naming the file and the byte if it is no such file, lies about itself, is cut off, or takes more memory
VdbVolume readVdbVolume(std::string_view bytes, const std::filesystem::path& path, const std::string& grid, double maxMegabytes);

}  // namespace fielddeform::field::detail
