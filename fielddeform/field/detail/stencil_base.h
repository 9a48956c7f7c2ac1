#pragma once

#include <fielddeform/core/types.h>
#include <fielddeform/skeleton/skeleton.h>

#include <vector>

namespace fielddeform::field::detail {

/// A point of a primitive, and the ways in which its offset surfaces lie: on a mesh where it is smooth those between two
/// normals and their opposites; elsewhere any.
struct BasePoint {
  Vec3 point;
  Vec3 from = Vec3::Zero(), to = Vec3::Zero();  ///< unit, at most a right angle apart; zero: any way
  bool anyWay() const { return from.isZero(0); }
};

/// Points of the primitive about `spacing` apart: its own first.
/// @param most   more than 64 times as many are thinned on the way
/// @param angle  a mesh's corner is smooth if its triangles' normals differ from their mean by less, radians; 0: none is,
///               and no edge or face either
std::vector<BasePoint> samplePrimitive(const skeleton::Primitive& primitive, double spacing, std::size_t most, double angle);

/// Of points in that order those that are at least `spacing` from all that were kept before.
std::vector<BasePoint> thinned(const std::vector<BasePoint>& points, double spacing);

}  // namespace fielddeform::field::detail
