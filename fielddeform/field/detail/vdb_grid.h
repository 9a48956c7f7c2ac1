#pragma once

#include <fielddeform/field/detail/blocks.h>
#include <fielddeform/field/distance.h>

#include <filesystem>
#include <map>
#include <memory>
#include <variant>

/// OpenVDB behind a plain header: its templates are compiled once, in vdb_grid.cpp. Files are read without it, see vdb_reader.h.
namespace fielddeform::field::detail {

using MetaValue = std::variant<std::string, double>;
using MetaData = std::map<std::string, MetaValue>;

enum class VdbClass : std::uint8_t { Unknown, LevelSet, Fog };

/// Floats at the points of a lattice, in whole leaves of 8^3 voxels.
class VdbGrid {
 public:
  /// Leaves at the given block corners, all voxels active.
  /// @param background  the value elsewhere
  VdbGrid(const Lattice& lattice, const std::vector<Cell>& corners, float background);
  ~VdbGrid();
  VdbGrid(VdbGrid&&) noexcept;

  /// Memory of a block at least: a leaf and its share of the nodes above, where blocks lie together.
  static constexpr double kBytesEach = 2300;
  /// Memory of a grid with leaves at these corners, its inner nodes included; nothing is taken.
  static double megabytesOf(const std::vector<Cell>& corners);

  float* values(std::size_t block);                 ///< 512, z fastest
  void switchOff(std::size_t block, std::size_t voxel);  ///< the value stays; blocks may be changed by many threads
  std::size_t voxelCount() const noexcept;
  double megabytes() const;                         ///< 1e6 bytes, as OpenVDB counts them
  /// Value and gradient (by world) at a point; false if a voxel of the stencil is in no leaf. Many threads may ask.
  /// @param allOn  becomes false if a voxel of the stencil is switched off; null: nobody asks
  bool sample(const Vec3& point, Sampling sampling, double& value, Vec3& gradient, bool* allOn = nullptr) const;

  void describe(const std::string& name, const MetaData& meta, VdbClass what);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
  friend void writeVdbFile(std::span<const VdbGrid>, const std::filesystem::path&);
};

/// Writes grids into one file, atomically; the same grids give the same bytes. @throw IoError
void writeVdbFile(std::span<const VdbGrid> grids, const std::filesystem::path& path);

}  // namespace fielddeform::field::detail
