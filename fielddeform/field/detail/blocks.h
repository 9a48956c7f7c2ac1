#pragma once

#include <fielddeform/core/types.h>

#include <array>
#include <functional>
#include <string>
#include <vector>

namespace fielddeform::field::detail {

using Cell = std::array<std::int32_t, 3>;

inline constexpr std::int32_t kSide = 8;         ///< lattice points along a block's side: an OpenVDB leaf
inline constexpr std::size_t kBlockSize = 512;

/// Points origin + voxel * (i, j, k).
struct Lattice {
  Vec3 origin = Vec3::Zero();  ///< world
  double voxel = 1;            ///< world

  Vec3 point(const Cell& c) const { return origin + voxel * Vec3(c[0], c[1], c[2]); }
  Vec3 local(const Vec3& p) const { return (p - origin) / voxel; }  ///< voxel units
};

/// The j-th point of the block that begins at `corner`, z fastest as in OpenVDB.
inline Cell pointOf(const Cell& corner, std::size_t j) {
  return {corner[0] + static_cast<std::int32_t>(j >> 6), corner[1] + static_cast<std::int32_t>(j >> 3 & 7),
          corner[2] + static_cast<std::int32_t>(j & 7)};
}

/// The m-th of a block's points in an order in which every run of 8 and of 64 is a cube: which point that is.
constexpr std::size_t nearOrder(std::size_t m) {
  const auto everyThird = [](std::size_t b) { return (b & 1) | (b >> 2 & 2) | (b >> 4 & 4); };
  return everyThird(m >> 2) << 6 | everyThird(m >> 1) << 3 | everyThird(m);
}

/// Most blocks that fit into so many megabytes at so many bytes a block, and who asks: for the message of a refusal.
struct BlockBudget {
  double megabytes = 0;
  double bytesEach = 0;
  std::string what;  ///< "the grid of \"spine\""
  double limit = 0;  ///< of all that share the memory, where `megabytes` is what is left of it; 0: the same
};

/// The blocks (8^3 points, corners at multiples of 8) that may hold something, sorted; found by halving a box, so that
/// nothing is taken before it is known to fit.
/// @param box      world
/// @param reaches  whether a ball may hold something; called from many threads. If a ball does not, no ball inside it may
/// @throw std::invalid_argument with the number of megabytes if there are more blocks than the budget allows, or the box
///        has more than 2^29 points a side
std::vector<Cell> coverBlocks(const Lattice& lattice, const Box& box, const BlockBudget& budget,
                              const std::function<bool(const Vec3& centre, double radius)>& reaches);

/// @throw std::invalid_argument with both numbers if the megabytes are more than the budget's
void requireBudget(const BlockBudget& budget, double voxel, double megabytes);

/// The blocks that hold something and a point, or come within `margin` voxels of one, sorted. Points that are not finite or
/// beyond 2^28 voxels have none.
/// @throw std::invalid_argument as above
std::vector<Cell> coverPoints(const Lattice& lattice, Points points, double margin, const BlockBudget& budget,
                              const std::function<bool(const Vec3& centre, double radius)>& reaches);

}  // namespace fielddeform::field::detail
