#pragma once

#include <fielddeform/core/progress.h>
#include <fielddeform/mesh/mesh.h>
#include <fielddeform/mesh/topology.h>

#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

/// The volume pass after a deformation: gives a mesh the volume back that an edit took or added, where the edit was.
/// x' = x + m(x) sum_i phi_i(x) d_i with a cubic B-spline lattice phi around what moved, and a mask m that is exactly zero on
/// what did not. docs/volume-pass.md explains the parts.
namespace fielddeform::volume {

enum class MaskKind : std::uint8_t {
  Auto,   ///< the falloff's weight, or lacking one a smooth step over the distance to what did not move
  None,   ///< 1 everywhere
  Rest,   ///< volume is taken from what the edit left alone: 1 - smoothstep(auto mask / 0.3)
  Given,  ///< LocalInput::mask
};

enum class LocalEnergy : std::uint8_t {
  Surface,  ///< mean square displacement of the surface + bending of the lattice
  Springs,  ///< the same with springs between the nodes [Hirota et al. 1999] instead of the bending
};

enum class LocalSolver : std::uint8_t {
  Exact,                ///< one factorisation, up to 8 steps, each exact by the root of a cubic; with springs the SQP of preserve.h
  AugmentedLagrangian,  ///< [Hirota et al. 1999], over levels of detail; then the last step of the exact one
};

std::string_view toString(MaskKind kind) noexcept;      ///< "auto", "none", "rest", "given"
std::string_view toString(LocalEnergy energy) noexcept; ///< "surface", "springs"
std::string_view toString(LocalSolver solver) noexcept; ///< "exact", "augmented-lagrangian"

struct LocalOptions {
  MaskKind mask = MaskKind::Auto;
  std::optional<std::array<int, 3>> nodes{};  ///< lattice nodes along x, y, z, 4 to 64 each; absent: from the part's thickness
  LocalEnergy energy = LocalEnergy::Surface;
  LocalSolver solver = LocalSolver::Exact;
  int maxIterations = 8;     ///< of the exact solver with the surface energy, >= 1; every one ends exact
  double tolerance = 1e-4;   ///< it ends earlier when no vertex moved by more than this share of the size

  /// @throw std::invalid_argument
  void validate() const;
};

/// An edit: one mesh in two states.
struct LocalInput {
  const mesh::Mesh& rest;            ///< whose volume is wanted
  Points posed;                      ///< #V by 3, world
  std::span<const double> weight{};  ///< #V in [0, 1], 0 where the edit had no influence; empty: the edit has no falloff
  std::span<const double> mask{};    ///< #V in [0, 1], for MaskKind::Given
  const mesh::EdgeTable* edges = nullptr;  ///< of the rest, if the caller has them
};

struct LocalReport {
  bool needed = false;               ///< false: the volume was as at rest to 1e-12 already, and nothing was done
  MaskKind mask = MaskKind::Auto;
  bool fromFalloff = false;          ///< the auto mask is the falloff's weight
  std::array<int, 3> nodes{};        ///< of the lattice (of the first, for more than 64 components), per axis
  std::size_t freeNodes = 0;         ///< those that reach the surface
  double length = 0;                 ///< l = 2 |V_p| / A_p of the moved part at rest, world: a tube's radius
  double cell = 0;                   ///< h, world: the lattice's longest cell edge
  std::size_t moved = 0;             ///< vertices with a mask above 0
  std::size_t components = 0;        ///< whose volumes were held
  int iterations = 0;
  double change = 0;                 ///< before the pass: dV / V of the held components together
  double deviation = 0;              ///< after it: the largest |dV / V| of a component
  double tau = 0;                    ///< |dV| / (l sum A m): share of its thickness that the part must give
  double undone = 0;                 ///< share of the edit that the pass takes back, - sum A d.u / sum A |u|^2
  double largest = 0, rms = 0;       ///< displacement by the pass, world; rms over sum A of the moved part
  std::vector<std::string> warnings; ///< sentences
};

struct LocalResult {
  std::vector<Vec3> position;        ///< #V by 3, world; vertices of mask 0 as they were posed, bit for bit
  LocalReport report;
};

/// Every connected component gets the volume back that it has at rest, to |dV / V| <= 1e-12. Components that the edit did not
/// touch are not looked at. The same bits on any number of threads; scales by powers of two exactly. Where all of the object
/// moved, its centroid and mean rotation stay.
/// Memory: about 200 bytes a moved vertex, its first half some 90 more for edges unless the caller has them. Time: about that of
/// a few fold checks.
/// @throw std::invalid_argument if counts differ, a mask or weight is out of range, or options are
/// @throw InfeasibleError if a touched component has no volume (boundary edges that moved, inconsistent orientation, vertices
///        that are not finite), if the mask leaves nothing to move, or if no such displacement restores the volume
/// @throw Cancelled
LocalResult preserveLocally(const LocalInput& input, const LocalOptions& options, Progress& progress);

}  // namespace fielddeform::volume
