#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <span>

/// The root namespace holds core/: points, errors, loops, progress. Every other folder is a namespace of its own.
namespace fielddeform {

using Vec3 = Eigen::Vector3d;               ///< A point or vector, model units, right-handed.
using Mat3 = Eigen::Matrix3d;
using Quat = Eigen::Quaterniond;
using Points = std::span<const Vec3>;       ///< #P by 3, tightly packed: the memory of a numpy (n, 3) array.
using Box = Eigen::AlignedBox3d;
using Index = std::uint32_t;                ///< Index of a vertex, corner, face or sample.
inline constexpr Index kNoIndex = 0xFFFFFFFFu;

static_assert(sizeof(Vec3) == 24, "points must pack as three doubles");

}  // namespace fielddeform
