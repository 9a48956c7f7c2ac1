#pragma once

#include <fielddeform/core/types.h>

#include <array>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

/// Free-form solids: tensor-product Bezier volumes whose sizes are kept. [Rappoport, Sheffer & Bercovier 1996]
namespace fielddeform::solid {

inline constexpr int kMaxDegree = 12;
inline constexpr std::size_t kMaxPoints = 4096;  ///< of an object: its matrices are dense

/// Sides of the parameter cube: axis 2 k or its end 2 k + 1.
enum class Side : std::uint8_t { U0, U1, V0, V1, W0, W1 };
std::string_view toString(Side side) noexcept;  ///< "u0" ... "w1"

/// F(u, v, w) = sum P_ijk B_i(u) B_j(v) B_k(w), u, v, w in [0, 1]. Point (i, j, k) has the slot i + (l + 1) (j + (m + 1) k).
struct Solid {
  std::string name;
  std::array<int, 3> degree{1, 1, 1};  ///< l, m, n, 1 .. kMaxDegree
  std::vector<Index> points;           ///< a slot: which of the object's points

  std::size_t slot(int i, int j, int k) const noexcept {
    return static_cast<std::size_t>(i + (degree[0] + 1) * (j + (degree[1] + 1) * k));
  }
  std::size_t slots() const noexcept { return slot(degree[0], degree[1], degree[2]) + 1; }
};

/// The control points of a layer parallel to a side, in the order of the two other axes (the lower one runs fastest).
struct Layer {
  int first = 0, second = 0;           ///< their numbers along the two axes
  std::vector<std::size_t> slots;      ///< first * second
};
/// @param depth  0: the side itself, up to the degree: the opposite one
Layer layerOf(const Solid& solid, Side side, int depth = 0);

struct FaceRef {
  std::size_t solid = 0;
  Side side = Side::U0;
  bool operator==(const FaceRef&) const = default;
};

/// Two faces that are one: they share their control points.
struct Joint {
  FaceRef a, b;
  int continuity = 0;  ///< C^k of the parametrisation across the face: 0 .. the lower degree across it
  double ratio = 1;    ///< > 0: lengths of parameter: dF_b = ratio dF_a, and so on
};

struct Object {
  std::vector<Vec3> points;  ///< #N by 3, world: all control points, shared ones once
  std::vector<Solid> solids;
  std::vector<Joint> joints;

  /// @throw std::invalid_argument: degrees, counts, indices, names that are empty or equal, faces of a joint that are not the same
  void validate() const;
  std::size_t find(std::string_view name) const noexcept;  ///< a solid, or solids.size()
  std::vector<Vec3> pointsOf(std::size_t solid) const;     ///< a slot
};

/// A solid with points of its own, before faces are joined.
struct LooseSolid {
  std::string name;
  std::array<int, 3> degree{1, 1, 1};
  std::vector<Vec3> points;  ///< a slot
};
/// Joins faces whose control points coincide in one of the eight ways that a grid fits on itself.
/// @param tolerance  share of the object's size up to which points are the same (those of a stay)
/// @throw std::invalid_argument if faces do not coincide, or as Object::validate()
Object makeObject(const std::vector<LooseSolid>& solids, std::vector<Joint> joints, double tolerance = 1e-9);

/// For the joint's layers: which entry of b's lies on entry e of a's.
std::vector<std::size_t> matching(const Object& object, const Joint& joint);

/// Points of an object: a control point, or one of the solid's inside or surface.
struct PointRef {
  std::size_t solid = 0;
  std::variant<std::array<int, 3>, Vec3> at = std::array<int, 3>{0, 0, 0};  ///< (i, j, k), or (u, v, w) in [0, 1]
};
/// The point as a combination of the object's. @throw std::invalid_argument if out of range
std::vector<std::pair<Index, double>> combination(const Object& object, const PointRef& ref);
std::string describe(const Object& object, const PointRef& ref);
std::string describe(const Object& object, const FaceRef& ref);  ///< "body.u0"

}  // namespace fielddeform::solid
