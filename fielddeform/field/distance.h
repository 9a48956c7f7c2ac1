#pragma once

#include <fielddeform/core/types.h>

#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

namespace fielddeform::field {

/// How a primitive's distance is found. docs/field.md compares them.
enum class Distance : std::uint8_t {
  Exact,        ///< closest point by a tree: the reference
  Variational,  ///< radial functions fitted to samples of it: smooth where the distance has kinks  [Turk & O'Brien 1999]
  Grid,         ///< samples of it in a sparse OpenVDB grid
};

enum class Sampling : std::uint8_t {
  Trilinear,  ///< continuous; error of second order in the voxel
  Quadratic,  ///< 27 voxels instead of 8; third order, about three times as slow
};

/// Whether this build has OpenVDB: without it grids and .vdb files are refused with a sentence that says so.
bool gridsAvailable() noexcept;

/// What a grid samples.
enum class GridOf : std::uint8_t {
  Primitives,  ///< a grid of each primitive's distance
  Blend,       ///< one grid of the whole field's pseudo-distance: one look-up, however many primitives meet
};

/// Where voxels are kept, within what the skeleton reaches; elsewhere the distance is exact.
enum class GridAround : std::uint8_t {
  Mesh,       ///< near the points that the field is made for, if it is told any: a mesh's vertices
  Influence,  ///< everywhere
};

struct GridOptions {
  std::optional<double> voxel = {};  ///< edge of a voxel, world, > 0; absent: the largest that keeps the tolerance
  double tolerance = 1e-3;           ///< greatest interpolation error where the distance is smooth, in radii, 1e-6 to 0.1
  Sampling sampling = Sampling::Trilinear;
  GridOf of = GridOf::Primitives;
  GridAround around = GridAround::Mesh;
  double maxMegabytes = 2048;        ///< of all grids of one field (1e6 bytes); more is refused before it is taken
  double takenMegabytes = 0;         ///< of that, already in use for grids of other fields
};

struct VariationalOptions {
  std::size_t centres = 1000;        ///< at most, a primitive, 16 to 100000; up to 2000 with r^3, above with compact support
  double smoothing = 0;              ///< >= 0, dimensionless: 0 interpolates
  double tolerance = 1e-6;           ///< above 2000 centres: greatest residual at the constraints, in radii, 1e-10 to 0.1
};

struct DistanceOptions {
  Distance kind = Distance::Exact;
  GridOptions grid = {};
  VariationalOptions variational = {};
  void validate() const;             ///< @throw std::invalid_argument naming the option, its value and its bound
};

/// Grids that would take more memory than they may. The message names the number.
class GridMemoryError : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

/// What stands behind one primitive's distance, or behind the whole field.
struct DistanceReport {
  Distance kind = Distance::Exact;
  // Grid
  double voxel = 0;                  ///< world
  std::size_t voxels = 0;            ///< stored
  double megabytes = 0;              ///< of the grid
  double exactWithin = 0;            ///< nearer to the primitive than this the exact distance is taken, world
  /// Greatest trilinear error where the closest point is unique, world; absent with a radius per point, and for a blend of
  /// potentials other than exponential.
  std::optional<double> smoothError = {};
  /// Greatest error anywhere, as the slope is bounded, world; absent: not a grid, or a blend as above.
  std::optional<double> kinkError = {};
  double measuredError = 0;          ///< greatest difference from the exact field at the centres of 4096 cells, world
  // Variational
  std::size_t centres = 0;
  int levels = 0;                    ///< of compact support; 0: r^3 by a dense solve
  double residual = 0;               ///< greatest at the constraints, world
};

std::string_view toString(Distance kind) noexcept;      ///< "exact", "variational", "grid"
std::string_view toString(Sampling sampling) noexcept;  ///< "trilinear", "quadratic"
std::string_view toString(GridOf of) noexcept;          ///< "primitives", "blend"
std::string_view toString(GridAround around) noexcept;  ///< "mesh", "influence"

}  // namespace fielddeform::field
