#pragma once

#include <fielddeform/core/types.h>

#include <optional>
#include <string>
#include <vector>

namespace fielddeform::skeleton {

enum class PrimitiveType : std::uint8_t { Points, Polyline, Mesh };

/// Which potential energy function a primitive spreads (field/potential.h has the formulas).
enum class Potential : std::uint8_t { Exponential, Gaussian, Metaball, SoftObject };

/// One primitive of a skeleton: a set of points, a polyline, or an open or closed polygon mesh.
struct Primitive {
  std::string name;                       ///< unique within a skeleton
  PrimitiveType type = PrimitiveType::Polyline;
  bool closed = false;                    ///< polyline: last joins first; mesh: bounds a solid, distance is signed
  std::vector<Vec3> points;               ///< #P by 3, world
  std::vector<std::vector<Index>> faces;  ///< meshes only; a polygon is the fan from its corner 0
  std::optional<double> radius;           ///< influence radius, world units, > 0; absent: chosen later
  std::vector<double> pointRadius;        ///< #P or empty: radius per point, interpolated along the primitive
  std::vector<double> roll;               ///< #P or empty: turn about the tangent (polylines), radians, right-handed
  double weight = 1;                      ///< factor on the potential, >= 0
  std::optional<Potential> potential;     ///< absent: the field's own
  std::optional<Quat> rotation;           ///< points only: the posed orientation of the whole set
};

struct Skeleton {
  std::vector<Primitive> primitives;
  std::string extras;                     ///< JSON text of the file's "extras", passed through; may be empty

  const Primitive* find(std::string_view name) const noexcept;
};

/// How a primitive of the rest skeleton relates to the posed one.
enum class PairKind : std::uint8_t {
  Matched,   ///< same type and vertex count: vertex i went to vertex i
  Replaced,  ///< paired by name (or explicitly), but without vertex correspondence
  Removed,   ///< only at rest
  Added,     ///< only posed
};

struct PrimitivePair {
  PairKind kind = PairKind::Matched;
  Index rest = kNoIndex;   ///< index into the rest skeleton; kNoIndex if added
  Index posed = kNoIndex;  ///< index into the posed skeleton; kNoIndex if removed
};

/// A rest and a posed skeleton with their correspondence.
struct SkeletonPair {
  Skeleton rest;
  Skeleton posed;
  std::vector<PrimitivePair> pairs;  ///< rest primitives in their order, then the added ones
};

/// An explicit pair by name; overrides the pairing by equal names.
struct NamedPair {
  std::string rest, posed;
};

/// Pairs primitives by name (explicit pairs first); vertices by index.
/// @throw std::invalid_argument for an explicit name that does not exist or is used twice
SkeletonPair pairSkeletons(Skeleton rest, Skeleton posed, std::span<const NamedPair> explicitPairs = {});

/// Checks ranges: unique non-empty names, finite points, positive radii, sizes of per-point arrays, face indices, at
/// least one point a primitive (two a polyline, three a closed one or a mesh, one face a mesh).
/// @throw std::invalid_argument naming the primitive, the element, the value and the bound
void validate(const Skeleton& skeleton);

/// The number of points that a primitive of this type needs: 1, 2, or 3.
std::size_t leastPoints(PrimitiveType type, bool closed) noexcept;

std::string_view toString(PrimitiveType type) noexcept;  ///< "points", "polyline", "mesh"
std::string_view toString(Potential potential) noexcept; ///< "exponential", "gaussian", "metaball", "soft-object"
std::string_view toString(PairKind kind) noexcept;       ///< "matched", "replaced", "removed", "added"
std::optional<Potential> potentialFromString(std::string_view word) noexcept;

}  // namespace fielddeform::skeleton
