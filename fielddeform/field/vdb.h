#pragma once

#include <fielddeform/field/isosurface.h>

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace fielddeform::field {

/// One grid as it was written.
struct VdbGridReport {
  std::string name;
  double voxel = 0;          ///< world
  std::size_t voxels = 0;    ///< active
  double megabytes = 0;      ///< in memory
};

struct VdbWriteOptions {
  SampleOptions samples = {};
  bool primitives = false;             ///< besides the blend, a grid of each primitive's distance
  std::string units = "model units";   ///< said in the file
};

/// Writes a field as an OpenVDB file: grid "pseudo_distance" (D, world) where the skeleton reaches, R elsewhere; and
/// "distance NAME" of each primitive, scaled by its own greatest radius. Metadata of each: units, radius, potential,
/// sharpness, distance (how it was found), weight.
/// Same field, same bytes. @throw IoError; std::invalid_argument if the grids exceed the memory;
/// std::runtime_error in a build without OpenVDB
std::vector<VdbGridReport> writeVdb(const Field& field, const skeleton::Skeleton& skeleton, const std::filesystem::path& path,
                                    const VdbWriteOptions& options, Progress& progress);

struct VdbReadOptions {
  std::string grid = {};                  ///< name; empty: the first grid of floats or doubles
  std::optional<double> isovalue = {};    ///< absent: 0 for a level set, 0.5 for a fog volume
  double maxMegabytes = 4096;             ///< of the file, of the volume read, and of the surface: each
};

/// The surface of a level set (negative inside) or fog volume (high inside) of a file, in world space, closed unless the
/// volume runs against the end of its stored voxels with other than background values. The reader is our own (file
/// versions 222 to 224, float or double grids, also half precision; zip and Blosc) and needs no OpenVDB: any bytes give a
/// surface or an error.
/// @throw IoError if the file or the grid cannot be read, exceeds the memory, or has no such surface
mesh::Mesh readVdbSurface(const std::filesystem::path& path, const VdbReadOptions& options = {});
/// The same from bytes. @param path  for messages
mesh::Mesh parseVdbSurface(std::string_view bytes, const std::filesystem::path& path, const VdbReadOptions& options = {});

/// Whether the file's name ends in .vdb.
bool isVdb(const std::filesystem::path& path);
/// A skeleton file; or a volume as a skeleton of one closed mesh, named by its file.
/// @param grid  of a volume: the grid's name; empty: the first of floats or doubles. Other files have none
/// @throw IoError, which names the grids that are there if that one is not
skeleton::Skeleton readSkeletonOrVolume(const std::filesystem::path& path, const std::string& grid = {});

}  // namespace fielddeform::field
