#pragma once

#include <fielddeform/gffd/options.h>
#include <fielddeform/map/extended_lattice.h>
#include <fielddeform/map/lattice.h>
#include <fielddeform/map/move_io.h>
#include <fielddeform/mesh/io.h>
#include <fielddeform/resample/refine.h>
#include <fielddeform/scene/methods.h>
#include <fielddeform/skeleton/edit.h>
#include <fielddeform/skeleton/skeleton.h>
#include <fielddeform/volume/local.h>

#include <filesystem>
#include <optional>
#include <string>
#include <variant>
#include <vector>

/// One deformation as data: which mesh, which skeletons or edits, which options, which outputs.
/// The file format is described in docs/scene.md.
namespace fielddeform::scene {

/// A rest skeleton made from the mesh: a spine through slice centroids.
struct AxisRest {
  std::optional<Vec3> axis;  ///< direction of the spine; absent: the rule of "auto"
};

/// A file, the skeleton itself, or a rule that makes one.
using RestSource = std::variant<std::filesystem::path, skeleton::Skeleton, AxisRest>;
using PosedSource = std::variant<std::filesystem::path, skeleton::Skeleton>;

/// One number a vertex that scales its displacement: 0 keeps the vertex, 1 deforms it fully.
struct Mask {
  std::string attribute;        ///< a vertex attribute of the mesh; empty: `file`
  std::filesystem::path file;   ///< text, one number a vertex
};

/// Gives the object back the volume that the deformation took or added.
struct VolumePass {
  volume::LocalOptions options;
  std::optional<Mask> mask;     ///< for volume::MaskKind::Given: 0 to 1 a vertex
};

/// A lattice made for each mesh, with nodes moved by number.
struct LatticeRule {
  std::array<int, 3> nodes{2, 2, 2};          ///< per axis
  map::BasisKind basis = map::BasisKind::Bernstein;
  int degree = 3;                             ///< of B-splines, 1 to 3
  map::Border border = map::Border::Coincident;
  std::optional<map::LatticeBox> box{};       ///< absent: fitted to the mesh
  bool oriented = false;                      ///< fit along the principal axes instead of x, y, z
  double padding = 0;                         ///< of a fitted box, share of its longest edge, >= 0
  map::Outside outside = map::Outside::Extend;
  struct Move {
    std::array<int, 3> node{};
    Vec3 by = Vec3::Zero();                   ///< world
  };
  std::vector<Move> moves{};                  ///< several of one node add up
};

/// Points of the mesh that a lattice is to move: its nodes follow by map::sculpt(), which may refine it.
struct Sculpt {
  std::vector<map::MoveSpec> moves{};         ///< one after the other
  std::filesystem::path pins{};               ///< map::readPins(): points that may not move; empty: none
  std::size_t maxNodes = 0;                   ///< up to which the lattice may be refined; 0: not
  double tolerance = 1e-9;                    ///< what targets may miss, share of the lattice's size, > 0
};

/// One lattice of a scene: a file (of either kind), the lattice itself, a rule, or an extended lattice.
struct LatticeStep {
  std::variant<std::filesystem::path, map::Lattice, LatticeRule, map::ExtendedLattice> source;
  bool fit = false;                           ///< carry the lattice over to the box of this mesh, displacements included
  Sculpt sculpt{};                            ///< on top of its displacements; not of extended lattices
};

enum class Axis : std::uint8_t { X, Y, Z };

/// What becomes of normals that the mesh has.
enum class Normals : std::uint8_t {
  Turn,       ///< turned with the surface around them
  Recompute,  ///< made anew from the faces
  Keep,       ///< left as they are
};

/// Bounds that a run must keep to pass its check. Absent: not checked.
struct Check {
  std::optional<std::size_t> folds = 0;    ///< folds.after
  std::optional<std::size_t> flipped = 0;
  std::optional<double> residual;          ///< residual.max in units of R
};

struct Output {
  std::filesystem::path mesh;               ///< the file to write; a folder if there are several inputs
  std::optional<std::filesystem::path> report;
  std::optional<std::filesystem::path> picture;  ///< PNG: before, after
  mesh::Precision precision = mesh::Precision::Keep;
  Normals normals = Normals::Turn;
  bool statusAttribute = false;             ///< vertex attribute "status": 0 fixed, 1 converged, 2 limited, 3 stalled, 4 invalid
  bool residualAttribute = false;           ///< vertex attribute "residual", world units
  bool displacementAttribute = false;       ///< vertex attribute "displacement", 3 wide, world units
  bool affectedAttribute = false;           ///< vertex attribute "affected": share in [0, 1] that moved lattice nodes carry
  std::size_t preview = 0;                  ///< deform a proxy of about this many of the mesh's vertices; 0: the mesh. Not in files
  int frames = 0;                           ///< 0: the result alone; n >= 2: that many files from the input (t = 0) to the result (t = 1)
};

struct Scene {
  std::uint64_t seed = 0;
  std::vector<std::filesystem::path> inputs;  ///< at least one
  mesh::ReadOptions read;
  std::vector<LatticeStep> lattices;          ///< method "lattice" by given lattices, one after the other; empty: by skeleton
  MethodKind method = MethodKind::Gffd;       ///< by skeleton
  std::optional<std::array<int, 3>> latticeNodes;  ///< of the lattice that is fitted to the skeleton; absent: by the box
  std::optional<double> wireBlend = 1;        ///< m >= 0: how several wires share a point (map/wires.h); absent: their sum
  double wireLocal = 0;                       ///< k >= 0: by how much the nearest wire has its way (map/wires.h)
  RestSource rest;
  std::optional<PosedSource> posed;           ///< a posed skeleton, or edits; not both
  std::string volumeGrid;                     ///< of skeletons that are volumes (.vdb): the grid's name; empty: the first of numbers
  std::vector<skeleton::NamedPair> pairs;
  std::vector<skeleton::Edit> edits;
  std::optional<Axis> symmetry;               ///< mirror the edits about the middle of the mesh's box
  gffd::Options tracking;
  std::optional<resample::Options> resample;
  std::optional<VolumePass> volume;
  std::optional<Mask> mask;
  Output output;
  std::optional<Check> check;
  std::string extras;                         ///< JSON object passed through; may be empty
};

/// The method's word: "lattice" for given lattices, else that of the method by skeleton.
std::string_view methodOf(const Scene& scene) noexcept;

/// Reads a scene file. Paths in the result are relative to the scene's folder no more: they are prefixed with it.
/// @throw IoError naming line, column or JSON Pointer, what was found and what was expected
Scene readScene(const std::filesystem::path& path);
/// The same from memory. @param path names the text in errors and gives the folder of its paths
Scene parseScene(std::string text, const std::filesystem::path& path);

/// The text of a scene file that lies in `folder`: paths are written relative to it.
std::string formatScene(const Scene& scene, const std::filesystem::path& folder);
/// Writes atomically. @throw IoError
void writeScene(const Scene& scene, const std::filesystem::path& path);

std::string_view toString(Axis axis) noexcept;        ///< "x", "y", "z"
std::string_view toString(Normals normals) noexcept;  ///< "turn", "recompute", "keep"

}  // namespace fielddeform::scene
